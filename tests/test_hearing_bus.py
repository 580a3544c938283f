"""Clusters along the track of a real bus, and a vehicle that sounds like a real car."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from launcher.plan.prepare import load, planned
from launcher.record.figures.passes.metrics import passes_metrics
from tests.hearing_bus import Found, events
from tests.simulated import simulated


@pytest.fixture(scope="module")
def found() -> list[Found]:
    """The first minute: the bus sets off, turns left, stands from 36 s to 43 s, and turns right."""
    return events(122, 30.0)


def test_where_the_bus_goes_straight_on_it_is_fixed_though_it_speeds_up_and_brakes(found: list[Found]) -> None:
    straight = [one for one in found if one.bus == "goes straight on" and one.slowest_m_s > 4.0]
    assert [one.head for one in straight] == ["n000", "n005", "n010"]
    assert all(one.errors is not None for one in straight)


def test_each_fix_is_right(found: list[Found]) -> None:
    """Within what its covariance says, and a metre; none is of a bus that goes elsewhere."""
    fixes = [one for one in found if not one.refused]
    assert fixes
    for one in fixes:
        assert one.errors is not None
        assert one.sd_m is not None
        assert one.errors.location_m < min(3.0 * one.sd_m, 1.0)
        assert one.errors.speed_m_s < 1.0
        assert one.errors.heading_deg < 5.0


def test_where_it_stands_nothing_is_fixed_and_heads_say_why(found: list[Found]) -> None:
    """As it comes to a halt, and as it sets off, some sensors notice that, others do not."""
    stands = [one for one in found if 30.0 < one.at_s < 50.0]
    assert {one.head for one in stands} == {"n015"}
    assert {one.refused for one in stands} == {"too few reports"}


def test_a_vehicle_that_sounds_like_a_real_car_is_heard_and_fixed(data_file: Callable[[str], Path]) -> None:
    """All five sensors find its first pass in the sound; the fix is as good as of a synthesised vehicle."""
    sound = data_file("car_28mph.wav")
    plan = planned(load("yang-ecpa", settings=[f"target.sound='{sound}'", "target.steps=40", "fusion.trackers=['ml']"]))
    _, rows = simulated(plan)
    made = passes_metrics(plan, rows)["trackers"]["ml"]
    assert (made["fixes"], made["false_fixes"], made["reports_used"]) == (1, 0, 5.0)
    assert made["location_m"]["max"] < 0.8
    assert made["speed_m_s"]["max"] < 0.3
    assert made["heading_deg"]["max"] < 2.0
