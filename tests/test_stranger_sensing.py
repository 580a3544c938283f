"""A kind of sensing from outside the package, with an unknown of its own, and noise that grows with distance."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from math import dist
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow.parquet as pq
import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.figures.bounds import run_bounds
from launcher.study.compare import differences
from tests.command_line import Call, trackfield
from tests.running import SPEEDS, kept_up
from tests.sensing import registered
from tests.simulated import simulated
from tests.stranger import CODE, Strength, Walking, walking
from trackfield.filters.metrics import nees, nees_band
from trackfield.filters.trackers import TRACKERS
from trackfield.filters.types import Array

__all__ = ["trackfield"]

ROOT: Final = Path(__file__).parents[1]
FIELD: Final = {"field.extent_m": 300.0, "sensor.kind": "strength", "target.steps": 20}
"""The south-west of the paper's field, in which the target is for 20 steps."""


@pytest.fixture(autouse=True, scope="module")
def strength() -> Iterator[None]:
    with registered(strength=Strength, walking=Walking):
        yield
    TRACKERS.registered.clear()


# --- against its bound ---

RUNS: Final = 40


class Runs(NamedTuple):
    """Of a tracker: ``errors`` (runs, steps, 4), their ``covariances``, ``power`` (runs, steps): error / sd."""

    errors: Array
    covariances: Array
    power: Array


@dataclass(frozen=True)
class Campaign:
    """Runs by tracker, and the square of their ``bounds`` (runs, steps)."""

    runs: dict[str, Runs]
    bounds: Array


