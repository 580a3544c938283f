"""The bound of a run: whose reports count, from when on, with how much motion, and that it is drawn and written."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from launcher.record.figures.bounds import (
    bound_metrics,
    headline_bound,
    run_bound,
    run_bounds,
    scenario_bound,
    used,
)
from launcher.record.ledger import Ledger
from launcher.record.metrics import run_metrics, tracker_metrics
from launcher.record.tables import TrackRow, bound_of
from launcher.records import SENSES as HAS_SENSOR
from launcher.records import Plan, View
from launcher.run import run_virtual
from tests import kalman
from tests.rrd import read
from tests.sensing import arrays, registered
from tests.simulated import simulated, spcpf
from trackfield.errors import ScenarioError
from trackfield.filters.types import Gaussian
from trackfield.models import doa
from trackfield.role import NS, TrackPoint

STRAIGHT = ["target.path=waypoints", "target.waypoints=[[0, 60, 60], [20, 160, 160]]", "target.steps=20"]


def used_by(*reports: tuple[str, int]) -> list[TrackRow]:
    """Points that used these reports (sensor, step), a tracker's answer to each, off by nothing."""
    sensors = defaultdict(list)
    for sensor, step in reports:
        sensors[step].append(sensor)
    return [
        TrackRow(
            step * NS,
            TrackPoint(
                "t",
                "target",
                step * NS,
                "tracking",
                (0.0,) * 4,
                (0.0,) * 16,
                tuple(sensors[step]),
            ),
            (0.0,) * 4,
        )
        for step in sorted(sensors)
    ]


