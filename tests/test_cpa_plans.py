"""The architecture ``cpa``: what its processes are told, what is refused, and what is expected of a run."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from math import dist
from pathlib import Path
from typing import Any

import pytest

from head.hearing.choice import event_begins
from launcher.plan.architectures import Built, built, surveyed
from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.hearing.diffusing import Diffusing
from launcher.plan.forecast.hearing.events import nearest_m
from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.forecast.hearing.reached import Reached
from launcher.plan.forecast.masters.load import Load
from launcher.plan.forecast.warnings import summary, warnings
from tests.command_line import Call, trackfield
from tests.cpa_fields import RANDOM, SMALL, THREE, expected, plan_of
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.world.targets import waypoints

__all__ = ["trackfield"]

WIFI = {"model": "lognormal_prr", "radio": "wifi11b", "range_m": 30.0}
PENTAGON = ("n000", "n001", "n002", "n003", "n004")


def arranged(scenario: dict[str, Any] = SMALL, **changes: Any) -> Built:
    settings = {key.replace("__", "."): value for key, value in changes.items()}
    return built(surveyed(Scenario.load(scenario, settings)))


def head_of(field: Built, id: str) -> dict[str, Any]:
    """What the half of a node that may lead is told."""
    return dict(field.process(id).roles["hearing"].config)


def said_of(scenario: dict[str, Any] = SMALL, **changes: Any) -> tuple[str, tuple[str, ...]]:
    """Summary and warnings, without that of messages that are faster than a machine."""
    plan = plan_of(scenario, **changes)
    seen = foresee(plan)
    told = tuple(text for text in warnings(plan, seen) if "answer each other" not in text)
    return "\n".join(summary(plan, seen)), told


# --- what processes are told ------------------------------------------------------------------------------------------


def test_every_sensor_is_at_a_node_of_two_roles_and_the_base_comes_first() -> None:
    field = arranged()
    base, *nodes = field.processes
    assert (base.id, base.role, (base.x, base.y)) == ("base", "sink", (30.0, -25.0))
    assert [node.id for node in nodes] == list(PENTAGON)
    for node in nodes:
        assert (node.role, list(node.roles), node.asks) == ("ear", ["ear", "hearing"], "base")
        assert (node.roles["ear"].clock, node.roles["hearing"].clock) == ("keeps", "follows")
        assert node.senses
        assert list(node.fuses) == list(PENTAGON)
    assert [view.name for view in field.views] == ["in-network", "base"]
    assert field.views[0].sources == PENTAGON


def test_all_messages_of_diffusion_are_for_those_in_reach() -> None:
    for process in arranged().processes:
        assert {"interest", "data", "reinforce", "data-ack", "announce"} == set(process.sends) == set(process.hears)
        assert all(ids == ("*",) for ids in process.sends.values())


def test_where_the_loudest_leads_reports_and_fixes_are_for_all_in_reach_too() -> None:
    field = arranged(RANDOM)
    assert set(field.process("n000").sends) >= {"cpa-report", "fix"}
    assert field.process("n000").roles["ear"].config["broadcasts"] is True
    with_sds = arranged(RANDOM, sensor__variances=True)
    assert "cpa-report-sds" in with_sds.process("n000").sends


def test_clusters_are_sensors_one_after_the_other() -> None:
    field = arranged(THREE)
    groups = [head_of(field, id)["settings"]["group"] for id in ("n000", "n007", "n014")]
    assert groups == [[f"n{i:03}" for i in range(first, first + 5)] for first in (0, 5, 10)]
    assert head_of(field, "n007")["settings"]["numbers"]["n014"] == 14


def test_a_head_hears_the_sensors_of_its_cluster_and_no_others() -> None:
    field = arranged(THREE)
    places = {id: (x, y) for id, x, y in field.site.sensors}
    for id in ("n000", "n005", "n010"):
        settings = head_of(field, id)["settings"]
        xs, ys = zip(*(places[one] for one in settings["group"]), strict=True)
        middle = sum(xs) / 5, sum(ys) / 5
        inside = [one for one, place in places.items() if dist(place, middle) <= settings["radius_m"]]
        assert inside == settings["group"] == list(field.process(id).fuses)


def test_heads_of_the_next_clusters_tell_each_other() -> None:
    field = arranged(THREE)
    assert [head_of(field, id)["settings"]["hand_m"] for id in ("n000", "n005", "n010")] == pytest.approx(
        [2 * dist((0, 0), (60, 3)), 2 * dist((0, 0), (60, 3)), 2 * dist((60, 3), (120, -2))]
    )
    assert head_of(arranged(), "n000")["settings"]["hand_m"] == 0.0


def test_the_field_is_set_up_before_its_first_step() -> None:
    site = surveyed(Scenario.load(SMALL))
    assert 5 * NS < site.origin_ns < 30 * NS
    config = arranged().process("n002").roles["ear"].config
    assert config["keeping"]["settled_ns"] == site.origin_ns
    assert config["announcing"]["announce_ns"] == config["keeping"]["start_ns"]
    without = surveyed(Scenario.load(SMALL, {"clock": {"offset_ms": 0.0, "drift_ppm": 0.0}}))
    assert without.origin_ns < site.origin_ns


def test_a_head_closes_an_event_as_its_first_tracker_does() -> None:
    assert head_of(arranged(), "n000")["times"]["close_ns"] == 1_500_000_000
    own = arranged(fusion__options={"ml": {"close_s": 2.5}})
    assert head_of(own, "n000")["times"]["close_ns"] == 2_500_000_000
    other = arranged(fusion__trackers=["ukf"])
    assert head_of(other, "n000")["times"]["close_ns"] == 1_500_000_000


def test_slower_links_make_everybody_wait_longer() -> None:
    quick, slow = (arranged(link__delay_ms=delay).process("n000").roles["ear"].config for delay in (5.0, 15.0))
    assert slow["diffusion"]["patience_ns"] == quick["diffusion"]["patience_ns"] + 4 * 10_000_000


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["architecture.size=3"], "architecture.size: is 3; expected a whole number from 4 to 50"),
        (["architecture.size=4"], "architecture.size: is 4, and of 5 sensors the last 1 are a cluster of their own; "),
        (["architecture.heads='nearest'"], 'architecture.heads: is "nearest"; expected one of fixed, loudest'),
        (["architecture.base=n000"], "architecture.base: is 'n000', which is also a sensor's id"),
        (["architecture.interest_s=1"], "architecture.interest_s: is 1; expected a number from 3 to 3600"),
        (["architecture.reports=9"], "architecture.reports: is 9; expected a whole number from 0 to 8"),
        (["run.setup_s=1"], "run.setup_s: is 1 s, and it takes "),
        (["fusion.deadline_s=0.1"], "fusion.deadline_s: is 0.1 s, and a report that goes 2 hops takes up to 0."),
        (["link.delay_ms=200"], "target.step_s: is 0.5 s, and a report that goes 2 hops takes up to "),
        (
            ["link.range_m=20"],
            "link: n000, the head of 5 sensors, is reached in 4 hops not by all (n001 by no way, n002 by no way, n003 "
            "by no way); expected links that deliver at least 50% of the messages",
        ),
        (["architecture.most_hops=1"], "is reached in 1 hops not by all (n002 by 2 hops, n003 by 2 hops)"),
        (
            ["sensor={kind='range', range_m=50}", "fusion.trackers=['ukf']"],
            "sensor.kind: is 'range', which reports in messages 'range', and with architecture cpa heads solve for ",
        ),
        (
            ["field={layout='random', nodes=3, spacing_m=20}", "architecture.heads=loudest"],
            "field: the field has 3 sensors; expected at least 4",
        ),
    ],
)
def test_one_message_says_what_is_wrong(trackfield: Call, tmp_path: Path, settings: list[str], says: str) -> None:
    file = tmp_path / "field.toml"
    file.write_text(Scenario.load(SMALL).to_toml())
    said = trackfield("validate", file, *(word for one in settings for word in ("--set", one)))
    assert said.code == 2
    assert says in said.err
    assert len(said.err.splitlines()) == 1


# --- who is reached ---------------------------------------------------------------------------------------------------


def test_sides_hop_and_diagonals_do_not() -> None:
    reached = Reached.of(plan_of())
    assert reached.hops("n000") == {"n000": 0, "n001": 1, "n004": 1, "n002": 2, "n003": 2, "base": 3}
    assert reached.way("n002", "n000") == (("n002", "n001"), ("n001", "n000"))
    assert reached.way("n000", "base") == (("n000", "n004"), ("n004", "n003"), ("n003", "base"))
    assert reached.way("n000", "n000") == ()
    assert len(reached.apart) == 1


def test_who_is_cut_off_is_in_another_group() -> None:
    reached = Reached({"a": ("b",), "b": ("a",), "c": ()})
    assert reached.apart == [["a", "b"], ["c"]]
    assert reached.hops("c") == {"c": 0}
    assert reached.way("a", "c") == ()


def test_links_of_one_direction_are_none() -> None:
    """Data needs acknowledgements, so a node that is heard but hears nobody is no neighbour."""
    plan = plan_of()
    flows = [replace(one, pairs=tuple(p for p in one.pairs if p != ("n000", "n001"))) for one in plan.flows]
    assert Reached.of(replace(plan, flows=tuple(flows))).hops("n000")["n001"] == 4


# --- events -----------------------------------------------------------------------------------------------------------


def test_each_pass_is_an_event_of_its_cluster() -> None:
    field = expected(plan_of())
    assert [(event.head, len(event.heard), event.missed) for event in field.events] == [("n000", 5, {})] * 2
    first, second = ((event.last_ns - field.plan.origin_ns) / NS for event in field.events)
    assert (first, second) == pytest.approx((12.3, 32.3), abs=0.1)  # past the last sensor at 11.2 s, sound, 1 s
    assert len(field.fixes) == 2


def test_events_of_several_clusters_follow_each_other() -> None:
    field = expected(plan_of(THREE))
    assert [event.head for event in field.events] == ["n000", "n005", "n010"]
    assert all(len(event.heard) == 5 for event in field.events)


def test_sensors_beyond_range_are_missed_and_named() -> None:
    text, told = said_of(sensor__range_m=15.0)
    assert (
        "passes: 2 events in 1 cluster, with 3.0 reports each that reach their heads; enough for a fix (4) in 0" in text
    )
    (few,) = told
    assert few.startswith("2 of 2 events have too few reports for a fix (4): 3 at n000 at ")
    assert "beyond range: the target passes n000 at 18 m, n003 at 18 m" in few


def test_around_the_loudest_events_have_the_reports_of_those_near_it() -> None:
    """Every report is in some event. A head has those of two ranges around it, of 5 s with its own."""
    plan = plan_of(RANDOM)
    field, places = expected(plan), {place.id: (place.x, place.y) for place in plan.info.places}
    told = {id for id, steps in plan.passes.items() if steps}
    assert {id for event in field.events for id in event.heard} == told
    for event in field.events:
        assert event.head in event.heard
        assert all(dist(places[id], places[event.head]) <= 40.0 for id in event.heard)
        assert max(event.heard.values()) - min(event.heard.values()) <= 5 * NS


def test_a_slow_target_makes_several_events_of_one_span_each() -> None:
    """It passes sensors for 40 s: a head does not have those before its own pass and those after it, 5 s each."""
    slow = {**RANDOM["target"], "waypoints": [[0, -40, 30], [40, 140, 70]], "steps": 80}
    events = expected(plan_of({**RANDOM, "target": slow})).events
    assert len(events) > 2
    assert all(max(event.heard.values()) - min(event.heard.values()) <= 5 * NS for event in events)


@pytest.mark.parametrize(
    ("own", "times", "begin"),
    [
        (10, [10], 10),
        (10, [4, 10, 16], 10),  # 4 is not with it, 16 is not either
        (10, [6, 8, 10, 12], 8),  # of two with three each that in whose middle it is
        (10, [6, 7, 8, 10, 13], 6),
        (10, [3, 10, 13, 15], 10),
    ],
)
def test_an_event_is_the_span_in_which_most_passes_are(own: int, times: list[int], begin: int) -> None:
    assert event_begins(own * NS, [one * NS for one in times]) == begin * NS


def test_the_louder_of_two_leads_the_other_one_is_in_its_event() -> None:
    """A target passes a square of sensors, nearest to the last one, which all others hear."""
    square = {**RANDOM["field"], "layout": "grid", "nodes": 4, "spacing_m": 10.0}
    target = {**RANDOM["target"], "waypoints": [[0, -60, 12], [14, 80, 8]]}
    (event,) = expected(plan_of({**RANDOM, "field": square, "target": target})).events
    assert event.head == "n003"  # at (10, 10), passed at 0 m
    assert sorted(event.heard) == ["n000", "n001", "n002", "n003"]


def test_how_near_a_target_comes_is_looked_up_in_time() -> None:
    path = waypoints([(0, 0, 0), (10, 100, 0)])
    assert nearest_m(path, (50, 7), 0, 10 * NS) == pytest.approx(7.0, abs=0.1)
    assert nearest_m(path, (50, 7), 8 * NS, 10 * NS) == pytest.approx(30.8, abs=0.1)
    assert nearest_m(path, (50, 7), 20 * NS, 21 * NS) == float("inf")


def test_of_a_long_run_all_events_are_counted_and_the_rest_by_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two passes in 180 s, of which the rest is quiet."""
    target = {**SMALL["target"], "waypoints": [*SMALL["target"]["waypoints"], [180, -135, -7]], "steps": 360}
    field = expected(plan_of({**SMALL, "target": target, "link": WIFI}))

    def looked(field: Passed, most: int = 200) -> Load:
        monkeypatch.setattr("launcher.plan.forecast.masters.load.MOST_LOOKED", most)
        return Load.of(field)

    few, whole = looked(field), looked(field, 1000)
    assert (whole.every, whole.quiet) == (1.0, ())
    assert few.every_quiet == pytest.approx(358 / 200, abs=0.02)
    all_, events, quiet = (Counter(one.kind for one in frames) for frames in (whole.steps, few.steps, few.quiet))
    assert events["data"] == all_["data"] == 18
    assert quiet["data"] == 0
    assert events["interest"] + few.every_quiet * quiet["interest"] == pytest.approx(all_["interest"], rel=0.15)
    assert few.crowd is not None
    assert whole.crowd is not None
    assert few.crowd.use_mean == pytest.approx(whole.crowd.use_mean, rel=0.15)
    assert few._busiest["n000"] == pytest.approx(whole._busiest["n000"], rel=0.15)


