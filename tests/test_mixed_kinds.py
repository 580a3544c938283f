"""Several kinds of sensing in one field: bearings beside ranges, and beside strengths with an unknown."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow.parquet as pq
import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.figures.bounds import run_bounds
from launcher.study.compare import differences
from tests.ranging import Ranging
from tests.rrd import read
from tests.running import SPEEDS, kept_up
from tests.sensing import registered
from tests.simulated import simulated
from tests.stranger import Strength
from trackfield.filters.metrics import nees, nees_band
from trackfield.filters.types import Readings, Reports

TRACKERS: Final = ("ekf", "ukf", "bootstrap")


@pytest.fixture(autouse=True, scope="module")
def kinds() -> Iterator[None]:
    with registered(ranging=Ranging, strength=Strength):
        yield


ODD: Final = [f"n{i:03d}" for i in range(1, 49, 2)]
EVEN: Final = [f"n{i:03d}" for i in range(0, 49, 2)]
DOA: Final = {"kind": "doa", "threshold": 0.72, "doa_sd_deg": 4.0}
RANGES: Final = {"kind": "ranging", "sd_m": 4.0}
BOTH: Final = [RANGES, DOA]


def scenario(sensors: list[dict[str, Any]], **settings: Any) -> tf.Scenario:
    """The south-west of the paper's field, 7 x 7 sensors, for 20 steps: one kind, or also another at odd places."""
    keys = {key.replace("__", "."): value for key, value in settings.items()}
    one, *others = sensors
    base = {
        "field.extent_m": 300.0,
        "sensor": one,
        "sensors": [{**other, "nodes": ODD} for other in others],
        "target.steps": 20,
        "fusion.trackers": list(TRACKERS),
        "fusion.prior_sd": [3.0, 3.0, 0.5, 0.5],
    }
    return tf.Scenario.load("zhai-spcpf", base | keys)


# --- better together ---

RUNS: Final = 20


def measured(sensors: list[dict[str, Any]], **settings: Any) -> tuple[dict[str, float], dict[str, Any], float]:
    """The rms error by tracker, their errors and covariances, and the rms of the bound."""
    found: dict[str, list[Any]] = {name: [] for name in TRACKERS}
    bounds = []
    for seed in range(RUNS):
        plan = planned(scenario(sensors, seed=seed, **settings))
        _, rows = simulated(plan)
        (bound,) = run_bounds(plan, rows).values()
        bounds += [bound[row.t_ns] ** 2 for row in rows if row.point.tracker == "ekf"]
        for name, runs in found.items():
            mine = [row for row in rows if row.point.tracker == name]
            runs.append([(np.subtract(r.point.mean, r.truth), np.reshape(r.point.covariance, (4, 4))) for r in mine])
    pairs = {
        name: [np.array([[one[i] for one in run] for run in runs]) for i in (0, 1)] for name, runs in found.items()
    }
    errors = {name: float(np.sqrt(np.square(e[..., :2]).sum(axis=-1).mean())) for name, (e, _) in pairs.items()}
    return errors, pairs, float(np.sqrt(np.mean(bounds)))


def test_two_halves_track_better_than_either_alone() -> None:
    """Half of the field hears bearings, half measures ranges; a half alone has the other's sensors deaf.

    The errors are above the bound by no more than 15 %, so what each half tells is used; their covariances are right:
    the mean NEES of 20 runs is in its 95 % band at eight of ten steps at least.
    """
    many = {"fusion__options": {"bootstrap": {"n": 10_000}}}
    both, pairs, bound = measured(BOTH, **many)
    for deaf in (ODD, EVEN):
        faults = [{"kind": "deaf", "nodes": deaf, "at_s": 0.0}]
        alone, _, bound_alone = measured(BOTH, faults=faults, **many)
        assert bound < 0.95 * bound_alone
        for name in TRACKERS:
            assert both[name] < 0.95 * alone[name], (name, both, alone)
    low, high = nees_band(4, RUNS)
    for name in TRACKERS:
        assert 0.9 < both[name] / bound < 1.15, (name, both, bound)
        at_steps = nees(*pairs[name]).mean(axis=0)
        assert ((low < at_steps) & (at_steps < high)).mean() >= 0.8, (name, at_steps)


# --- in runs ---


