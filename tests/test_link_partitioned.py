"""Links cut for a while."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.links import PLACES, S
from trackfield.link import make_link
from trackfield.link.fate import Fate
from trackfield.link.partitioned import Partitioned

IDEAL = make_link({"model": "ideal"}, seed=1)
NAMES = ["a", "b", "c", "d"]


def causes(link: Partitioned, src: str, dst: str, *times: int) -> list[str | None]:
    return [link.fate(src, dst, "doa", t, 0, 12).cause for t in times]


def test_a_partition_holds_from_its_begin_to_before_its_end() -> None:
    link = Partitioned(IDEAL, [(10, 20, ["a", "b"])])
    assert causes(link, "a", "c", 9, 10, 19, 20) == [None, "partition", "partition", None]
    assert causes(link, "c", "a", 9, 10, 19, 20) == [None, "partition", "partition", None]


def test_each_side_stays_in_touch() -> None:
    link = Partitioned(IDEAL, [(10, 20, ["a", "b"])])
    assert causes(link, "a", "b", 15) == causes(link, "c", "d", 15) == [None]


def test_an_empty_partition_cuts_nothing() -> None:
    assert causes(Partitioned(IDEAL, [(10, 10, ["a"]), (0, 100, [])]), "a", "c", 10) == [None]


@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9), st.lists(st.sampled_from(NAMES), max_size=4)), max_size=3),
    st.permutations(NAMES),
    st.integers(0, 9),
)
def test_any_active_partition_between_the_ends_cuts(
    partitions: list[tuple[int, int, list[str]]], names: list[str], at: int
) -> None:
    src, dst, *_ = names
    cut = any(len({src, dst} & set(ids)) == 1 for a, b, ids in partitions if a <= at < b)
    assert causes(Partitioned(IDEAL, partitions), src, dst, at) == ["partition" if cut else None]


@pytest.mark.parametrize(
    "spec",
    [
        {"model": "fixed", "loss": 0.5},
        {"model": "csma154", "busy": 0.5, "ack": 3},
        {"model": "lognormal_prr", "radio": "802154-0dbm", "busy": 0.5, "ack": 3, "range_m": 80.0},
    ],
    ids=str,
)
@pytest.mark.parametrize("dst", ["n2", "n10", "fusion", "*"])
def test_a_cut_link_costs_its_sender_as_much(spec: dict[str, Any], dst: str) -> None:
    """A partition is the first cause, before the radio; what the radio would have lost is lost to it as well."""
    free = make_link(spec, 1, PLACES)
    cut = Partitioned(free, [(0, S, ["n1"])])
    for i in range(200):
        for broadcast in (False, True):
            frame = ("n1", dst, "doa", i, 0, 12, broadcast)
            fate = free.fate(*frame)
            expected = Fate("partition", 0, fate.attempts, fate.bytes_on_air, 0, fate.busy_ns, fate.air_ns, 0)
            assert cut.fate(*frame) == expected
            later = (*frame[:3], i + S, *frame[4:])
            assert cut.fate(*later) == free.fate(*later)
    assert cut.reception("n1", dst, 12) == free.reception("n1", dst, 12)
