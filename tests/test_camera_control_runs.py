"""Whole fields in virtual time: the camera looks at the vehicle at the time for which it was aimed."""

from __future__ import annotations

from math import hypot

import pytest

from tests.camera_runs import Field, run
from trackfield.role import NS


@pytest.fixture(scope="module")
def field() -> Field:
    return run()


def test_each_pass_that_the_camera_can_turn_to_is_in_the_picture(field: Field) -> None:
    """B to D passes 9 m behind the camera: it would have to turn further than 100 degrees by then (docs/camera.md)."""
    assert [one.outcome for one in field.aimed] == ["aimed", "aimed", "out of reach", "aimed"]
    assert [field.in_frame(one.aim_ns) for one in field.aimed if one.shot] == [True] * 3
    assert [one.shot for one in field.aimed] == [1, 2, 0, 3]


def test_from_where_all_are_in_reach_all_four_are_in_the_picture() -> None:
    field = run("camera.x_m=120", "camera.y_m=-40")
    assert [one.outcome for one in field.aimed] == ["aimed"] * 4
    assert [field.in_frame(one.aim_ns) for one in field.aimed] == [True] * 4


def test_the_delay_is_measured_from_the_last_pass(field: Field) -> None:
    """By the truth: from when the target was nearest to the last of the sensors to when the fix came."""
    places = [(one.x, one.y) for one in field.plan.processes if one.id.startswith("n0")]
    path = field.plan.paths["target"]
    for one in field.aimed:
        times = range(one.told_ns - 6 * NS, one.told_ns, NS // 100)
        track = [path.at(at_ns / NS) for at_ns in times]
        away = [[hypot(state[0] - x, state[1] - y) for state in track if state is not None] for x, y in places]
        last_ns = max(times[each.index(min(each))] for each in away)
        assert one.delay_s == pytest.approx((one.told_ns - last_ns) / NS, abs=0.15)


def test_without_prediction_it_looks_at_where_the_vehicle_was(field: Field) -> None:
    """From beside its path the vehicle is gone; from far away along its path it is still in the picture."""
    behind = run("camera.predict=false")
    [first, _, third, _] = behind.aimed
    assert first.outcome == third.outcome == "aimed"
    assert not behind.in_frame(first.aim_ns)
    assert not behind.in_frame(third.aim_ns)
    assert first.delay_s == pytest.approx(field.aimed[0].delay_s, abs=1e-6)


def test_over_three_hops_the_delay_is_longer_and_the_aim_as_good(field: Field) -> None:
    hops = run("camera.hops=[[60,-60],[100,-60],[70,-40]]", "backbone.model=lognormal_prr", "backbone.radio=wifi11b")
    for near, far in zip(field.aimed, hops.aimed, strict=True):
        assert far.delay_s > near.delay_s + 0.06, "three times 20 ms"
    assert [hops.in_frame(one.aim_ns) for one in hops.aimed if one.shot] == [True] * 3


def test_control_that_is_killed_comes_back_and_aims_at_the_next_pass() -> None:
    """It dies half a second after the first fix, and is started again two seconds later."""
    again = run("faults=[{kind='restart', nodes=['camera-control'], at_s=13.3, until_s=15.3}]")
    shots = [one.shot for one in again.aimed if one.shot]
    assert shots == sorted(set(shots))
    assert [again.in_frame(one.aim_ns) for one in again.aimed if one.step in (65, 159)] == [True, True]
    assert [values[0] for _, values in again.told("camera-control", "camera")].count("ready") == 2


CLUSTERS = ("field.centres=[[0,0],[60,-50]]", "sensor.range_m=25", "target.steps=40")
"""Two clusters, the camera between them."""


def two(*settings: str) -> Field:
    """Two vehicles, of which the heads of two clusters tell at almost the same time: n005 first."""
    second = "{id='second', path='waypoints', waypoints=[[0.3, -73.928, -57.019], [20.3, 193.928, -42.981]]}"
    first = "target.waypoints=[[0.5, -133.928, -7.019], [20.5, 133.928, 7.019]]"
    return run(*CLUSTERS, first, f"targets=[{second}]", *settings)


@pytest.mark.parametrize("heading", [-10, 80])
def test_of_two_vehicles_within_the_slew_time_the_nearer_in_time_wins(heading: int) -> None:
    """The camera looks east, where n005 heard one, or north, where the other one is; both get into the picture."""
    field = two(f"camera.heading_deg={heading}")
    told = [(one.head, one.outcome) for one in field.aimed]
    if heading == 80:
        assert told == [("n005", "aimed"), ("n000", "aimed"), ("n005", "aimed")], "the first turn is cancelled"
        seen = field.aimed[1:]
    else:
        assert told == [("n005", "aimed"), ("n000", "later"), ("n000", "aimed")]
        seen = [field.aimed[0], field.aimed[2]]
    assert field.aimed[1].told_ns - field.aimed[0].told_ns < NS // 10
    assert [field.in_frame(one.aim_ns, {"n000": "target", "n005": "second"}[one.head]) for one in seen] == [True, True]


def test_control_that_is_stopped_and_started_by_system_control_goes_on() -> None:
    """Stopped after the first shot; when it runs again shots go on in number, and the next pass is in the picture."""
    field = run("camera.orders=[[14, 'stop', 'camera-control'], [25, 'start', 'camera-control']]", "target.steps=80")
    assert [(one.shot, one.step) for one in field.aimed] == [(1, 25), (2, 65)]
    assert field.in_frame(field.aimed[1].aim_ns)
    assert [values[0] for _, values in field.told("camera-control", "camera")].count("ready") == 2
