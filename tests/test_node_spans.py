"""Sets of whole numbers as spans."""

from __future__ import annotations

from itertools import count, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from node.spans import Spans, first_absent, insert


@pytest.mark.parametrize(
    ("spans", "number", "after"),
    [
        ((), 5, ((5, 5),)),
        (((1, 4),), 5, ((1, 5),)),
        (((1, 4),), 6, ((1, 4), (6, 6))),
        (((6, 8),), 5, ((5, 8),)),
        (((1, 4), (6, 8)), 5, ((1, 8),)),
        (((1, 4), (8, 9)), 6, ((1, 4), (6, 6), (8, 9))),
        (((1, 4), (8, 9)), 3, ((1, 4), (8, 9))),
    ],
)
def test_spans_grow_and_join(spans: Spans, number: int, after: Spans) -> None:
    assert insert(spans, number) == after


@given(st.lists(st.integers(-5, 30)), st.integers(-8, 35))
def test_they_are_the_set_itself(numbers: list[int], wanted: int) -> None:
    spans: Spans = ()
    for number in numbers:
        spans = insert(spans, number)
    assert [n for a, b in spans for n in range(a, b + 1)] == sorted(set(numbers))
    assert all(b + 1 < c for (_, b), (c, _) in pairwise(spans))
    assert first_absent(spans, wanted) == next(n for n in count(wanted) if n not in numbers)
