"""A field divided among hosts: a partition into blocks of neighbours, as equal as can be."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.blocks import Standing, blocks, number_of, span
from trackfield.errors import ScenarioError

PLACES = st.floats(-1e5, 1e5)
FIELDS = st.lists(st.tuples(PLACES, PLACES), min_size=1, max_size=60).map(
    lambda places: [Standing(f"n{i:03}", x, y) for i, (x, y) in enumerate(places)]
)


@given(FIELDS, st.data())
def test_each_process_is_in_one_block_and_blocks_are_as_large(field: list[Standing], data: st.DataObject) -> None:
    of = data.draw(st.integers(1, len(field)))
    found = blocks(field, of)
    assert len(found) == of
    assert sorted(id for block in found for id in block) == [one.id for one in field]
    assert max(map(len, found)) - min(map(len, found)) <= 1


@given(FIELDS, st.data())
def test_the_order_of_a_file_does_not_matter(field: list[Standing], data: st.DataObject) -> None:
    of = data.draw(st.integers(1, len(field)))
    assert blocks(data.draw(st.permutations(field)), of) == blocks(field, of)


@given(FIELDS, st.data())
def test_finer_blocks_keep_the_order_of_the_curve(field: list[Standing], data: st.DataObject) -> None:
    of = data.draw(st.integers(1, len(field)))
    [whole] = blocks(field, 1)
    assert tuple(id for block in blocks(field, of) for id in block) == whole


def test_neighbours_on_the_curve_are_neighbours_in_the_field() -> None:
    """Over a full square of 16 x 16 each step of a Hilbert curve is one to the side, so each block is in one piece."""
    where = {f"n{x:02}-{y:02}": (x, y) for x in range(16) for y in range(16)}
    field = [Standing(id, 25.0 * x - 70, 25.0 * y + 3) for id, (x, y) in where.items()]
    [whole] = blocks(field, 1)
    steps = [abs(where[a][0] - where[b][0]) + abs(where[a][1] - where[b][1]) for a, b in pairwise(whole)]
    assert steps == [1] * 255
    quarters = [sorted(where[id] for id in block) for block in blocks(field, 4)]
    assert all(b[-1][0] - b[0][0] == 7 and max(y for _, y in b) - min(y for _, y in b) == 7 for b in quarters)


def test_numbers_are_the_same_for_engines_that_count_from_0_and_from_1() -> None:
    assert [number_of(i, 3) for i in range(3)] == [3, 1, 2]
    assert [number_of(i, 3) for i in range(1, 4)] == [1, 2, 3]


def test_processes_in_one_place_are_divided_by_their_ids() -> None:
    field = [Standing(f"n{i}", 5.0, 5.0) for i in range(5)]
    assert blocks(field, 2) == (("n0", "n1", "n2"), ("n3", "n4"))


@pytest.mark.parametrize("of", [0, -1, 4])
def test_there_are_no_more_blocks_than_processes(of: int) -> None:
    with pytest.raises(ScenarioError, match=f"number of slices.*is {of}.*1 to 3"):
        blocks([Standing(f"n{i}", 0, i) for i in range(3)], of)


@pytest.mark.parametrize(
    ("ids", "says"),
    [
        (["n3", "n1"], "n1, n3"),
        (["n8", "n9", "n10", "base"], "base, n8..n10"),
        (["n1", "n2"], "n1, n2"),
        ([f"n{i:02}" for i in range(37, 49)], "n37..n48"),
        ([f"n{i:02}" for i in range(0, 40, 2)], "n00, n02, n04, n06, n08, n10, ..."),
        ([], ""),
    ],
)
def test_ids_in_a_few_words(ids: list[str], says: str) -> None:
    assert span(ids) == says
