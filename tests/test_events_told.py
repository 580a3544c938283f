"""Several passes of a sensor that reports by itself, and kinds that say themselves when they do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from tests.sensing import registered
from tests.test_events import FIELD, STRAIGHT, placed
from tests.tripwire import Trip
from trackfield.role import NS
from trackfield.sensing.complete import Kind
from trackfield.world.path import Path

LATER = Path.of([(4.0, -100.0, 5.0, 10.0, 0.0), (40.0, 260.0, 5.0, 10.0, 0.0)])
"""East at 10 m/s, 4 s behind ``STRAIGHT`` and beside it."""
BACK = Path.of(
    [
        (0.0, -40.0, 0.0, 10.0, 0.0),
        (8.0, 40.0, 0.0, 10.0, 0.0),
        (8.0, 40.0, 0.0, -10.0, 0.0),
        (16.0, -40.0, 0.0, -10.0, 0.0),
    ]
)
"""East, and back at once, within the range of a sensor near the origin."""


def test_each_of_two_targets_in_one_window_is_an_event() -> None:
    assert placed(0.0, 20.0, STRAIGHT, LATER).events() == pytest.approx([10 * NS, 14 * NS], abs=2000)


def test_a_target_that_turns_within_range_passes_twice() -> None:
    sensor = placed(0.0, 20.0, BACK)
    assert sensor.events() == pytest.approx([4 * NS, 12 * NS], abs=2000)
    assert sensor.next_window(5 * NS) == sensor.events()[1]


def test_a_target_at_rest_passes_once_and_one_that_appears_never() -> None:
    rests = Path.of(
        [
            (0.0, -40.0, 0.0, 10.0, 0.0),
            (4.0, 0.0, 0.0, 0.0, 0.0),
            (9.0, 0.0, 0.0, 0.0, 0.0),
            (20.0, 50.0, 0.0, 9.0, 0.0),
        ]
    )
    assert len(placed(0.0, 20.0, rests).events()) == 1
    appears = Path.of([(6.0, 5.0, 0.0, 10.0, 0.0), (20.0, 145.0, 0.0, 10.0, 0.0)])
    assert placed(0.0, 20.0, appears, STRAIGHT).events() == placed(0.0, 20.0, STRAIGHT).events()


@dataclass(frozen=True)
class Told(Trip):
    """Says itself when."""

    when: str = "none"

    def event(self, scene: Any, window: tuple[int, int], place: Any) -> Any:
        middle = sum(window) / 2
        return {
            "none": None,
            "float": middle,
            "numpy": np.int64(middle),
            "several": (np.int64(middle), 1e9),
            "array": np.array([middle, 1e9]),
            "outside": window[1] + 1,
            "nan": np.nan,
            "text": ["now"],
        }[self.when]


@pytest.mark.parametrize(
    ("when", "expected"), [("none", []), ("float", [20]), ("numpy", [20]), ("several", [1, 20]), ("array", [1, 20])]
)
def test_a_kind_says_itself_when(when: str, expected: list[int]) -> None:
    found = replace(placed(0.0, 20.0, STRAIGHT), kind=Kind("told", Told(when=when))).events()
    assert found == [s * NS for s in expected]
    assert all(type(at) is int for at in found)


@pytest.mark.parametrize("when", ["outside", "nan", "text"])
def test_what_is_no_instant_of_the_window_is_told(when: str) -> None:
    with pytest.raises(tf.RunFailed, match=r"the sensor of n1: event returned .*; expected None, or one or several"):
        replace(placed(0.0, 20.0, STRAIGHT), kind=Kind("told", Told(when=when))).events()
    with registered(told=Told), pytest.raises(tf.ScenarioError, match="sensor 'told': event"):
        planned(tf.Scenario.load("zhai-spcpf", FIELD | {"sensor.kind": "told", "sensor.when": when}))