def by_step(series: Mapping[int, float]) -> dict[int, float]:
    """A bound by the number of the step, of a second each."""
    return {t_ns // NS: sd for t_ns, sd in series.items()}


def test_reports_count_that_some_point_used_whoever_published_it() -> None:
    rows = [*used_by(("n000", 1), ("n001", 1)), *used_by(("n002", 1), ("n006", 2))]
    assert used(rows) == {NS: {"n000", "n001", "n002"}, 2 * NS: {"n006"}}


def test_along_a_straight_path_it_is_the_kalman_filter_linearised_about_the_truth() -> None:
    """Reports of two sensors in the first five steps; the target does not accelerate, and tells so."""
    plan = spcpf(1, STRAIGHT)
    rows = used_by(*((src, step) for step in range(1, 6) for src in ("n012", "n013")))
    rows[:2] = [replace(row, point=replace(row.point, mean=(), covariance=())) for row in rows[:2]]  # no track yet
    rows += [replace(rows[2], point=replace(rows[2].point, at_ns=step * NS, sensors=())) for step in (6, 7, 8)]
    rows[-1] = replace(rows[-1], truth=None)
    places = np.array([[50.0, 50.0], [100.0, 50.0]])
    belief, sd = Gaussian(np.zeros(4), np.diag([20.0, 20.0, 4.0, 4.0]) ** 2), np.radians(3.0)
    expected = []
    for step in range(1, 21):
        belief = kalman.predict(belief, 1.0, 0.0)
        if step < 6:
            H = doa.jacobian(np.array([60.0 + 5 * step, 60.0 + 5 * step, 5.0, 5.0]), places)
            belief = Gaussian(belief.mean, kalman.update(belief, np.zeros(2), H, sd**2 * np.eye(2)).covariance)
        expected.append(np.sqrt(np.trace(belief.covariance[:2, :2])))
    assert by_step(run_bound(plan, rows)) == pytest.approx(dict(enumerate(expected, start=1)))
    found = bound_metrics(plan, rows, run_bound(plan, rows))  # over the steps that have a track, and a truth
    assert found["trajectory"] == pytest.approx(np.sqrt(np.mean(np.square(expected[2:7]))))
    assert found["position"] is not None and found["position"] < found["trajectory"]


@dataclass(frozen=True)
class Locator:
    """Measures the place itself."""

    range_m: float = 60.0
    sd = (2.0, 3.0)
    resolution = (0.01, 0.01)

    def simulate(self, target: Any, position: Any, normals: Any) -> tuple[float, float]:
        return target[0] + 2.0 * normals[0], target[1] + 3.0 * normals[1]

    def h(self, states: Any, positions: Any) -> Any:
        return np.repeat(states[..., None, :2], len(positions), axis=-2)

    def jacobian(self, states: Any, positions: Any) -> Any:
        return np.broadcast_to(np.eye(2, 4), (*states.shape[:-1], len(positions), 2, 4))


def test_it_goes_by_what_a_users_own_sensors_measure() -> None:
    """Without loss, so the two bounds are one: the Kalman filter that takes in as many places as sensors are near."""
    with registered(locator=Locator):
        settings = [*STRAIGHT, "sensor={kind='locator'}", "fusion.trackers=['ekf']", "link.model=ideal"]
        plan = spcpf(1, settings)
        _, tracks = simulated(plan)
        found, ideal = by_step(run_bound(plan, tracks)), by_step(scenario_bound(plan, []))
    nodes = np.array([(place.x, place.y) for place in plan.info.tagged(HAS_SENSOR)])
    belief, expected = Gaussian(np.zeros(4), np.diag([20.0, 20.0, 4.0, 4.0]) ** 2), {}
    for step in range(1, 21):
        near = int((np.hypot(*(nodes - (60.0 + 5.0 * step)).T) <= 60.0).sum())
        H, R = np.tile(np.eye(2, 4), (near, 1)), np.diag(np.tile([4.0, 9.0], near))
        P = kalman.update(kalman.predict(belief, 1.0, 0.0), np.zeros(2 * near), H, R).covariance
        belief, expected[step] = Gaussian(np.zeros(4), P), float(np.sqrt(np.trace(P[:2, :2])))
    assert found == ideal == pytest.approx(expected)


def of(source: str, row: TrackRow, *, origin: str = "", tracker: str = "t") -> TrackRow:
    return replace(row, point=replace(row.point, source=source, origin=origin, tracker=tracker))


def two_centres(plan: Plan) -> Plan:
    """Two processes track; a third one publishes what it has from them."""
    return replace(plan, views=(View("base", ("third",)), View("in-network", ("a", "b"))))


NEAR = used_by(*((src, step) for step in range(1, 21) for src in ("n012", "n013", "n024")))
FEW = used_by(*(("n025", step) for step in range(1, 21)))


def test_a_point_has_the_bound_of_the_process_that_made_it() -> None:
    """Up to step 8 from the one with few reports, then from the other: at each instant its own bound, no other's."""
    plan = two_centres(spcpf(1, STRAIGHT))
    a, b = [of("a", row) for row in FEW], [of("b", row) for row in NEAR]
    third = [of("third", row, origin="a") for row in FEW[:8]] + [of("third", row, origin="b") for row in NEAR[8:]]
    bounds = run_bounds(plan, [*a, *b, *third])
    of_a, of_b = run_bound(plan, a), run_bound(plan, b)
    assert all(of_b[t] < of_a[t] for t in of_a)
    expected = {row.t_ns: of_a[row.t_ns] for row in a[:8]} | {row.t_ns: of_b[row.t_ns] for row in b[8:]}
    assert bounds["third"] == headline_bound(plan, [*a, *b, *third], bounds) == expected
    assert (bounds["a"], bounds["b"]) == (of_a, of_b)
    assert bound_of(third[0], bounds) == of_a[NS]
    assert bound_of(replace(third[0], point=replace(third[0].point, lag=3)), bounds) is None


def test_of_trackers_that_have_theirs_from_several_the_lowest_bound_holds() -> None:
    plan = two_centres(spcpf(1, STRAIGHT))
    a, b = [of("a", row) for row in FEW], [of("b", row) for row in NEAR]
    third = [of("third", row, origin="a") for row in FEW]
    third += [of("third", row, origin="b", tracker="other") for row in NEAR[3:6]]
    bound, of_a, of_b = run_bounds(plan, [*a, *b, *third])["third"], run_bound(plan, a), run_bound(plan, b)
    assert bound == of_a | {row.t_ns: of_b[row.t_ns] for row in NEAR[3:6]}


def test_a_point_may_have_come_over_several_hops() -> None:
    plan = two_centres(spcpf(1, STRAIGHT))
    b = [of("b", row) for row in NEAR]
    relayed = [of("a", row, origin="b") for row in NEAR]
    third = [of("third", row, origin="a") for row in NEAR]
    bounds = run_bounds(plan, [*b, *relayed, *third])
    assert bounds["third"] == run_bound(plan, b)
    circle = [of("a", row, origin="third") for row in NEAR] + third  # both say that they have it from the other
    assert run_bounds(plan, circle)["third"] == run_bound(plan, NEAR)


def test_an_origin_of_which_nothing_was_recorded_used_at_least_the_reports_it_named() -> None:
    plan = two_centres(spcpf(1, STRAIGHT))
    third = [of("third", row, origin="a") for row in NEAR[:5]]
    expected = run_bound(plan, NEAR[:5])
    assert run_bounds(plan, third)["third"] == expected
    assert run_bounds(plan, []) == {}


def test_processes_that_take_turns_are_as_one() -> None:
    """One tracks up to step 10 and hands its belief on."""
    plan = two_centres(spcpf(1, STRAIGHT))
    turns = [of("a", row) for row in NEAR[:10]] + [of("b", row) for row in NEAR[10:]]
    turns = [replace(row, point=replace(row.point, term=1 + (row.t_ns > 10 * NS))) for row in turns]
    whole = run_bound(plan, turns)
    bounds = run_bounds(plan, turns)
    assert bounds == {"a": whole, "b": whole}
    plan = replace(plan, views=plan.views[::-1])
    assert headline_bound(plan, turns, bounds) == whole
    alone = run_bound(plan, turns[10:])
    assert alone[11 * NS] > 2.0 * whole[11 * NS]


def test_without_a_prior_it_begins_when_the_target_is_located() -> None:
    """A bearing before them counts, although it does not say where the target is."""
    plan = spcpf(1, [*STRAIGHT, "fusion.prior=none"])
    later = used_by(*((src, step) for step in (4, 5) for src in ("n012", "n013")))
    without = by_step(run_bound(plan, later))
    with_one = by_step(run_bound(plan, [*used_by(("n024", 2)), *later]))
    assert list(without) == list(with_one) == list(range(4, 21))
    assert all(with_one[step] < without[step] for step in without)
    assert without[4] < 5.0
    assert run_bound(plan, []) == run_bound(plan, used_by(("n012", 2))) == {}


def test_a_turn_costs_what_it_costs_a_tracker_that_sees_it_coming() -> None:
    """The corner at 10 s is the only acceleration, of sd |dv| / sqrt(2) per axis; before it all is as if straight."""
    corner = "target.waypoints=[[0, 60, 60], [10, 110, 110], [20, 160, 60]]"
    turning, straight = spcpf(1, [STRAIGHT[0], corner, STRAIGHT[2]]), spcpf(1, STRAIGHT)
    rows = used_by(*((src, step) for step in range(1, 21) for src in ("n012", "n013", "n024")))
    with_turn, without = by_step(run_bound(turning, rows)), by_step(run_bound(straight, rows))
    assert all(with_turn[step] == pytest.approx(without[step]) for step in range(1, 10))
    assert with_turn[10] > 1.5 * without[10]


@pytest.mark.parametrize("settings", [["link.model=ideal"], ["link.model=fixed", "link.loss=0.3"]])
def test_what_the_network_loses_is_between_the_two_bounds(settings: list[str]) -> None:
    plan = spcpf(2, settings)
    ledger, tracks = simulated(plan)
    bound = run_metrics(plan, ledger, tracks)["bound"]
    assert 0.9 < bound["position"] < 1.2
    if settings == ["link.model=ideal"]:
        assert bound["trajectory"] == bound["position"]
    else:
        assert bound["trajectory"] > 1.1 * bound["position"]
    best = min(one["rmse"]["position"] for one in tracker_metrics(plan, tracks).values())
    assert best > 0.9 * bound["trajectory"]


def test_where_there_is_no_bound_there_is_nothing_to_say() -> None:
    """No centre, no tracks; bearings without error are no kind of sensing."""
    plan = spcpf(1, STRAIGHT)
    exact = replace(plan, tracking={**plan.tracking, "sensing": arrays(0.0)})
    with pytest.raises(ScenarioError, match=r"sensor\.sd: .*above 0"):
        run_bound(exact, used_by(("n012", 1)))
    nobody = replace(spcpf(1, STRAIGHT), tracking={})
    reports = used_by(("n012", 1), ("n013", 1))
    assert bound_metrics(nobody, reports, run_bound(nobody, reports)) == dict.fromkeys(("position", "trajectory"))
    empty = run_metrics(plan, Ledger(plan.run, plan.processes), [])
    assert empty["bound"] == {"position": None, "trajectory": None}


def test_the_bound_is_in_the_tracks_and_on_the_timeline(tmp_path: FilePath) -> None:
    (tmp_path / "logs").mkdir()
    plan: Plan = spcpf(1, ["target.steps=8"])
    metrics = run_virtual(plan, tmp_path).metrics
    rows = pq.read_table(tmp_path / "tracks.parquet").to_pylist()
    bounds = {row["step"]: row["bound_m"] for row in rows if row["true_x"] is not None}
    assert list(bounds) == list(range(1, 9))
    assert metrics["bound"]["trajectory"] == pytest.approx(np.sqrt(np.mean(np.square(list(bounds.values())))))
    assert all(row["bound_m"] == bounds[row["step"]] for row in rows if row["step"] in bounds)
    drawn = read(tmp_path / "run.rrd", "/plots/error/bound", "Scalars:scalars")
    assert {t: value[0] for t, value in drawn if t is not None} == bounds
    assert max(bounds.values()) < inf
    assert by_step(scenario_bound(plan, [])).keys() == set(range(1, 9))
