"""The paper's manoeuvres: their numbers from the specification, their motion from mechanics."""

from itertools import pairwise
from math import atan2, cos, degrees, hypot, pi, radians, sin
from statistics import fmean, stdev

import pytest
from scipy.integrate import quad

from trackfield.world.path import Path
from trackfield.world.targets import s1, s2, s3, waypoints


def at(path: Path, t: float) -> tuple[float, float, float, float]:
    state = path.at(t)
    assert state is not None
    return state


# --- s1 --------------------------------------------------------------------------


def test_s1_starts_as_the_paper_does_and_lasts_its_steps() -> None:
    path = s1(1)
    assert at(path, 0.0) == (50.0, 70.0, 6.0, 5.0)
    assert (path.start_s, path.end_s, len(path.t)) == (0.0, 60.0, 61)


@pytest.mark.parametrize("step_s", [0.1, 0.7, 0.3, 1.0, 2.5])
def test_s1_is_there_at_every_step_that_a_driver_counts_in_ns(step_s: float) -> None:
    path = s1(1, 90, step_s)
    assert all(path.at(k * round(step_s * 1e9) / 1e9) is not None for k in range(91))


def test_s1_accelerates_by_draws_that_hold_for_a_step() -> None:
    path = s1(3, 40, 0.5)
    for k in range(40):
        begin, middle, end = at(path, 0.5 * k), at(path, 0.5 * k + 0.25), at(path, 0.5 * k + 0.5)
        for axis in (0, 1):
            a = (end[2 + axis] - begin[2 + axis]) / 0.5
            assert middle[2 + axis] == pytest.approx(begin[2 + axis] + 0.25 * a)
            assert middle[axis] == pytest.approx(begin[axis] + 0.25 * begin[2 + axis] + a * 0.25**2 / 2)
            assert end[axis] == pytest.approx(begin[axis] + 0.5 * begin[2 + axis] + a * 0.5**2 / 2)


def test_s1_accelerations_have_the_papers_spread() -> None:
    path = s1(1, 5000)
    for velocities in (path.vx, path.vy):
        accelerations = [b - a for a, b in pairwise(velocities)]
        assert fmean(accelerations) == pytest.approx(0.0, abs=4 * 0.1 / 5000**0.5)
        assert stdev(accelerations) == pytest.approx(0.1, rel=0.05)


def test_s1_is_another_path_for_another_seed_and_the_same_for_the_same() -> None:
    assert s1(1) == s1(1)
    assert s1(1) != s1(2)
    assert s1(1, 100).x[:61] == s1(1, 60).x  # a longer run goes on, it does not start over


# --- s2 --------------------------------------------------------------------------


def s2_velocity(t: float) -> tuple[float, float]:
    turn = 22.5 * (min(max(t - 20, 0), 4) - min(max(t - 45, 0), 4))
    speed = 8 + 2 * sin(2 * pi * t / 15)
    return speed * cos(radians(8 + turn)), speed * sin(radians(8 + turn))


@pytest.mark.parametrize("t", [0.0, 3.3, 20.0, 22.05, 24.0, 31.87, 45.0, 47.4, 49.0, 75.0])
def test_s2_is_the_integral_of_its_velocity(t: float) -> None:
    x, y, vx, vy = at(s2(), t)
    corners = [corner for corner in (20.0, 24.0, 45.0, 49.0) if corner < t] or None
    for axis, (place, start) in enumerate(((x, 45.0), (y, 85.0))):
        way, _ = quad(lambda s, axis=axis: s2_velocity(s)[axis], 0.0, t, points=corners, epsabs=1e-9, limit=200)
        assert place == pytest.approx(start + way, abs=1e-5)
    assert (vx, vy) == pytest.approx(s2_velocity(t), abs=1e-3)


def test_s2_turns_left_and_right_by_90_degrees_at_22_5_degrees_a_second() -> None:
    headings = [degrees(atan2(*at(s2(), t)[:1:-1])) for t in (19.0, 22.0, 24.0, 40.0, 47.0, 49.0, 70.0)]
    assert headings == pytest.approx([8.0, 53.0, 98.0, 98.0, 53.0, 8.0, 8.0], abs=1e-6)


@pytest.mark.parametrize("end_s", [0.1, 20.0, 24.1, 75.0, 100.0])
def test_s2_ends_when_it_is_told(end_s: float) -> None:
    path = s2(end_s)
    assert path.end_s == end_s
    assert at(path, end_s) == pytest.approx(at(s2(120.0), end_s), abs=1e-5)


# --- s3 --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("t", "way", "speed"),
    [(0.0, 0.0, 1.0), (10.0, 60.0, 11.0), (20.0, 220.0, 21.0), (30.0, 380.0, 11.0), (40.0, 440.0, 1.0)],
)
def test_s3_gains_and_loses_a_metre_per_second_each_second(t: float, way: float, speed: float) -> None:
    x, y, vx, vy = at(s3(), t)
    assert hypot(x - 70, y - 100) == pytest.approx(way)
    assert hypot(vx, vy) == pytest.approx(speed)
    assert degrees(atan2(vy, vx)) == pytest.approx(40.0)
    assert at(s3(), 40.0)[:2] == pytest.approx((70 + 440 * cos(radians(40)), 100 + 440 * sin(radians(40))))


def test_s3_stands_still_in_the_end() -> None:
    path = s3(60.0)
    assert at(path, 50.0) == pytest.approx((*at(path, 41.0)[:2], 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("end_s", [5.0, 20.0, 40.5, 41.0])
def test_s3_ends_when_it_is_told(end_s: float) -> None:
    assert s3(end_s).end_s == end_s
    assert at(s3(end_s), end_s / 2) == pytest.approx(at(s3(60.0), end_s / 2))


# --- waypoints --------------------------------------------------------------------------


def test_waypoints_are_joined_by_straight_legs_at_constant_speed() -> None:
    path = waypoints([(2, 0, 0), (12, 100, 0), (17, 100, -40)])
    assert path.at(1.9) is None
    assert path.at(7.0) == (50.0, 0.0, 10.0, 0.0)
    assert path.at(12.0) == (100.0, 0.0, 0.0, -8.0)
    assert path.at(14.5) == (100.0, -20.0, 0.0, -8.0)
    assert path.gaps == ()


@pytest.mark.parametrize("points", [[], [(0, 0, 0)], [(0, 0, 0), (0, 1, 1)], [(1, 0, 0), (0, 1, 1)]])
def test_waypoints_need_times_that_increase(points: list[tuple[float, float, float]]) -> None:
    with pytest.raises(ValueError, match="increasing"):
        waypoints(points)
