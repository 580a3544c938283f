"""The packaged scenarios from end to end in virtual time: within bands that were reached independently of this code."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.plan.prepare import load, planned, remarks
from launcher.record.metrics import tracker_metrics
from launcher.record.tables import TrackRow
from launcher.records import Plan
from tests.simulated import simulated, spcpf
from trackfield.scenario import Scenario

SEEDS = range(1, 21)
STEPS = {"s1": 60, "s2": 75, "s3": 40}
BANDS_M = {
    ("spcpf", "s1"): 1.7,
    ("spcpf", "s2"): 3.0,
    ("spcpf", "s3"): 2.6,
    ("imm-ukf", "s1"): 1.15,
    ("imm-ukf", "s2"): 2.0,
    ("imm-ukf", "s3"): 1.95,
}


@cache
def of_all_seeds(path: str) -> list[dict[str, Any]]:
    """The trackers' metrics of each seed, over the paper's radio: none."""
    plans = [spcpf(seed, [f"target.path={path}", "link.model=ideal"]) for seed in SEEDS]
    return [tracker_metrics(plan, simulated(plan)[1]) for plan in plans]


# --- spcpf: 121 sensors, the paper's three targets --------------------------------------------------------------------


@pytest.mark.parametrize(("tracker", "path"), BANDS_M)
def test_the_papers_targets_are_tracked_within_the_bands(tracker: str, path: str) -> None:
    runs = [metrics[tracker] for metrics in of_all_seeds(path)]
    assert {run["steps"] for run in runs} == {STEPS[path]}
    pooled = np.sqrt(np.mean([run["rmse"]["position"] ** 2 for run in runs]))
    print(f"{tracker} {path}: {pooled:.3f} m")
    assert 0.0 < pooled <= BANDS_M[tracker, path]
    assert [run["lost"] for run in runs] == [False] * len(SEEDS)


@pytest.mark.parametrize("path", STEPS)
def test_the_packaged_radio_works_there(path: str) -> None:
    """It loses one report in a hundred, and no tracker is the worse for it."""
    plans = [spcpf(seed, [f"target.path={path}"]) for seed in range(1, 6)]
    ledgers, tracks = zip(*map(simulated, plans), strict=True)
    rows = [row for ledger in ledgers for row in ledger.rows]
    assert 0 < sum(not row.delivered for row in rows) < 0.05 * len(rows)
    for tracker in ("spcpf", "imm-ukf"):
        runs = [tracker_metrics(plan, one)[tracker] for plan, one in zip(plans, tracks, strict=True)]
        assert not any(run["lost"] for run in runs)
        assert np.sqrt(np.mean([run["rmse"]["position"] ** 2 for run in runs])) <= 1.1 * BANDS_M[tracker, path]


def test_noisier_bearings_make_larger_errors() -> None:
    found = []
    for sd in (0.3, 3.0, 30.0):
        plans = [spcpf(seed, [f"sensor.doa_sd_deg={sd}"]) for seed in (1, 2, 3)]
        runs = [tracker_metrics(plan, simulated(plan)[1]) for plan in plans]
        found.append({name: [run[name]["rmse"]["position"] for run in runs] for name in runs[0]})
    for name in found[0]:
        # Every run with better bearings is better than every run with worse ones.
        assert max(found[0][name]) < min(found[1][name])
        assert max(found[1][name]) < min(found[2][name])


def points(tracks: list[TrackRow]) -> list[Any]:
    return [(row.told_ns, row.point, row.truth) for row in tracks]


def test_a_seed_decides_the_run_to_the_last_bit() -> None:
    settings = ["link.loss=0.1"]
    first, again, other = (simulated(spcpf(seed, settings)) for seed in (1, 1, 2))
    assert points(first[1]) == points(again[1])
    assert first[0].rows == again[0].rows
    assert points(first[1]) != points(other[1])
    assert first[0].rows != other[0].rows


def test_trackers_do_not_disturb_each_other() -> None:
    both = simulated(spcpf(1, ["target.steps=20"]))[1]
    alone = simulated(spcpf(1, ["target.steps=20", 'fusion.trackers=["spcpf"]']))[1]
    assert points([row for row in both if row.point.tracker == "spcpf"]) == points(alone)


def test_a_link_that_loses_all_leaves_every_tracker_lost() -> None:
    plan = spcpf(1, ["link.loss=1"])
    ledger, tracks = simulated(plan)
    assert {row.outcome for row in ledger.rows} == {"radio"}
    assert {row.point.reports for row in tracks} == {0}
    assert all(run["lost"] for run in tracker_metrics(plan, tracks).values())


# --- bus: a recorded ride, started from the first reports, over a radio with bursts of losses ---------------------


DEFAULT = Scenario.load({"name": "default", "target": {"path": "s1"}}).fusion.trackers[0]


def ride(file: Path, start: str, end: str, seed: int) -> Plan:
    return planned(load("bus", seed=seed, target=file, start=start, end=end, link="gilbert_elliott"))


@pytest.mark.parametrize(
    ("start", "end"), [("07:50:00", "07:53:00"), ("07:58:00", "08:01:00"), ("08:07:00", "08:10:00")]
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_recorded_bus_is_followed(data_file: Callable[[str], Path], start: str, end: str, seed: int) -> None:
    plan = ride(data_file("bus_304.gpx"), start, end, seed)
    ledger, tracks = simulated(plan)
    run = tracker_metrics(plan, tracks)[DEFAULT]
    print(f"bus {start}, seed {seed}: {run['rmse']['position']:.3f} m")
    assert {row.outcome for row in ledger.rows} >= {"delivered", "radio"}
    assert run["steps"] + run["gap"]["steps"] >= 175  # of 180: it starts at once, and never gives up
    assert run["gap"]["steps"] > 0  # half of it was interpolated, and is judged by nobody
    assert run["rmse"]["position"] < 2.5
    assert run["verdict"] == "tracked"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_parked_bus_has_no_speed_and_its_gap_is_told(data_file: Callable[[str], Path], seed: int) -> None:
    plan = ride(data_file("bus_304.gpx"), "07:46:00", "07:49:00", seed)
    (remark,) = remarks(plan)
    assert re.match(
        r"\d+ of \d+ steps lie in \d+ gaps of the recording \(the longest from 65.0 s for 72 s\): a straight line",
        remark,
    )
    _, tracks = simulated(plan)
    speeds = [np.hypot(*row.point.mean[2:]) for row in tracks if row.t_ns >= 10e9 and row.point.tracker == DEFAULT]
    assert len(speeds) == 171
    print(f"parked, seed {seed}: at most {max(speeds):.2f} m/s")
    assert max(speeds) < 1.0
