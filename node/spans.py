"""Sets of mostly consecutive whole numbers, as disjoint spans (first, last) in order."""

from __future__ import annotations

Spans = tuple[tuple[int, int], ...]


def insert(spans: Spans, number: int) -> Spans:
    """The set with ``number`` in it."""
    if first_absent(spans, number) != number:
        return spans
    i = len(spans)
    while i and spans[i - 1][0] > number:
        i -= 1
    first = last = number
    before, after = spans[:i], spans[i:]
    if before and before[-1][1] == number - 1:
        first, before = before[-1][0], before[:-1]
    if after and after[0][0] == number + 1:
        last, after = after[0][1], after[1:]
    return (*before, (first, last), *after)


def first_absent(spans: Spans, number: int) -> int:
    """The first number from this one on that the set does not hold."""
    for first, last in reversed(spans):
        if last < number:
            break
        if first <= number:
            return last + 1  # spans are disjoint: a gap begins here
    return number
