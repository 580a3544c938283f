"""Sensors that do not stand where the fusion centre believes: the world has the true places, the centre the others."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from launcher.record.metrics import tracker_metrics
from launcher.records import Plan
from tests.simulated import simulated, spcpf
from trackfield.scenario import Scenario, survey
from trackfield.world.windows import Array

DEFAULT = Scenario.load({"name": "default", "target": {"path": "s1"}}).fusion.trackers[0]
SEEDS = range(1, 9)


def errors(sd: float, seed: int = 1, nodes: int = 121) -> Array:
    """(n, 2) metres from where the sensors stand to where they are believed to."""
    site = survey(Scenario.load("spcpf", {"sensor.position_error_m": sd, "seed": seed, "field.nodes": nodes}))
    assert [id for id, *_ in site.believed] == [id for id, *_ in site.sensors]
    return np.array([place[1:] for place in site.believed]) - np.array([place[1:] for place in site.sensors])


def off(sd: float, seed: int = 1) -> Plan:
    return spcpf(seed, ["link.model=ideal", f"sensor.position_error_m={sd}"])


# --- what is drawn ----------------------------------------------------------------------------------------------------


def test_errors_are_gaussian_in_both_directions() -> None:
    found = errors(5.0, nodes=10_000) / 5.0
    # Standard errors of 10^4 draws: mean 0.01, variance 0.0141, correlation 0.01, share beyond 1.96 sd 0.0022.
    assert np.abs(found.mean(axis=0)).max() < 0.05
    assert np.abs(found.var(axis=0) - 1.0).max() < 0.07
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.05
    assert np.abs((np.abs(found) > 1.96).mean(axis=0) - 0.05).max() < 0.011


def test_seed_and_id_decide_an_error() -> None:
    assert np.array_equal(errors(5.0), errors(5.0))
    assert not np.isclose(errors(5.0, seed=2), errors(5.0)).any()
    assert errors(10.0) == pytest.approx(2 * errors(5.0), abs=1e-9)
    assert errors(5.0, nodes=16) == pytest.approx(errors(5.0)[:16], abs=1e-9)  # n000 is n000 in every field


def test_a_field_that_is_jittered_may_be_believed_wrong_too() -> None:
    jittered = survey(Scenario.load("spcpf", {"field.jitter": 0.25, "sensor.position_error_m": 5.0}))
    off_jittered = np.array([b[1:] for b in jittered.believed]) - np.array([s[1:] for s in jittered.sensors])
    assert off_jittered == pytest.approx(errors(5.0), abs=1e-9)  # draws of their own


# --- who knows what ---------------------------------------------------------------------------------------------------


def parts(plan: Plan) -> tuple[Any, dict[str, Any]]:
    """The fusion centre's process, and all others with what they are told."""
    centre, *others = plan.processes
    assert centre.role == "fusion"
    return centre, {process.id: process for process in others}


def test_only_the_centre_is_told_where_sensors_are_believed_to_stand() -> None:
    right, wrong = off(0.0), off(5.0)
    (centre, sensors), (misled, same) = parts(right), parts(wrong)
    assert same == sensors
    assert (misled.x, misled.y) == (centre.x, centre.y) == (250.0, 250.0)
    assert misled.config.keys() == centre.config.keys()
    assert {key for key in centre.config if misled.config[key] != centre.config[key]} == {"sensors"}
    believed = survey(Scenario.load("spcpf", {"sensor.position_error_m": 5.0})).believed
    assert misled.config["sensors"] == [list(place) for place in believed]


def test_the_timeline_shows_where_sensors_stand() -> None:
    assert off(5.0).info.places == off(0.0).info.places
    stands = [(place.role, place.x, place.y) for place in off(5.0).info.places if place.id == "n013"]
    assert stands == [("node", 100.0, 50.0)]


def test_the_world_is_the_same_whatever_is_believed() -> None:
    (right, found), (wrong, misled) = simulated(off(0.0)), simulated(off(5.0))
    assert right.rows == wrong.rows  # the same bearings, at the same times, with the same fates
    assert [row.truth for row in found] == [row.truth for row in misled]
    assert [row.point for row in found] != [row.point for row in misled]


def test_without_an_error_nothing_is_drawn_at_all() -> None:
    site = survey(Scenario.load("spcpf"))
    assert site.scenario.sensor.position_error_m == 0.0
    assert site.believed == site.sensors
    assert parts(off(0.0))[0].config["sensors"] == [list(place) for place in site.sensors]


# --- what it does to a track ------------------------------------------------------------------------------------------


@cache
def pooled_rmse(sd: float) -> float:
    """Of the default tracker's position, over all seeds (m)."""
    plans = [off(sd, seed) for seed in SEEDS]
    runs = [tracker_metrics(plan, simulated(plan)[1])[DEFAULT] for plan in plans]
    assert not any(run["lost"] for run in runs)
    return float(np.sqrt(np.mean([run["rmse"]["position"] ** 2 for run in runs])))


@pytest.mark.parametrize("sd", [1.0, 2.0, 5.0])
def test_a_track_is_off_about_as_far_as_the_sensors_are(sd: float) -> None:
    """K bearings whose lines each lie ``sd`` beside the target put a fix off by 2 sd / sqrt(K) (rms) at best.

    About four sensors hear the target at a time, so that is ``sd``; worse where they surround it badly. Their
    errors stay as long as they do, so the tracker cannot average them out: they add to the bearings' noise.
    """
    expected = np.hypot(pooled_rmse(0.0), sd)
    print(f"{sd:g} m: {pooled_rmse(sd):.3f} m, at best {expected:.3f} m; without {pooled_rmse(0.0):.3f} m")
    assert 0.9 * expected < pooled_rmse(sd) < 1.5 * expected
