"""What is too much of something: one message that says of what, how much there is, and how much there may be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trackfield as tf
from tests.test_extremes import bounded, refused
from trackfield.errors import MOST_TOLD, ScenarioError, combined
from trackfield.scenario import Scenario
from trackfield.words import plain, quoted

BASE: dict[str, Any] = {"name": "much", "target": {"path": "s1"}}


def straight(end_s: float, far_m: float) -> dict[str, Any]:
    return {"path": "waypoints", "waypoints": [[0, 0, 0], [end_s, far_m, 0]]}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"target": {"path": "s2", "steps": 65535, "step_s": 3600}}, "target.steps: s2 would go on for 2.35926e+08 s"),
        ({"target": {"path": "s1", "step_s": 0.001, "steps": 65536}}, "target.steps: is 65536; "),
        (
            {"target": straight(1000, 1e7), "sensor": {"kind": "doa", "level_db": 1}},
            "target: the path, 1e+04 km, is too long to be searched for sensors within 1.06 m of it; "
            "expected at most about 63.6 km, or a longer reach",
        ),
        (
            {"targets": [{"path": "s3", "id": f"t{i}"} for i in range(100)], "target": {"path": "s3", "steps": 9000}},
            "targets: the paths of 101 targets have more than 500000 steps in all; expected fewer targets",
        ),
        (
            {
                "targets": [{"path": "s1", "id": f"t{number}"} for number in range(100)],
                "field": {"layout": "grid", "nodes": 40_000},
            },
            "targets: 40000 sensors may hear 101 targets; expected at most 2000000 pairs",
        ),
        (
            {
                "link": {"model": "gilbert_elliott", "good_s": 0.001, "bad_s": 0.002},
                "field": {"layout": "grid", "nodes": 10_000},
            },
            "link.good_s: each of 10000 links would change 4.07e+04 times in the run; expected at most 50000000",
        ),
        ({"field": {"layout": "along-path", "within_m": 1e7}}, "field.spacing_m: the field has 16"),
        ({"field": {"layout": "grid", "spacing_m": 0.01}}, "field.spacing_m: the field has 250010"),
        (
            {"faults": [{"kind": "deaf", "share": 1.0, "at_s": 1.0}] * 5000},
            "faults: 5000 faults affect 605000 processes in all; expected at most 500000, each counted once for",
        ),
        ({"faults": [{"kind": "kill", "share": 1.0, "at_s": 1.0}] * 10_001}, "faults: has more than 10000 entries"),
        ({"fusion": {"trackers": ["a" * 101]}}, "fusion.trackers: has more than 100 characters; expected fewer"),
        ({"seed": 2**63}, "seed: is 9223372036854775808; expected a whole number from 0 to 9223372036854775807"),
        ({"seed": 2**64}, "seed: is 18446744073709551616; expected a whole number from 0 to 9223372036854775807"),
        ({"seed": 2**400}, "seed: is a whole number of 401 bits; expected a number of at most 38 digits"),
        ({"fusion": {"sigma_v": 1e-300}}, "fusion.sigma_v: is 1e-300; expected 0, or a number that is not within"),
        ({"name": "n" * 101}, 'name: is "nnnn'),
        ({"link": {"model": "trace", "file": "a\0b"}}, "link.file: is '"),
        ({1: 2}, "has the key 1; expected keys that are text"),
        ({"target": {"path": "s1", "steps": {"a": {}}}}, "target.steps: is {"),
    ],
)  # fmt: skip
def test_too_much_of_something(data: dict[str, Any], message: str) -> None:
    assert refused(BASE | data).startswith(message)


@pytest.mark.parametrize(("north_m", "message"), [(0.0, ""), (2500.0, "sensor.threshold: the target never comes")])
def test_sensors_that_hear_56_m_stand_by_a_flight_of_2000_km(north_m: float, message: str) -> None:
    flight = {"path": "waypoints", "waypoints": [[0, north_m, 0], [16_500, north_m, 2.1e6]]}
    assert refused(BASE | {"target": flight}).startswith(message)


def test_a_scenario_that_holds_itself_is_refused() -> None:
    endless: dict[str, Any] = dict(BASE)
    endless["fusion"] = endless
    assert "fusion: is too deep; expected no value more than 16 deep in tables and lists" in refused(endless)


def test_thousands_of_faults_with_shares_are_worked_out() -> None:
    times = [round(0.01 * number, 2) for number in range(1, 5001)]
    faults = [{"kind": "deaf", "share": 0.02, "at_s": at_s, "until_s": at_s + 0.005} for at_s in times]
    assert refused(BASE | {"faults": faults}) == ""


def test_thousands_of_sensors_that_all_hear_the_target_are_worked_out() -> None:
    """No part of a plan and its warnings looks at all pairs of sensors, which would take minutes."""
    field = {"layout": "ring", "nodes": 20_000, "radius_m": 70.0}
    assert refused(BASE | {"field": field}) == ""


def test_thousands_of_errors_are_counted() -> None:
    errors = [ScenarioError(f"wrong {number}") for number in range(1000)]
    assert str(combined(errors)).splitlines() == [f"wrong {number}" for number in range(MOST_TOLD)] + [
        "... and 980 more errors"
    ]
    assert len(combined(errors).parts) == 1000


@pytest.mark.parametrize(
    ("seed", "message"),
    [(2**64, "is 18446744073709551616"), (-1, "is -1"), (1.5, "is 1.5"), (True, "is true"), (2**400, "is a whole")],
)
def test_a_seed_from_python(seed: Any, message: str) -> None:
    with pytest.raises(ScenarioError, match=f"^seed: {message}"):
        tf.run("zhai-spcpf", seed=seed)


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"link.delay_ms": range(1, 20_000)}, "^vary: 10,001 combinations; expected 10,000 or fewer"),
        ({"link.delay_ms": range(1, 200), "seed_": range(1, 200)}, "^vary: 39,601 combinations"),
        ({"link.delay_ms": [1, 2**200]}, "^link.delay_ms: is a whole number of 201 bits"),
    ],
)
def test_what_a_study_varies(vary: dict[str, Any], message: str) -> None:
    with bounded(), pytest.raises(ScenarioError, match=message):
        tf.study("zhai-spcpf", [1], vary)


def test_numbers_without_a_sign_of_their_own() -> None:
    scenario = Scenario.load(BASE | {"fusion": {"x_m": -0.0, "y_m": 3}})
    assert str(scenario.fusion.x_m) == "0.0"


# --- what a message shows of it ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("short", "'short'"),
        ("a\x1b[31m\n", "'a\\x1b[31m\\n'"),
        (7, "7"),
        (2**400, "a whole number of 401 bits"),
        ([[[[[1]]]]], "[[[[...]]]]"),
        ("x" * 10**7, "'xxxxxxxxxxxxxxxxx...xxxxxxxxxxxxxxxxxx'"),
        (np.zeros(10**6), "array([0., 0., 0.,..., shape=(1000000,))"),
    ],
)
def test_a_value_in_brief(value: object, shown: str) -> None:
    assert quoted(value) == shown


def test_a_terminal_obeys_nothing_in_a_message() -> None:
    assert plain("über 3 m") == "über 3 m"
    assert plain("\x1b[2J\x9b\u202e\ud800\u2028") == "\\x1b[2J\\x9b\\u202e\\ud800\\u2028"
    error = ScenarioError("is \x1b[31mred", file="a\rb", key="c\nd", expected="e\0f")
    assert str(error) == "a\\rb: c\\nd: is \\x1b[31mred; expected e\\x00f"
