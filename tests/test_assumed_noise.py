"""Trackers that take the noise of readings for larger or smaller than it is; nothing else does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.figures.bounds import scenario_bound
from tests.played import OPTIONS, home, ran, recorded, scenario
from tests.simulated import simulated
from trackfield.sensing.kinds import make_sensor

__all__ = ["home"]

STATE = np.array([3.0, 4.0, 1.0, 0.0])
AT = np.array([[0.0, 0.0], [10.0, 0.0]])


@pytest.mark.parametrize("kind", OPTIONS)
def test_the_noise_is_so_many_times_as_large(kind: str) -> None:
    plain = make_sensor(kind, OPTIONS[kind])
    wider = plain.assumed(2.0)
    state = np.append(STATE, [one.mean for one in plain.unknowns])
    assert wider.sd == tuple(2.0 * sd for sd in plain.sd)
    if plain.variance is not None and wider.variance is not None:
        assert wider.variance(state, AT) == pytest.approx(4.0 * plain.variance(state, AT))
    assert wider.h(state, AT) == pytest.approx(plain.h(state, AT))
    assert plain.assumed(1.0) is plain


def test_it_is_as_if_sensors_were_as_bad_as_that(home: Path) -> None:
    """On the same reports: tracks by twice the noise are those of sensors with twice the noise."""
    Path("reports.csv").write_text(recorded("rss", {"shadow_sd_db": 3.0}))
    _, _, assumed = ran(scenario("rss", {"shadow_sd_db": 3.0}, fusion__assumed_noise=2.0))
    _, _, known = ran(scenario("rss", {"shadow_sd_db": 6.0}))
    assert [row.point for row in assumed] == [row.point for row in known]


def test_sensors_and_the_bound_know_nothing_of_it() -> None:
    settings: dict[str, Any] = {"field.extent_m": 200.0, "target.steps": 20, "fusion.trackers": ["ekf"]}
    plans = [planned(tf.Scenario.load("zhai-spcpf", {**settings, "fusion.assumed_noise": one})) for one in (1.0, 3.0)]
    (plain, rows), (wide, others) = ((plan, simulated(plan)[1]) for plan in plans)
    assert [one.sound for one in plain.processes] == [one.sound for one in wide.processes]
    assert scenario_bound(plain, rows) == scenario_bound(wide, others)
    assert replace(rows[-1].point, mean=(), covariance=()) == replace(others[-1].point, mean=(), covariance=())
    assert np.trace(np.reshape(others[-1].point.covariance, (4, 4))) > np.trace(
        np.reshape(rows[-1].point.covariance, (4, 4))
    )