def test_a_run_has_all_that_runs_have(tmp_path: Path) -> None:
    """Report, replay, words and units of each kind, and rays of those alone that have a direction."""
    result = tf.run(scenario(BOTH, target__steps=6), out=tmp_path / "run")
    assert result.report().stat().st_size > 10_000
    assert not list(differences(result.path, tf.replay(result, out=tmp_path / "again").path, 0.0))
    texts = {row["src"]: row["text"] for row in result.messages.to_pylist()}
    assert {src for src, text in texts.items() if text.startswith("DOA ")} <= set(ODD)
    ranges = {src for src, text in texts.items() if re.fullmatch(r"ranging [\d.]+ m", text)}
    assert ranges and ranges <= set(EVEN)
    assert len(texts) == len([src for src, text in texts.items() if text.startswith("DOA ")]) + len(ranges)
    for point in result.tracks.to_pylist():
        assert point["unknowns"] == []
    (timeline,) = result.path.glob("*.rrd")
    rays = [ray for _, some in read(timeline, "/field/rays", "LineStrips2D:strips") for ray in some or ()]
    places = {(50.0 * (i % 7), 50.0 * (i // 7)): f"n{i:03d}" for i in range(49)}
    began = {places[abs(x), abs(y)] for (x, y), _ in rays}  # the picture's y axis points down
    assert began and began <= set(ODD)


def test_with_unknowns_of_one_kind_states_have_its_columns(tmp_path: Path) -> None:
    """The strength's power is found although bearings come first, whose functions get four columns."""
    for order in (1, -1):
        sensors = [{"kind": "strength", "power_dbm": 22.0}, DOA][::order]
        result = tf.run(scenario(sensors, fusion__smooth_lag=1), out=tmp_path / f"run{order}")
        for name in ("ekf", "ukf", "bootstrap", "ekf+lag1"):
            points = [row for row in result.tracks.to_pylist() if row["tracker"] == name]
            ((power,), (sd,)) = points[-1]["unknowns"], points[-1]["unknown_sds"]
            assert 0.0 < sd < 0.8 * points[0]["unknown_sds"][0]
            assert abs(power - 22.0) < 3.5 * sd, (name, power, sd)
        assert result.metrics.bound.trajectory is not None


def test_two_kinds_with_unknowns_have_one_each() -> None:
    """Two transmitters: what is heard of one says nothing of the power of the other but by the position."""
    sensors = [{"kind": "strength", "power_dbm": power} for power in (18.5, 22.0)]
    plan = planned(scenario(sensors))
    assert list(plan.tracking["sensing"]) == ["strength", "strength-2"]
    _, rows = simulated(plan)
    for name in TRACKERS:
        point = [row.point for row in rows if row.point.tracker == name][-1]
        assert np.abs((np.array(point.unknowns) - (18.5, 22.0)) / point.unknown_sds).max() < 3.5, name


def test_two_groups_of_one_kind_have_options_of_their_own() -> None:
    """Precise bearings and poor ones: a tracker that took all as poor, or as precise, would be off its covariance."""
    sensors = [{"kind": "doa", "doa_sd_deg": sd} for sd in (1.0, 12.0)]
    plan = planned(scenario(sensors, fusion__trackers=["ekf"]))
    assert list(plan.tracking["sensing"]) == ["doa", "doa-2"]
    assert [one["options"]["doa_sd_deg"] for one in plan.tracking["sensing"].values()] == [1.0, 12.0]
    ledger, rows = simulated(plan)
    bearings = [row for row in ledger.rows if row.kind == "doa"]
    assert {row.src for row in bearings} & set(ODD) and {row.src for row in bearings} & set(EVEN)
    (bound,) = run_bounds(plan, rows).values()
    alike = planned(scenario([{"kind": "doa", "doa_sd_deg": 12.0}], fusion__trackers=["ekf"]))
    (poor,) = run_bounds(alike, rows).values()
    assert all(bound[t] < poor[t] for t in bound)


def test_over_processes_it_is_the_same(tmp_path: Path) -> None:
    mixed = scenario(BOTH, target__steps=4)
    tf.run(mixed, out=tmp_path / "virtual")
    for speed in SPEEDS:
        shutil.rmtree(tmp_path / "processes", ignore_errors=True)
        result = tf.run(mixed, driver="processes", speed=speed, out=tmp_path / "processes")
        if kept_up(result.metrics.model_dump()):
            break
    assert list(differences(tmp_path / "virtual", tmp_path / "processes", 0.0)) == []
    assert pq.read_table(tmp_path / "virtual" / "tracks.parquet").num_rows == 12


# --- the reports of a step ---


def test_some_reports_of_several_kinds_keep_what_belongs_together() -> None:
    positions = np.arange(10.0).reshape(5, 2)
    one = Readings("doa", np.array([[0.0, 60.0], [1.0, 61.0]]))
    two = Readings("ranging", np.array([[2.0], [3.0], [4.0]]), np.array([0.2, 0.3, 0.4]))
    reports = Reports(7, tuple("abcde"), positions, (one, two))
    some = reports.only(np.array([1, 2, 4]))
    assert some.sensors == ("b", "c", "e")
    assert some.positions.tolist() == positions[[1, 2, 4]].tolist()
    assert [part.kind for part in some.readings] == ["doa", "ranging"]
    assert [part.values.tolist() for part in some.readings] == [[[1.0, 61.0]], [[2.0], [4.0]]]
    early = some.readings[1].early_s
    assert some.readings[0].early_s is None and early is not None and early.tolist() == [0.2, 0.4]
    none = reports.only(np.array([], dtype=np.intp))
    assert (len(none), [part.values.shape for part in none.readings]) == (0, [(0, 2), (0, 1)])
    with pytest.raises(ValueError, match="reports of 2 kinds of sensing; expected those of one"):
        _ = reports.values
