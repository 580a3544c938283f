"""``passes`` of metrics.json, and ``leaders`` where clusters hear passes: exact small cases, and runs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import cos, radians, sin
from typing import Any

import pytest

from launcher.record.figures.passes.metrics import passes_metrics
from launcher.record.figures.passes.reigns import reigns
from launcher.record.figures.terms import START, TAKE_OVER, Point
from launcher.record.metrics import run_metrics
from launcher.record.tables import TrackRow
from launcher.records import Plan
from tests.cpa_fields import RANDOM, SMALL, THREE, plan_of
from tests.simulated import simulated, spcpf
from trackfield.filters.passes.types import REASONS
from trackfield.role import NS, TrackPoint
from trackfield.sensing.cpa import KNOWN_NS

SIZES = {"mean": None, "max": None}
MS = 1_000_000


@cache
def ran(name: str) -> tuple[Plan, dict[str, Any]]:
    fields = {"small": SMALL, "three": THREE, "random": RANDOM}
    plan = plan_of(fields[name])
    return plan, run_metrics(plan, *simulated(plan))


@cache
def small() -> Plan:
    return plan_of(SMALL)


def closed(step: int, event_ns: int, source: str = "n000", refused: str = "", **more: Any) -> TrackRow:
    """The point of a step in which a tracker says how an event ended; ``turned`` degrees, ``aside`` metres off."""
    plan = small()
    at_ns = plan.origin_ns + step * plan.step_ns
    x, y, vx, vy = plan.paths["target"].at(event_ns / NS) or (0.0, 0.0, 1.0, 0.0)
    turn, size = radians(more.get("turned", 0.0)), more.get("faster", 1.0)
    vx, vy = size * (vx * cos(turn) + vy * sin(turn)), size * (vy * cos(turn) - vx * sin(turn))
    speed = (vx**2 + vy**2) ** 0.5
    aside = more.get("aside", 0.0)
    later_s = (at_ns - event_ns) / NS
    mean = (x + vy / speed * aside + vx * later_s, y - vx / speed * aside + vy * later_s, vx, vy)
    point = TrackPoint(
        "ml", "target", at_ns, "tracking",
        () if refused else mean,
        () if refused else tuple(float(i % 5 == 0) for i in range(16)),
        tuple(more.get("sensors", plan.reaches)),
        source=source, step=step, term=more.get("term", step), event_ns=event_ns, refused=refused,
        origin=more.get("origin", ""),
    )  # fmt: skip
    return TrackRow(at_ns + more.get("after_ms", 300) * MS, point)


def first_pass() -> tuple[int, int]:
    """When (ns) the target of the first event was nearest to the middle of the field, and to its last sensor."""
    plan = small()
    times = [at_ns for one in plan.passes.values() for at_ns in one.values() if at_ns - plan.origin_ns < 20 * NS]
    return sum(times) // len(times) - KNOWN_NS, max(times) - KNOWN_NS


def figures(*rows: TrackRow) -> dict[str, Any]:
    found = passes_metrics(small(), list(rows))["trackers"]["ml"]
    assert isinstance(found, dict)
    return found


# --- fixes ------------------------------------------------------------------------------------------------------------


def test_without_passes_there_is_nothing() -> None:
    plan = spcpf(1, ["target.steps=5"])
    found = run_metrics(plan, *simulated(plan))["passes"]
    assert (found["events"], found["enough"]) == (0, 0)
    for one in found["trackers"].values():
        assert (one["fixes"], one["false_fixes"], one["refused"], one["fixes_per_pass"]) == (0, None, {}, None)
        assert one["location_m"] == one["heading_deg"] == one["delay_s"] == SIZES


def test_passes_that_nobody_solved_count_as_such() -> None:
    found = passes_metrics(small(), [])
    assert (found["events"], found["enough"]) == (2, 2)
    assert (found["trackers"]["ml"]["fixes"], found["trackers"]["ml"]["fixes_per_pass"]) == (0, 0.0)


@pytest.mark.parametrize(
    ("off", "errors"),
    [
        ({}, (0.0, 0.0, 0.0)),
        ({"faster": 1.1}, (0.0, 1.341, 0.0)),
        ({"aside": 2.0}, (2.0, 0.0, 0.0)),
        ({"turned": 180.0}, (0.0, 0.0, 180.0)),
    ],
)
def test_a_fix_is_off_by_its_line_its_speed_and_its_heading(off: dict[str, Any], errors: tuple[float, ...]) -> None:
    event_ns, _ = first_pass()
    found = figures(closed(30, event_ns, **off))
    means = [found[key]["mean"] for key in ("location_m", "speed_m_s", "heading_deg")]
    assert means == pytest.approx(errors, abs=1e-3)


def test_mean_and_worst_are_of_all_fixes() -> None:
    event_ns, last_ns = first_pass()
    rows = [closed(step, event_ns, aside=aside) for step, aside in ((30, 1.0), (32, 3.0))]
    found = figures(*rows)
    assert found["location_m"] == {"mean": pytest.approx(2.0), "max": pytest.approx(3.0)}
    assert found["fixes_per_pass"] == 1.0
    delays = [(row.told_ns - last_ns) / NS for row in rows]
    assert found["delay_s"] == {"mean": pytest.approx(sum(delays) / 2), "max": pytest.approx(max(delays))}


def test_the_reports_of_an_event_are_those_since_the_one_before() -> None:
    event_ns, _ = first_pass()
    before = closed(28, event_ns, sensors=["n000", "n001"])
    waiting = replace(before, point=replace(before.point, event_ns=None, mean=(), covariance=()))
    ends = [closed(30, event_ns, sensors=["n002", "n003"]), closed(60, event_ns + 20 * NS, sensors=["n004"])]
    assert figures(waiting, *ends)["reports_used"] == pytest.approx((4 + 1) / 2)


def test_a_fix_that_no_target_passed_is_false_and_has_no_error() -> None:
    found = figures(closed(60, first_pass()[0] + 10 * NS))
    assert (found["fixes"], found["false_fixes"], found["fixes_per_pass"]) == (1, 1, 0.0)
    assert found["location_m"] == found["delay_s"] == SIZES


def test_an_event_without_a_fix_counts_by_its_reason() -> None:
    event_ns, _ = first_pass()
    found = figures(*(closed(step, event_ns, refused=REASONS[why]) for step, why in ((30, 1), (31, 4), (32, 4))))
    assert (found["fixes"], found["refused"]) == (0, dict(sorted({REASONS[1]: 1, REASONS[4]: 2}.items())))
    assert found["reports_used"] is None


def test_what_the_base_is_told_is_no_fix_of_its_own_but_says_when_it_knew() -> None:
    event_ns, last_ns = first_pass()
    fix = closed(30, event_ns)
    told = closed(31, event_ns, source="base", origin="n000", term=30)
    refused = closed(40, event_ns, source="base", refused=REASONS[1])
    other = closed(31, event_ns, source="base", origin="n000", term=29, after_ms=100)
    found = figures(fix, told, refused, other)
    assert (found["fixes"], found["refused"]) == (1, {})
    assert found["base_delay_s"]["mean"] == pytest.approx((told.told_ns - last_ns) / NS)


@pytest.mark.parametrize(("name", "events"), [("small", 2), ("three", 3)])
def test_each_pass_of_a_run_has_a_fix(name: str, events: int) -> None:
    _, metrics = ran(name)
    found = metrics["passes"]["trackers"]["ml"]
    assert metrics["passes"]["events"] == metrics["passes"]["enough"] == found["fixes"] == events
    assert (found["false_fixes"], found["fixes_per_pass"], found["reports_used"]) == (0, 1.0, 5.0)
    assert found["location_m"]["max"] < 1.0
    assert found["heading_deg"]["max"] < 2.0
    assert found["delay_s"]["mean"] < found["base_delay_s"]["mean"] < 3.0


def test_a_fusion_centre_solves_too() -> None:
    plan = plan_of({**SMALL, "architecture": {"kind": "centralised"}}, link__range_m=200.0)
    found = run_metrics(plan, *simulated(plan))["passes"]
    assert (found["events"], found["trackers"]["ml"]["fixes"]) == (2, 2)
    assert found["trackers"]["ml"]["location_m"]["max"] < 1.0
    assert found["trackers"]["ml"]["base_delay_s"] == SIZES


def test_a_run_whose_targets_nobody_knows_counts_fixes_alone() -> None:
    plan, row = small(), closed(30, first_pass()[0])
    found = passes_metrics(replace(plan, paths={}), [row])
    one = found["trackers"]["ml"]
    assert (found["events"], one["fixes"], one["false_fixes"], one["fixes_per_pass"]) == (0, 1, None, None)
    assert one["location_m"] == SIZES


# --- who leads --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "most"), [("small", 1), ("three", 3)])
def test_heads_of_clusters_do_not_take_over_from_each_other(name: str, most: int) -> None:
    _, metrics = ran(name)
    leaders = metrics["leaders"]
    assert (leaders["per_step_max"], leaders["two_leader_steps"]) == (most, 0)
    assert (leaders["take_overs"], leaders["false_take_overs"], leaders["reports_used"]) == (0, 0, None)


def test_after_the_death_of_a_head_another_takes_over() -> None:
    plan = plan_of(SMALL, faults=[{"kind": "kill", "nodes": ["n000"], "at_s": 13}])
    leaders = run_metrics(plan, *simulated(plan))["leaders"]
    assert (leaders["take_overs"], leaders["false_take_overs"]) == (1, 0)


def test_a_head_that_lives_on_was_wrongly_taken_over_from() -> None:
    points = [Point("a", 0, 0, 100), Point("b", 0, 5, 200), Point("a", 0, 6, 300), Point("z", 0, 0, 250)]
    found = reigns(points, [("a", "b")], {("a", 0): 300, ("b", 0): 210})
    assert [(reign.turn.leader, reign.turn.how, reign.turn.false, reign.until_ns) for reign in found] == [
        ("a", START, False, 100),
        ("b", TAKE_OVER, True, 200),
        ("a", TAKE_OVER, False, 300),
    ]


def test_without_fixed_clusters_each_event_has_a_head_of_its_own() -> None:
    points = [Point(id, 0, 0, second * NS) for id, second in (("a", 1), ("b", 2), ("a", 3), ("a", 20))]
    found = reigns(points, (), {})
    assert [
        (reign.turn.leader, reign.turn.how, reign.turn.begun_ns // NS, reign.until_ns // NS) for reign in found
    ] == [
        ("a", START, 1, 3),
        ("b", START, 2, 2),
        ("a", START, 20, 20),
    ]