# --- what is expected -------------------------------------------------------------------------------------------------


def test_a_good_field_has_no_warning() -> None:
    text, told = said_of()
    assert told == ()
    assert "enough for a fix (4) in 2" in text
    assert "messages: 12 of interests every 3 s; 9.0 of data and 9.0 acknowledgements for an event" in text
    assert "reports: about 10 from 5 sensor nodes; 100.0% arrive (delay 10 ms, 95% within 20 ms" in text


def test_interests_of_a_flood_are_handed_on_once_by_each_within_their_hops() -> None:
    """The base's by all six; of a head by those from whom another hop is allowed: all but the base, which is 3 away."""
    few, all_ = (list(Diffusing(expected(plan_of(architecture__most_hops=hops))).refresh()) for hops in (2, 16))
    assert sorted(one.src for one in few) == sorted(["base", *PENTAGON, "n000", "n001", "n004"])
    assert len(all_) == 12


def test_heads_want_fixes_of_each_other_if_there_are_several() -> None:
    own = [one for one in Diffusing(expected(plan_of(THREE))).refresh() if one.t_ns == 0]
    assert sorted(one.src for one in own) == ["base", *["n000"] * 2, *["n005"] * 2, *["n010"] * 2]


def test_losses_are_expected_of_two_tries_a_hop() -> None:
    seen = foresee(plan_of(link__loss=0.2))
    hops = [0, 1, 2, 2, 1]
    assert seen.arriving == pytest.approx(sum((1 - 0.2**2) ** n for n in hops) / 5, abs=1e-9)


def test_a_base_out_of_reach_is_named() -> None:
    text, told = said_of(fusion__x_m=100.0)
    assert "0 of 2 are told the base" in text
    assert told[0].startswith("the radio leaves the field in 2 groups that do not reach each other, the largest of 5")
    assert told[1].startswith("no way by radio leads to base from 1 head (n000): it is not told of their fixes")


def test_reports_of_many_hops_may_be_too_late(tmp_path: Path) -> None:
    """A head leads a chain of six sensors, the last of them five hops away."""
    file = tmp_path / "chain.csv"
    file.write_text("id,x,y\n" + "".join(f"n{i},{25 * i - 62},{6 * (i % 2) + 3}\n" for i in range(6)))
    chain = {**SMALL, "field": {"layout": "file", "file": str(file)}}
    settings = {"architecture__size": 6, "architecture__most_hops": 8, "fusion__max_age_s": 0.0}
    assert not any("hops" in one for one in said_of(chain, **{**settings, "fusion__max_age_s": 2.0})[1])
    (late,) = [one for one in said_of(chain, **settings)[1] if "hops" in one]
    assert late.startswith("reports go up to 5 hops, which takes up to 0.5")