@pytest.fixture(scope="module")
def campaign(strength: None) -> Campaign:
    """Runs in which all is as trackers are told: the prior, the target's acceleration, the power and its walk.

    Twenty sensors at a time and a prior of 3 m make it nearly linear: the bound is one for linear problems, as the
    derivatives are taken at the truth. The two thousand particles that ``bootstrap`` has by default are few for a state
    of five numbers that moves so little by itself.
    """
    found: dict[str, list[Any]] = {"ekf": [], "ukf": [], "bootstrap": []}
    bounds = []
    settings = FIELD | {
        "fusion.trackers": list(found),
        "fusion.options": {"bootstrap": {"n": 10_000}},
        "fusion.prior_sd": [3.0, 3.0, 0.5, 0.5],
        "sensor.kind": "walking",
    }
    for seed in range(RUNS):
        true = walking(seed)
        own = {"seed": seed, "sensor.walk": seed, "sensor.power_dbm": true.power_dbm}
        plan = planned(tf.Scenario.load("zhai-spcpf", settings | own))
        _, rows = simulated(plan)
        (bound,) = run_bounds(plan, rows).values()
        bounds.append([bound[row.t_ns] ** 2 for row in rows if row.point.tracker == "ekf"])
        for name, runs in found.items():
            points = [(row.point, row.truth, true.power_at(row.t_ns // 10**9)) for row in rows]
            mine = [(p, truth, power) for p, truth, power in points if p.tracker == name]
            errors = [np.subtract(p.mean, truth) for p, truth, _ in mine]
            power = [(p.unknowns[0] - power) / p.unknown_sds[0] for p, _, power in mine]
            runs.append((errors, [np.reshape(p.covariance, (4, 4)) for p, _, _ in mine], power))
    return Campaign(
        {name: Runs(*map(np.array, zip(*runs, strict=True))) for name, runs in found.items()}, np.array(bounds)
    )


@pytest.mark.parametrize("tracker", ["ekf", "ukf", "bootstrap"])
def test_errors_are_near_the_bound(campaign: Campaign, tracker: str) -> None:
    """Within 1.3 times the bound, and not below it: by more than three standard errors, from the runs' spread."""
    squares = np.square(campaign.runs[tracker].errors[..., :2]).sum(axis=-1)
    rmse, bound = np.sqrt(squares.mean()), np.sqrt(campaign.bounds.mean())
    off = squares.mean(axis=1).std(ddof=1) / np.sqrt(RUNS) / (2.0 * rmse)
    assert squares.shape == (RUNS, 20)
    assert 1.0 - 3.0 * off / bound < rmse / bound < 1.3 - 3.0 * off / bound


@pytest.mark.parametrize("tracker", ["ekf", "ukf", "bootstrap"])
def test_errors_are_as_large_as_covariances_say(campaign: Campaign, tracker: str) -> None:
    """The mean over independent runs is in its 95 % band at four of five steps, and so is that of the power.

    A right filter has 95 % in the mean, but its steps are alike: some of the 20 leave the band together.
    """
    errors, covariances, power = campaign.runs[tracker]
    for values, dof in ((nees(errors, covariances), 4), (np.square(power), 1)):
        low, high = nees_band(dof, RUNS, level=0.95)
        inside = (low < values.mean(axis=0)) & (values.mean(axis=0) < high)
        assert inside.mean() >= 0.8, (dof, inside.mean(), values.mean(axis=0))


def test_the_unknown_is_found(campaign: Campaign) -> None:
    """The power is known to 3 dB at the start, and to less than 0.6 dB when it has been heard for a while."""
    settings = FIELD | {"fusion.trackers": ["ukf"], "sensor.power_dbm": 26.0}
    _, rows = simulated(planned(tf.Scenario.load("zhai-spcpf", settings)))
    ends = rows[-1].point
    assert ends.unknown_sds[0] < 0.6 < rows[0].point.unknown_sds[0] < 3.0
    assert abs(ends.unknowns[0] - 26.0) < 3.0 * ends.unknown_sds[0]


# --- in runs ---


def test_the_unknown_is_published_and_the_bound_is_drawn(tmp_path: Path) -> None:
    settings = FIELD | {"fusion.trackers": ["ekf", "bootstrap"], "fusion.smooth_lag": 2, "target.steps": 6}
    result = tf.run(tf.Scenario.load("zhai-spcpf", settings), out=tmp_path / "run")
    table = pq.read_table(tmp_path / "run" / "tracks.parquet")
    assert set(table["tracker"].to_pylist()) == {"ekf", "bootstrap", "ekf+lag2", "bootstrap+lag2"}
    assert {len(row) for name in ("unknowns", "unknown_sds") for row in table[name].to_pylist()} == {1}
    assert all(sd > 0.0 for (sd,) in table["unknown_sds"].to_pylist())
    assert result.metrics.bound.trajectory is not None
    assert (tmp_path / "run" / "report.html").exists() or result.report().exists()
    again = tf.replay(result, out=tmp_path / "again")
    assert not list(differences(tmp_path / "run", again.path, 0.0))


def test_without_a_prior_a_track_starts_from_reports() -> None:
    settings = FIELD | {"fusion.trackers": ["ekf", "ukf", "bootstrap"], "fusion.prior": "none"}
    _, rows = simulated(planned(tf.Scenario.load("zhai-spcpf", settings)))
    for name in ("ekf", "ukf", "bootstrap"):
        mine = [row for row in rows if row.point.tracker == name]
        assert [row.point.status for row in mine[:2]] != ["waiting", "waiting"]
        assert max(dist(row.point.mean[:2], row.truth[:2]) for row in mine[5:] if row.truth) < 15.0
        assert len(mine[-1].point.unknowns) == 1


def test_a_centre_that_starts_again_resumes_what_it_knew() -> None:
    """Without a prior of its own, its next life knows the power and the velocity from the start."""
    fault = {"kind": "restart", "nodes": ["fusion"], "at_s": 12.4, "until_s": 13.4}
    settings = FIELD | {"fusion.trackers": ["ekf", "ukf", "bootstrap"], "faults": [fault]}
    _, rows = simulated(planned(tf.Scenario.load("zhai-spcpf", settings)))
    for name in ("ekf", "ukf", "bootstrap"):
        before, after = (
            [row.point for row in rows if row.point.tracker == name and row.incarnation == life][at].unknown_sds[0]
            for life, at in ((0, -1), (1, 0))
        )
        assert after < 1.2 * before < 1.5, name
    assert all(row.point.unknowns for row in rows)


class FourNumbers:
    """A tracker that was written before there were unknowns."""

    def init(self, prior: Any, model: Any) -> Any:
        return prior

    def step(self, state: Any, reports: Any, dt: float, rng: Any) -> Any:
        return state, tf.Estimate(state.mean[:4], state.covariance[:4, :4])


class Anything(FourNumbers):
    """It says that it takes any sensing, and estimates four numbers all the same."""

    needs: tuple[str, ...] = ()


@pytest.mark.parametrize(
    ("tracker", "why"),
    [
        ("spcpf", "takes readings that depend on the target's position and velocity only"),
        ("fix-doa", "takes bearings only"),
        ("four", "takes readings that depend on the target's position and velocity only"),
    ],
)
def test_trackers_that_cannot_use_it_are_refused_with_the_reason(trackfield: Call, tracker: str, why: str) -> None:
    tf.register_tracker("four", FourNumbers)
    said = trackfield("run", "zhai-spcpf", "--virtual", "--set", "sensor.kind=strength", "--tracker", tracker)
    assert said.code == 2
    assert f"'{tracker}' {why}, and the sensors are of kind strength" in " ".join(said.err.split())
    expected = " ".join(said.err.split()).partition("expected ")[2]
    assert "bootstrap, ekf, gpf-ukf, imm-ukf, jm-rbpf, " in expected
    assert "ukf, or one of your own" in expected
    assert "fix-imm-ukf" not in expected


def test_a_tracker_that_does_not_estimate_what_it_takes_is_told() -> None:
    tf.register_tracker("anything", Anything)
    plan = planned(tf.Scenario.load("zhai-spcpf", FIELD | {"fusion.trackers": ["anything"]}))
    with pytest.raises(tf.RunFailed, match=r"tracker 'anything', step 1: mean is of shape \(4,\); .* shape \(5,\)"):
        simulated(plan)


PROGRAM: Final = """
import sys
import trackfield as tf
from strength import Strength

tf.register_sensor("strength", Strength)
settings = {"sensor.kind": "strength", "fusion.trackers": ["ekf", "ukf", "bootstrap"], "field.nodes": 25}
driver, speed, out = sys.argv[1:]
scenario = tf.Scenario.load("zhai-spcpf", settings | {"target.steps": 5})
tf.run(scenario, driver=driver, speed=float(speed) if driver == "processes" else None, out=out)
"""


def test_over_processes_it_is_the_same(tmp_path: Path) -> None:
    (tmp_path / "strength.py").write_text(CODE)
    (tmp_path / "program.py").write_text(PROGRAM)
    paths = os.pathsep.join((str(tmp_path), str(ROOT)))

    def run(driver: str, speed: float, out: str) -> tuple[int, Any]:
        command = [sys.executable, "program.py", driver, str(speed), out]
        environment = {**os.environ, "PYTHONPATH": paths}
        done = subprocess.run(command, cwd=tmp_path, env=environment, check=False, capture_output=True)
        return done.returncode, tf.open(tmp_path / out)

    assert run("virtual", 1.0, "virtual")[0] == 0
    ran = (run("processes", speed, f"at-{speed}") for speed in SPEEDS)
    code, over = next(one for one in ran if kept_up(one[1].metrics.model_dump()))
    assert code == 0
    assert list(differences(tmp_path / "virtual", over.path, 0.0)) == []
    assert all(len(row) == 1 for row in over.tracks["unknowns"].to_pylist())
