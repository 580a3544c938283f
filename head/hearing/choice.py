"""Which of the nodes that heard a target pass a solver is given: five on their convex hull.

Yang et al., section 3.3.1: five triggered sensors on the hull, which the path crosses, two of them those with the
earliest and the latest time. Which other three it leaves open: here those that make the area largest. In many passes
fewer than five triggered nodes are on the hull; then the loudest of the others fill up.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Final, NamedTuple

from trackfield.role import NS

Point = tuple[float, float]
MOST: Final = 8
"""So many reports are used at most, if all are."""


EVENT_NS: Final = 5 * NS
"""A vehicle passes a cluster in so long (Yang et al., section 4.2)."""


def event_begins(own_ns: int, times_ns: Sequence[int]) -> int:
    """When (ns) of the ``EVENT_NS`` with an own pass those begin in which most passes are.

    Each begins with one of the passes. Of several with as many passes it is the one that has the own pass nearest to
    the middle.
    """
    begins = [at_ns for at_ns in times_ns if 0 <= own_ns - at_ns <= EVENT_NS]

    def rated(begin: int) -> tuple[int, int]:
        span = [at_ns for at_ns in times_ns if 0 <= at_ns - begin <= EVENT_NS]
        return len(span), -abs(own_ns - (begin + max(span)) // 2)

    return max(begins, key=rated)


class Choice(NamedTuple):
    """The ``ids`` that were chosen, in the order of their times, and how, in ``words``."""

    ids: tuple[str, ...]
    words: str


class Heard(NamedTuple):
    """The nodes that heard the pass, each with its place (m), time (s) and strength (dB)."""

    ids: Sequence[str]
    places: Sequence[Point]
    times: Sequence[float]
    strengths: Sequence[float]


def chosen(heard: Heard, count: int = 5) -> Choice:
    """``count`` of the nodes that heard a pass (0: all, but ``MOST`` at most), or all if there are no more."""
    order = sorted(range(len(heard.ids)), key=lambda i: (heard.times[i], heard.ids[i]))
    loud = sorted(order, key=lambda i: (-heard.strengths[i], heard.ids[i]))
    if len(order) <= (count or MOST):
        return Choice(_named(heard, order), f"all {len(order)}")
    if not count:
        return Choice(_named(heard, loud[:MOST]), f"the {MOST} loudest of {len(order)}")
    ends = [order[0], order[-1]]
    hull = [i for i in sorted(_hull(heard.places)) if i not in ends]
    if len(ends) + len(hull) >= count:
        found = max(combinations(hull, count - 2), key=lambda others: _rated(heard, (*ends, *others)))
        return Choice(_named(heard, (*ends, *found)), f"{count} on the hull of {len(order)}")
    kept = [*ends, *hull]
    filled = [i for i in loud if i not in kept][: count - len(kept)]
    words = f"{len(kept)} on the hull of {len(order)} and the {len(filled)} loudest others"
    return Choice(_named(heard, (*kept, *filled)), words)


def _named(heard: Heard, which: Iterable[int]) -> tuple[str, ...]:
    return tuple(heard.ids[i] for i in sorted(which, key=lambda i: (heard.times[i], heard.ids[i])))


def _rated(heard: Heard, which: Sequence[int]) -> tuple[float, float]:
    """The area of the hull of some nodes (m2) and, of equal ones, how loud they are together."""
    places = [heard.places[i] for i in which]
    corners = [places[i] for i in _hull(places)]
    turns = zip(corners, [*corners[1:], *corners[:1]], strict=True)
    return sum(ax * by - bx * ay for (ax, ay), (bx, by) in turns) / 2, sum(heard.strengths[i] for i in which)


def _hull(places: Sequence[Point]) -> list[int]:
    """The corners of the convex hull, counterclockwise, as indices (Andrew's monotone chain)."""
    order = sorted(range(len(places)), key=lambda i: (places[i], i))
    lower, upper = _chain(places, order), _chain(places, order[::-1])
    return [*lower[:-1], *upper[:-1]] if len(order) > 1 else order


def _chain(places: Sequence[Point], order: Iterable[int]) -> list[int]:
    chain = list[int]()
    for i in order:
        while len(chain) > 1 and _turn(places[chain[-2]], places[chain[-1]], places[i]) <= 0:
            chain.pop()
        chain.append(i)
    return chain


def _turn(a: Point, b: Point, c: Point) -> float:
    """Twice the area of a triangle, positive if its corners go counterclockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
