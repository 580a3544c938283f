"""What kinds of sensing cannot be, and what they may be called."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.books.said import describe
from tests.rangers import Distance
from tests.sensing import hearing, registered
from tests.tripwire import Trip
from trackfield.scenario import survey
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.codec import encode
from trackfield.wire.messages import Measurement
from trackfield.world.path import Path


def refused(base: type = Distance, **members: Any) -> str:
    """What is said when a run with sensors of a class like ``base`` with these members is planned."""
    with registered(odd=type("Odd", (base,), members)), pytest.raises(tf.ScenarioError) as caught:
        planned(tf.Scenario.load("zhai-spcpf", {"sensor.kind": "odd", "fusion.trackers": ["ekf"], "target.steps": 5}))
    return str(caught.value)


def test_a_threshold_that_is_set_does_not_go_with_sensors_that_report_by_themselves() -> None:
    level = {"level": lambda self, values: values[0]}
    says = refused(Trip, thresholds=(10.0, 20.0), **level)
    assert says == (
        "sensor.thresholds: 'odd' has (10.0, 20.0), which differ, and its sensors report by themselves; "
        "expected one level, twice, or the rhythm steps"
    )
    with registered(odd=type("Odd", (Trip,), {"thresholds": (10.0, 10.0), **level})):
        assert not make_sensor("odd", {}).adaptive


def test_a_first_kind_without_sensors_is_none_of_them() -> None:
    """All sensors are of the second section; a tracker for arrays alone is content with it."""
    for share in ({"share": 1.0}, {"nodes": [f"n{i:03d}" for i in range(121)]}):
        second = {"kind": "doa", "doa_sd_deg": 2.0, **share}
        with registered(odd=Distance):
            field = {"sensor.kind": "odd", "sensors": [second], "fusion.trackers": ["spcpf"], "target.steps": 5}
            plan = planned(tf.Scenario.load("zhai-spcpf", field))
        assert list(plan.tracking["sensing"]) == ["doa"]


def test_no_two_kinds_have_one_name() -> None:
    """A kind that is called as the second group of another would be."""
    groups = [
        {"kind": "doa-2", "nodes": ["n000", "n002"]},
        {"kind": "doa", "nodes": ["n001"], "doa_sd_deg": 5.0},
        {"kind": "doa", "nodes": ["n003"], "doa_sd_deg": 6.0},
    ]
    with registered(**{"doa-2": Distance}):
        site = survey(tf.Scenario.load("zhai-spcpf", {"fusion.trackers": ["ekf"], "sensors": groups}))
    assert {name: section.kind for name, section in site.sections.items()} == {
        "doa": "doa",
        "doa-2": "doa-2",
        "doa-3": "doa",
        "doa-4": "doa",
    }
    assert {name: len(members) for name, members in site.kinds.items() if name != "doa"} == {
        "doa-2": 2,
        "doa-3": 1,
        "doa-4": 1,
    }


@pytest.mark.parametrize(
    ("name", "annotation", "value", "expected"),
    [
        ("level", "float", 1.0, "a method"),
        ("values", "int", 1, "a method"),
        ("variance", "float", 2.0, "a method"),
        ("message", "str", "hello", "a class of messages of trackfield/wire"),
        ("units", "str", "m", "a tuple of texts"),
        ("summary", "int", 3, "a text"),
    ],
)
def test_a_setting_with_the_name_of_a_member_is_told_to_have_another(
    name: str, annotation: str, value: object, expected: str
) -> None:
    odd = dataclass(frozen=True)(type("Odd", (Distance,), {name: value, "__annotations__": {name: annotation}}))
    says = refused(odd)
    assert says.startswith(f"sensor.{name}: 'odd' has {value!r}; expected {expected}")
    assert says.endswith(f"a setting of another meaning needs another name than '{name}'")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("sd", ("1",), "a tuple of numbers above 0"),
        ("unknowns", (tf.Unknown("a", "1"),), "a tuple of Unknown(name, sd, walk_sd, mean)"),  # type: ignore[arg-type]
        ("unknowns", (tf.Unknown(3, 1.0),), "a tuple of Unknown(name, sd, walk_sd, mean)"),  # type: ignore[arg-type]
        ("thresholds", ("a", "b"), "None, or the lowest and the highest level"),
        ("bearings", "yes", "True or False"),
        ("bearings", True, "at least 2 numbers: a bearing (rad) and a level (dB)"),
        ("summary", 3, "a text"),
        ("draws", "a", "a tuple of texts, or None"),
        ("draws", ("a", "b"), "a text for each number, or None"),
        ("message", Distance, "a class of messages of trackfield/wire"),
        ("colour", "red", "None, or a Colour(slow, slow_s, fixed)"),
        ("fix", 3, "a method"),
        ("words", None, "a method"),
    ],
)
def test_what_a_member_cannot_be(name: str, value: object, expected: str) -> None:
    assert re.match(rf"sensor\.{name}: 'odd' has .+; expected {re.escape(expected)}", refused(**{name: value}))


def test_a_layer_may_be_none() -> None:
    with registered(odd=type("Odd", (Distance,), {"layer": "", "fix": None, "variance": None})):
        kind = make_sensor("odd", {})
    assert (kind.layer, kind.fix, kind.variance) == ("", None, None)


@pytest.mark.parametrize(
    ("method", "does", "says"),
    [
        ("residual", lambda self, difference: difference[..., 0], "returned an array (2, 3) for arrays (2, 3, 1)"),
        ("z", lambda self, values: values[:, 0], "returned an array (3,) for arrays (3, 1); expected (3, 1)"),
        ("level", lambda self, values: "loud", "returned 'loud'; expected a number"),
        ("level", lambda self, values: values[7], "IndexError: tuple index out of range"),
        ("reading", lambda self, values: values, "AttributeError: 'tuple' object has no attribute 'report'"),
        ("reading", lambda self, values: hearing(60.0, 90.0), "expected a reading that reports a Measurement"),
        ("values", lambda self, message: message.bearing_deg, "AttributeError: 'Measurement' object"),
        ("values", lambda self, message: (1.0, 2.0), "expected 1 numbers"),
        ("words", lambda self, message: 5, "returned 5; expected a text"),
        ("words", lambda self, message: message.text, "AttributeError: 'Measurement' object"),
        ("longest", lambda self: None, "returned None; expected a Measurement"),
        ("fix", lambda self, z, at: None, "TypeError: "),
        ("fix", lambda self, z, at, anywhere: (z, at), "fix returned tuple; expected a Gaussian or None"),
        ("fix", lambda self, z, at, anywhere: tf.Gaussian(at[0], anywhere), "mean is of shape (2,); expected"),
        ("invented", lambda self, fault, threshold, uniform: (1.0, 2.0), "expected 1 numbers, or None"),
        ("event", lambda self, scene, window, place: "noon", "returned 'noon' for the window (0, 10000000000)"),
        ("event", lambda self, scene, window, place: window[1] + 1, "expected None, or one or several instants (ns)"),
        ("event", lambda self, window: None, "TypeError: "),
    ],
)  # fmt: skip
def test_each_method_is_tried_before_a_run(method: str, does: Any, says: str) -> None:
    told = refused(Trip, **{method: does})
    assert told.startswith(f"sensor 'odd': {method}: ") and says in told
    assert "\n" not in told


def test_what_a_users_words_cannot_say_is_said_without_them() -> None:
    """They may do so for a message of a peer, which is not like those that were tried."""

    def fails(self: Any, message: Any) -> str:
        raise ZeroDivisionError

    message = Measurement(7, (1234,))
    for method in ("words", "values"):
        kind = Kind("odd", type("Odd", (Distance,), {method: fails})())
        assert describe(encode(message), kind) == (repr(message), (), 7)


def test_what_is_sensed_is_faster_than_any_target() -> None:
    assert re.fullmatch(
        r"sensor\.speed_m_s: 'odd' has 3 m/s, and \w+ moves at [\d.]+ m/s; expected more than the speed of any target",
        refused(speed_m_s=3.0),
    )
    turns = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (2.0, 20.0, 0.0, 1.0, 0.0)])
    assert turns.fastest_m_s == pytest.approx(14.5), "between its knots: 1.5 times its mean less half of its ends"
