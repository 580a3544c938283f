"""When a track is expected of sensors that report passes alone."""

from __future__ import annotations

from itertools import pairwise

import trackfield as tf
from launcher.plan.prepare import planned
from trackfield.role import NS
from trackfield.world.events import awaited_steps


def reported(*times_s: float) -> dict[str, dict[int, int]]:
    return {f"n{i}": {1 + int(2 * t): round(t * NS)} for i, t in enumerate(times_s)}


def test_from_two_seconds_after_the_fourth_report_to_ten_after_the_first() -> None:
    assert awaited_steps(reported(10, 10.5, 11, 11.5), 0, NS // 2, 100) == set(range(27, 41))


def test_a_fifth_report_makes_it_longer() -> None:
    assert awaited_steps(reported(10, 10.5, 11, 11.5, 12), 0, NS // 2, 100) == set(range(27, 42))


def test_three_reports_are_not_enough_and_four_of_one_sensor_are_not_either() -> None:
    assert awaited_steps(reported(10, 10.5, 11), 0, NS // 2, 100) == set()
    assert awaited_steps({"a": {k: k * NS // 2 for k in (20, 21, 22, 23)}}, 0, NS // 2, 100) == set()


def test_times_count_from_the_first_step_and_end_with_the_last() -> None:
    assert awaited_steps(reported(10, 10.5, 11, 11.5), 9 * NS, NS // 2, 15) == set(range(9, 16))


def test_a_field_of_microphones_expects_a_track_after_each_pass() -> None:
    plan = planned(tf.Scenario.load("yang-ecpa", {"sensor.waveform": False}))
    steps = sorted(plan.pass_steps or ())
    pauses = [a for a, b in pairwise(steps) if b - a > 1]
    assert len(pauses) == 3  # four passes
    assert 40 < len(steps) < 80
