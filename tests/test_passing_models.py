"""When and how near a target passes sensors: exact cases, derivatives against differences, states without a pass."""

import math
from itertools import product

import numpy as np
import pytest

from trackfield.models.noise import SLOWEST_M_S, time_sd
from trackfield.models.passing import distances, distances_and_slopes, times, times_and_slopes

SENSORS = np.array([(0.0, 0.0), (30.0, -5.0), (-12.0, 40.0)])
FAST = np.array([(-40.0, 7.0, 13.4, 2.0), (12.0, -30.0, -3.0, 25.0), (5.0, 5.0, 1.0, -2.0)])
SLOW = np.array([(-4.0, 7.0, 0.2, 0.1), (12.0, -3.0, -0.05, 0.3)])


def test_a_straight_pass_is_where_and_when_it_is():
    """Past the origin on y = 20 m at 10 m/s, 50 m before: 5 s, 20 m, and the sound 20/340 s later."""
    state, origin = np.array([-50.0, 20.0, 10.0, 0.0]), np.zeros((1, 2))
    assert times(state, origin, math.inf) == pytest.approx(5.0)
    assert times(state, origin, 340.0) == pytest.approx(5.0 + 20.0 / 340.0)
    assert distances(state, origin) == pytest.approx(20.0)


@pytest.mark.parametrize("seconds", [-7.0, -0.3, 2.5])
def test_a_pass_stays_the_same_as_the_state_moves_along_its_line(seconds):
    later = FAST + np.concatenate((FAST[:, 2:] * seconds, np.zeros((3, 2))), axis=1)
    assert times(later, SENSORS, 340.0) == pytest.approx(times(FAST, SENSORS, 340.0) - seconds)
    assert distances(later, SENSORS) == pytest.approx(distances(FAST, SENSORS))


def test_distances_are_those_of_the_cross_product():
    apart, velocity = FAST[:, None, :2] - SENSORS, FAST[:, None, 2:]
    cross = apart[..., 0] * velocity[..., 1] - apart[..., 1] * velocity[..., 0]
    assert distances(FAST, SENSORS) == pytest.approx(np.abs(cross) / np.linalg.norm(velocity, axis=-1))


@pytest.mark.parametrize(("states", "sound_m_s"), list(product((FAST, SLOW), (340.0, math.inf))))
def test_slopes_are_the_derivatives(states, sound_m_s):
    value, slopes = times_and_slopes(states, SENSORS, sound_m_s)
    assert (value == times(states, SENSORS, sound_m_s)).all()
    assert slopes == pytest.approx(_differences(lambda x: times(x, SENSORS, sound_m_s), states), rel=1e-6, abs=1e-7)
    away, slopes = distances_and_slopes(states, SENSORS)
    assert (away == distances(states, SENSORS)).all()
    assert slopes == pytest.approx(_differences(lambda x: distances(x, SENSORS), states), rel=1e-6, abs=1e-7)


def test_unknowns_of_the_sensing_have_no_part_in_a_pass():
    wider = np.concatenate((FAST, np.full((3, 2), 7.0)), axis=1)
    assert (times(wider, SENSORS, 340.0) == times(FAST, SENSORS, 340.0)).all()
    for function in (lambda x: times_and_slopes(x, SENSORS, 340.0)[1], lambda x: distances_and_slopes(x, SENSORS)[1]):
        assert (function(wider)[..., :4] == function(FAST)).all()
        assert (function(wider)[..., 4:] == 0.0).all()


def test_a_target_that_stands_is_as_far_as_it_is_and_passes_now():
    state = np.array([3.0, 4.0, 0.0, 0.0])
    (until,), (slopes,) = times_and_slopes(state, np.zeros((1, 2)), math.inf)
    assert until == 0.0
    assert slopes == pytest.approx([0.0, 0.0, -3.0 / SLOWEST_M_S**2, -4.0 / SLOWEST_M_S**2])
    (away,), (slopes,) = distances_and_slopes(state, np.zeros((1, 2)))
    assert away == 5.0
    assert slopes == pytest.approx([0.6, 0.8, 0.0, 0.0])


@pytest.mark.parametrize("sound_m_s", [340.0, math.inf])
def test_values_are_continuous_at_the_lowest_speed(sound_m_s):
    below, above = (np.array([-3.0, 7.0, factor * SLOWEST_M_S, 0.0]) for factor in (1 - 1e-9, 1 + 1e-9))
    assert times(below, SENSORS, sound_m_s) == pytest.approx(times(above, SENSORS, sound_m_s), abs=1e-6)
    assert distances(below, SENSORS) == pytest.approx(distances(above, SENSORS), abs=1e-6)


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (1e-300, 0.0), (0.0, 13.4)])
def test_all_is_finite_at_a_sensor_and_on_its_line(velocity):
    for place in ((0.0, 0.0), (0.0, -20.0)):
        state = np.array([*place, *velocity])
        for value, slopes in (times_and_slopes(state, SENSORS, 340.0), distances_and_slopes(state, SENSORS)):
            assert np.isfinite(value).all()
            assert np.isfinite(slopes).all()


def test_runs_have_sensors_of_their_own():
    places = SENSORS + np.arange(3.0)[:, None, None]
    for run in range(3):
        assert times(FAST, places, 340.0)[run] == pytest.approx(times(FAST[run], places[run], 340.0))


def test_the_noise_of_times_grows_with_distance_and_falls_with_speed():
    given = {"sd": 0.1, "floor_m": 3.0, "at_m": 12.0, "larger": np.maximum}
    assert time_sd(np.array(12.0), np.array(13.4), p=1.0, q=3.3, **given) == pytest.approx(0.1)
    assert time_sd(np.array([1.0, 3.0, 24.0]), np.array(13.4), p=1.0, q=0.0, **given) == pytest.approx(
        [0.025, 0.025, 0.2]
    )
    assert time_sd(np.array(5.0), np.array([6.7, 26.8]), p=0.0, q=3.3, **given) == pytest.approx(
        [0.1 * 2.0**3.3, 0.1 / 2.0**3.3]
    )
    assert time_sd(np.array(5.0), np.array([5.0, 0.0]), p=0.0, q=0.0, **given) == pytest.approx([0.1, 0.1])
    assert np.isfinite(time_sd(np.array(0.0), np.array(0.0), p=1.0, q=3.3, **given))


def test_the_noise_of_a_single_time_is_that_of_an_array_of_one():
    law = {"sd": 0.1, "floor_m": 3.0, "at_m": 12.0, "p": 1.5, "q": 2.0}
    for d, speed in product((1.0, 24.0), (0.1, 20.0)):
        assert time_sd(d, speed, **law) == time_sd(np.array([d]), np.array([speed]), **law, larger=np.maximum)[0]


def _differences(function, states):
    """Central differences (..., K, 4)."""
    steps = 1e-6 * np.eye(4)
    return np.stack([(function(states + step) - function(states - step)) / 2e-6 for step in steps], axis=-1)
