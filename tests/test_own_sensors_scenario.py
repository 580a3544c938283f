"""Sensors that users bring, in a scenario: runs, faults, options, and what is refused before a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import dist
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.forecast.reception import receptions
from launcher.plan.prepare import planned
from launcher.records import Plan
from launcher.study.replay import replay
from tests.rangers import Distance, Ranger
from tests.sensing import registered
from tests.simulated import simulated
from trackfield.scenario import Scenario
from trackfield.sensing.kinds import register_sensor


@pytest.fixture(autouse=True)
def ranger() -> Iterator[None]:
    with registered(ranger=Ranger, distance=Distance):
        yield


SHORT = {"sensor.kind": "ranger", "target.steps": 15, "fusion.trackers": ["ekf", "ukf", "bootstrap", "predict-only"]}


def plan_with(**settings: Any) -> Plan:
    keys = {key.replace("__", "."): value for key, value in settings.items()}
    return planned(Scenario.load("spcpf", SHORT | keys))


def test_a_run_with_a_sensor_of_ones_own() -> None:
    """Within its range of 100 m a dozen sensors measure the target, to half a metre: so well is it known."""
    plan = plan_with()
    ledger, rows = simulated(plan)
    sent = [row for row in ledger.rows if row.kind == "measurement"]
    assert {row.kind for row in ledger.rows} == {"measurement"}
    assert sent[0].text.startswith("ranger ")
    assert {row.step for row in sent} == set(range(1, 16))
    last = {row.point.tracker: dist(row.point.mean[:2], row.truth[:2]) for row in rows if row.point.step == 15}
    assert max(last[name] for name in ("ekf", "ukf")) < 1.5
    assert max(last["ekf"], last["ukf"]) < last["predict-only"]
    assert receptions(plan).keys() == {"measurement"}
    assert plan.reach_m == 100.0


def test_without_a_prior_the_track_starts_from_the_first_readings() -> None:
    _, rows = simulated(plan_with(fusion__prior="none"))
    errors = [dist(row.point.mean[:2], row.truth[:2]) for row in rows if row.point.tracker == "ekf" and row.truth]
    assert len(errors) == 15
    assert max(errors) < 3.0


def test_faults_befall_its_nodes() -> None:
    """Near the start of s1: what is deaf or dead says nothing, what babbles speaks in every step."""
    faults = [
        {"kind": "deaf", "nodes": ["n012"], "at_s": 4.5},
        {"kind": "kill", "nodes": ["n013"], "at_s": 4.5},
        {"kind": "babble", "nodes": ["n120"], "at_s": 0.0},
        {"kind": "stuck", "nodes": ["n001"], "at_s": 4.5},
        {"kind": "clock_jump", "nodes": ["n024"], "at_s": 4.5, "jump_ms": 30.0},
    ]
    ledger, _ = simulated(plan_with(faults=faults, link__model="ideal"))
    said: dict[str, dict[int | None, str]] = {}
    for row in ledger.rows:
        said.setdefault(row.src, {})[row.step] = row.text
    assert set(said["n012"]) == set(said["n013"]) == {1, 2, 3, 4}
    assert set(said["n120"]) == set(range(1, 16))
    assert len(set(said["n120"].values())) == 15
    assert len({said["n001"][step] for step in range(5, 16)}) == 1
    assert {row.outcome for row in ledger.rows} <= {"delivered", "late", "in_flight", "dead"}


def test_its_options_stand_in_its_section_and_in_the_resolved_file(tmp_path: Any) -> None:
    scenario = Scenario.load("spcpf", SHORT).set("sensor.range_m", 80)
    assert planned(scenario).reach_m == 80
    (tmp_path / "again.toml").write_text(scenario.to_toml())
    assert Scenario.load(tmp_path / "again.toml") == scenario
    assert scenario.set("sensor.threshold", 0.7).sensor.kind == "ranger"  # it may have a field of any name
    assert scenario.set("sensor.kind", "distance").sensor.options == {}
    assert scenario.set("sensor.kind", "doa").sensor == Scenario.load("spcpf").sensor


def test_an_option_called_file_is_no_file_of_the_run(tmp_path: Any) -> None:
    @dataclass(frozen=True)
    class Calibrated(Ranger):
        file: str = "calib.csv"

    register_sensor("calibrated", Calibrated)
    settings = {**SHORT, "sensor.kind": "calibrated", "sensor.file": "mine.csv"}
    tf.run(Scenario.load("spcpf", settings), out=tmp_path / "run")
    assert replay(tmp_path / "run", out=tmp_path / "again").metrics["driver"] == "replay"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"sensor__kind": "rangr"}, "sensor.kind: unknown sensor 'rangr'; expected 'ranger'"),
        (
            {"sensor__rang_m": 3.0},
            "sensor.rang_m: unknown option; did you mean range_m?; expected one of range_m",
        ),
        ({"sensor__range_m": "far"}, "sensor.range_m: is 'far'; expected a number"),
        ({"sensor__range_m": -1.0}, "sensor.range_m: 'ranger' has -1.0; expected metres, above 0"),
        ({"sensor__range_m": [1.0]}, "sensor.range_m: is [1.0]; expected a number, a text, or true or false"),
        ({"sensor__range_m": 0.5}, "sensor.range_m: the target never comes in range"),
        (
            {"fusion__trackers": ["ekf", "spcpf"]},
            "fusion.trackers: 'spcpf' takes readings of one number only, and the sensors are of kind ranger; "
            "expected bootstrap, ekf,",
        ),
        (
            {"faults": [{"kind": "bias", "share": 0.1, "at_s": 3.0, "bias_deg": 5.0}]},
            "faults[0].bias_deg: has no meaning for sensors of kind 'ranger'; expected by, a list of 2 numbers",
        ),
    ],
)
def test_bad_input(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(tf.ScenarioError) as caught:
        plan_with(**settings)
    assert str(caught.value).startswith(says)


@pytest.mark.parametrize(
    ("members", "says"),
    [
        (
            {"h": lambda self, x, s: np.zeros((3, 1))},
            "sensor 'bad': h: returned an array (3, 1) for arrays (2, 4) and (3, 2)",
        ),
        ({"jacobian": lambda self, x, s: self.h(x, s)}, "sensor 'bad': jacobian: returned an array (2, 3, 2)"),
        (
            {"simulate": lambda self, target, position, normals: (1.0,)},
            "sensor 'bad': simulate: returned (1.0,); expected 2 numbers, or None",
        ),
        ({"h": lambda self, x, s: x["east"]}, "sensor 'bad': h: IndexError: "),
        ({"sd": (1.0, 1.0, 1.0)}, "sensor.sd: 'bad' has 3 sd and 2 resolutions; expected one of each"),
        ({"sd": 1.0}, "sensor.sd: 'bad' has 1.0; expected a tuple of numbers above 0"),
        ({"resolution": (0.0, 1.0)}, "sensor.resolution: 'bad' has (0.0, 1.0); expected a tuple of numbers above 0"),
        ({"range_m": None}, "sensor.range_m: 'bad' has None; expected metres, above 0"),
    ],
)
def test_a_class_that_is_wrong_is_found_when_the_run_is_planned(members: dict[str, Any], says: str) -> None:
    register_sensor("bad", type("Bad", (Ranger,), {"__init__": lambda self: None, **members}))
    with pytest.raises(tf.ScenarioError) as caught:
        plan_with(sensor__kind="bad")
    assert str(caught.value).startswith(says)


def test_what_cannot_be_registered() -> None:
    with pytest.raises(tf.ScenarioError, match="'doa' is a sensor of Trackfield's own"):
        tf.register_sensor("doa", Ranger)
    with pytest.raises(tf.ScenarioError, match="sensor 'mine' has no simulate, h, jacobian"):
        tf.register_sensor("mine", dict)
