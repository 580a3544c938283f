"""Fields of sensors that measure distances, levels or energies: tracked as well as the bound says, and from nothing."""

from __future__ import annotations

from functools import cache
from math import dist
from typing import Any, Final, NamedTuple

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.prepare import load, planned
from launcher.record.figures.bounds import run_bounds
from tests.simulated import simulated
from trackfield.filters.metrics import nees, nees_band
from trackfield.filters.types import Array

RUNS: Final = 30
FIELD: Final = {"field.extent_m": 300.0, "target.steps": 20, "fusion.trackers": ["ukf"]}
KINDS: Final[dict[str, dict[str, Any]]] = {
    "range": {},
    "rss": {"sensor.shadow_sd_db": 2.0},
    "energy": {"sensor.window_s": 0.4, "sensor.sound_m_s": 343.0},
}


class Tracked(NamedTuple):
    """Of runs: ``errors`` (runs, steps, 4), their ``covariances``, and ``bounds`` (runs, steps) m."""

    errors: Array
    covariances: Array
    bounds: Array

    @property
    def ratio(self) -> float:
        """The rms error over the rms bound."""
        return float(np.sqrt(np.square(self.errors[..., :2]).sum(axis=-1).mean() / np.square(self.bounds).mean()))


def tracked(kind: str, **more: Any) -> Tracked:
    """Runs in which all is as trackers are told, but for what ``more`` says."""
    own: dict[str, Any] = {"sensor.kind": kind, "fusion.prior_sd": [3.0, 3.0, 0.5, 0.5]}
    own |= {f"sensor.{key}": value for key, value in more.items()}
    found = []
    for seed in range(RUNS):
        plan = planned(tf.Scenario.load("zhai-spcpf", FIELD | KINDS[kind] | own | {"seed": seed}))
        _, rows = simulated(plan)
        (bound,) = run_bounds(plan, rows).values()
        errors = [np.subtract(row.point.mean[:4], row.truth) for row in rows]
        covariances = [np.reshape(row.point.covariance, (4, 4)) for row in rows]
        found.append((errors, covariances, [bound[row.t_ns] for row in rows]))
    return Tracked(*map(np.array, zip(*found, strict=True)))


@cache
def usual(kind: str) -> Tracked:
    return tracked(kind)


@pytest.mark.parametrize(("kind", "most"), [("range", 1.05), ("rss", 1.15), ("energy", 1.2)])
def test_errors_are_near_the_bound(kind: str, most: float) -> None:
    """And no smaller, by more than three standard errors, from the runs' spread."""
    found = usual(kind)
    squares = np.square(found.errors[..., :2]).sum(axis=(-2, -1))
    off = squares.std(ddof=1) / RUNS**0.5 / squares.mean() / 2.0
    assert found.errors.shape == (RUNS, 20, 4)
    assert 1.0 - 3.0 * off < found.ratio < most + 3.0 * off, (found.ratio, off)


@pytest.mark.parametrize("kind", KINDS)
def test_errors_are_as_large_as_covariances_say(kind: str) -> None:
    """The mean over runs is in its 95 % band at three of four steps: the steps of a run are alike."""
    found = usual(kind)
    at_steps = nees(found.errors, found.covariances).mean(axis=0)
    low, high = nees_band(4, RUNS)
    assert ((low < at_steps) & (at_steps < high)).mean() >= 0.75, at_steps


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("energy", {"compensate_delay": False}),
        ("energy", {"compensate_window": False}),
        ("rss", {"slow": 0.8, "slow_s": 20.0}),
        ("rss", {"fixed": 0.8}),
    ],
)
def test_what_trackers_are_not_told_makes_them_too_certain(kind: str, more: dict[str, Any]) -> None:
    """The sound of another place, shadowing that lasts: larger errors, and covariances that do not say so."""
    told, untold = usual(kind), tracked(kind, **more)
    assert untold.ratio > 1.1 * told.ratio
    assert nees(untold.errors, untold.covariances).mean() > nees_band(4, RUNS)[1]


@pytest.mark.parametrize("kind", KINDS)
def test_without_a_prior_a_track_starts_from_the_first_readings(kind: str) -> None:
    """As far off as its covariance says, or less: within the 99.9 % region in nine of ten runs."""
    near = []
    for seed in range(10):
        own = {"sensor.kind": kind, "fusion.prior": "none", "seed": seed}
        _, rows = simulated(planned(tf.Scenario.load("zhai-spcpf", FIELD | KINDS[kind] | own)))
        first = next(row for row in rows if row.point.mean)
        assert first.point.step is not None and first.point.step <= 2
        off = np.subtract(first.point.mean[:2], first.truth[:2])
        near.append(off @ np.linalg.solve(np.reshape(first.point.covariance, (4, 4))[:2, :2], off) < 13.8)
        assert max(dist(row.point.mean[:2], row.truth[:2]) for row in rows[8:]) < 15.0
    assert sum(near) >= 9


@pytest.mark.parametrize(("kind", "most_m"), [("range", 1.5), ("rss", 12.0), ("energy", 6.0)])
def test_the_bus_is_tracked_by_the_default_tracker_with_the_defaults_of_a_kind(kind: str, most_m: float) -> None:
    """At every step, with the losses and delays of its radio, and within 1.5 times the bound."""
    plan = planned(load("bus", settings=[f"sensor.kind={kind}"]))
    _, rows = simulated(plan)
    mine = [row for row in rows if row.point.tracker == "imm-ukf"]
    (bound,) = run_bounds(plan, rows).values()
    errors = np.array([dist(row.point.mean[:2], row.truth[:2]) for row in mine])
    assert len(errors) == 101
    rms = np.sqrt(np.square(errors).mean())
    assert rms < most_m
    assert rms < 1.5 * np.sqrt(np.mean([bound[row.t_ns] ** 2 for row in mine]))
