"""Who can reach a base over others."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from launcher.plan.forecast.graph import check_reach, cut_off
from launcher.plan.forecast.ways import groups, next_of
from launcher.plan.prepare import load, planned
from launcher.records import SENSES, FieldInfo, Flow, Place, Plan
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.wire.messages import Doa


def test_groups_and_those_without_a_way() -> None:
    links = [("a", "b"), ("b", "base"), ("c", "d")]
    assert groups("abcde", links[:1]) == [["a", "b"], ["c"], ["d"], ["e"]]
    assert groups([*"abcd", "base"], links) == [["a", "b", "base"], ["c", "d"]]
    assert cut_off("abcd", links, ["base"]) == ["c", "d"]


def test_the_way_of_least_cost_leads_to_the_nearest_base() -> None:
    costs = {("a", "base"): 3.0, ("a", "b"): 1.0, ("b", "base"): 1.5, ("c", "other"): 1.0, ("base", "c"): 0.1}
    assert next_of(costs, ["base"]) == {"a": "b", "b": "base"}
    assert next_of(costs, ["base", "other"]) == {"a": "b", "b": "base", "c": "other"}


def test_a_way_has_a_direction() -> None:
    assert cut_off("a", [("base", "a")], ["base"]) == ["a"]
    assert groups(["a", "base"], [("base", "a")]) == [["a", "base"]]


PAIRS = st.lists(st.tuples(st.sampled_from("abcdefg"), st.sampled_from("abcdefg")), max_size=15)


@settings(max_examples=100, deadline=None)
@given(PAIRS)
def test_who_has_a_way_is_in_the_group_of_a_base(links: list[tuple[str, str]]) -> None:
    found = groups("abcdefg", links)
    assert sorted(id for group in found for id in group) == list("abcdefg")
    home = next(group for group in found if "a" in group)
    both = [*links, *((dst, src) for src, dst in links)]
    assert cut_off("abcdefg", both, ["a"]) == sorted(set("abcdefg") - set(home))
    assert set(cut_off("abcdefg", links, ["a"])) >= set("abcdefg") - set(home)


def plan_of(*xs: float) -> Plan:
    """A base at 0, nodes along a line, all within 2 km of each other speak to each other."""
    ids = ["base", *(f"n{k}" for k in range(1, len(xs) + 1))]
    at = dict(zip(ids, (0.0, *xs), strict=True))
    specs = tuple(ProcessSpec(id, "node", "none", x=x) for id, x in at.items())
    places = tuple(Place(id, "node", x, 0.0, frozenset({SENSES} if id != "base" else ())) for id, x in at.items())
    pairs = tuple((a, b) for a in ids for b in ids if a != b and abs(at[a] - at[b]) < 2000)
    run = RunSpec("r", 1, NS, {"model": "fixed", "range_m": 100.0})
    info = FieldInfo("r", "hand", places, (), (), 1.0)
    return Plan(run, specs, {}, info, flows=(Flow(Doa(1, 0.0, 0.0), pairs, near=True),))


def test_a_chain_reaches_and_a_gap_is_refused() -> None:
    check_reach(plan_of(90.0, 180.0, 270.0), ["base"])
    with pytest.raises(ScenarioError) as told:
        check_reach(plan_of(90.0, 190.1, 270.0, 5000.0), ["base"])
    said = str(told.value)
    assert "3 of 4 processes cannot reach base by radio (n2, n3, n4)" in said
    assert "2 groups apart from every base" in said
    assert "at least 50%" in said
    check_reach(plan_of(90.0, 190.1, 270.0), ["base", "n3"])


def test_weak_links_do_not_count() -> None:
    plan = plan_of(90.0)
    for loss, holds in ((0.5, True), (0.51, False)):
        poor = replace(plan, run=replace(plan.run, link={**plan.run.link, "loss": loss}))
        if holds:
            check_reach(poor, ["base"])
        else:
            with pytest.raises(ScenarioError, match="1 of 1 processes cannot reach base"):
                check_reach(poor, ["base"])


def test_a_field_with_a_tree_is_refused_if_it_falls_apart() -> None:
    settings = ["architecture.multihop=true", "link.tx_dbm=-25"]
    with pytest.raises(ScenarioError, match="processes cannot reach fusion by radio") as told:
        planned(load("zhai-spcpf", settings=settings))
    assert told.value.key == "link"
    planned(load("zhai-spcpf", settings=["architecture.multihop=true", "link.tx_dbm=0"]))
    planned(load("zhai-spcpf", settings=["link.tx_dbm=-25"]))
