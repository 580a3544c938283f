"""Links cut for a while."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.links import PLACES, S
from trackfield.drivers.spec import RunSpec, link_of
from trackfield.link import make_link
from trackfield.link.fate import Fate, Link, Transmission
from trackfield.link.partitioned import Cut, Partitioned

IDEAL = make_link({"model": "ideal"}, seed=1)
NAMES = ["a", "b", "c", "d"]


def causes(link: Link, src: str, dst: str, *times: int, medium: str = "field") -> list[str | None]:
    return [link.fate(Transmission(src, dst, "doa", t, 0, 12, medium=medium)).cause for t in times]


def test_a_partition_holds_from_its_begin_to_before_its_end() -> None:
    link = Partitioned(IDEAL, [(10, 20, ["a", "b"], None)])
    assert causes(link, "a", "c", 9, 10, 19, 20) == [None, "partition", "partition", None]
    assert causes(link, "c", "a", 9, 10, 19, 20) == [None, "partition", "partition", None]


def test_each_side_stays_in_touch() -> None:
    link = Partitioned(IDEAL, [(10, 20, ["a", "b"], None)])
    assert causes(link, "a", "b", 15) == causes(link, "c", "d", 15) == [None]


def test_an_empty_partition_cuts_nothing() -> None:
    assert causes(Partitioned(IDEAL, [(10, 10, ["a"], None), (0, 100, [], None)]), "a", "c", 10) == [None]


def test_a_partition_of_one_medium_leaves_the_others_alone() -> None:
    cuts: list[Cut] = [(10, 20, ["a"], "backbone"), (15, 30, ["a"], None)]
    link = Partitioned(IDEAL, cuts)
    assert causes(link, "a", "c", 10, 15, 20, 30) == [None, "partition", "partition", None]
    assert causes(link, "a", "c", 10, 15, 20, 30, medium="backbone") == ["partition"] * 3 + [None]


def test_partitions_travel() -> None:
    """As lists, in a join answer."""
    run = RunSpec("r", 1, 100, {"model": "ideal"}, partitions=((10, 20, ("a",), "backbone"), (30, 40, ("a",), None)))
    link = link_of(RunSpec(**msgpack.unpackb(msgpack.packb(asdict(run)))), {})
    assert causes(link, "a", "c", 10, 30) == [None, "partition"]
    assert causes(link, "a", "c", 10, 30, medium="backbone") == ["partition", "partition"]


MEDIA = ("field", "backbone")
CUTS = st.tuples(
    st.integers(0, 9),
    st.integers(0, 9),
    st.lists(st.sampled_from(NAMES), max_size=4),
    st.sampled_from([*MEDIA, None]),
)


@given(st.lists(CUTS, max_size=3), st.permutations(NAMES), st.integers(0, 9), st.sampled_from(MEDIA))
def test_any_active_partition_between_the_ends_cuts(
    partitions: list[Cut], names: list[str], at: int, medium: str
) -> None:
    src, dst, *_ = names
    active = [ids for a, b, ids, on in partitions if a <= at < b and (on is None or on == medium)]
    cut = any(len({src, dst} & set(ids)) == 1 for ids in active)
    assert causes(Partitioned(IDEAL, partitions), src, dst, at, medium=medium) == ["partition" if cut else None]


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
    cut = Partitioned(free, [(0, S, ["n1"], None)])
    for i in range(200):
        for broadcast in (False, True):
            frame = ("n1", dst, "doa", i, 0, 12, broadcast)
            fate = free.fate(Transmission(*frame))
            expected = Fate("partition", 0, fate.attempts, fate.bytes_on_air, 0, fate.busy_ns, fate.air_ns, 0)
            assert cut.fate(Transmission(*frame)) == expected
            later = (*frame[:3], i + S, *frame[4:])
            assert cut.fate(Transmission(*later)) == free.fate(Transmission(*later))
    assert cut.reception("n1", dst, 12) == free.reception("n1", dst, 12)
