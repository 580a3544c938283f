"""The physics against the paper's figures, against finite differences, and scalars against arrays."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.models import doa, motion
from trackfield.models.sound import audible_radius, bearing, level_db, wrap

# --- sound ---


def test_level_loses_ten_db_a_decade_at_alpha_2():
    assert [level_db(d, 70.0, 2.0) for d in (1.0, 10.0, 100.0)] == pytest.approx([70.0, 60.0, 50.0])
    assert level_db(100.0, 70.0, 4.0) == pytest.approx(30.0)


@pytest.mark.parametrize(("share", "radius"), [(0.72, 91.2), (0.75, 56.2), (0.78, 34.7)])
def test_thresholds_of_the_paper_have_its_radii(share, radius):
    assert audible_radius(70.0, 2.0, share * 70.0) == pytest.approx(radius, abs=0.05)


@given(st.floats(0.0, 120.0), st.floats(0.5, 6.0), st.floats(1.0, 1e5))
def test_audible_radius_is_the_inverse_of_level(source, alpha, distance):
    heard = level_db(distance, source, alpha)
    assert audible_radius(source, alpha, heard) == pytest.approx(distance, rel=1e-9)


def test_nothing_is_louder_than_the_source():
    assert [level_db(d, 70.0, 2.0) for d in (0.0, 1e-9, 0.5, 1.0)] == [70.0] * 4
    assert audible_radius(70.0, 2.0, 70.0) == 1.0
    assert audible_radius(70.0, 2.0, 70.1) == 0.0


def test_level_and_bearing_of_arrays_are_those_of_their_numbers():
    x = np.array([0.0, 0.3, 1.0, 5.0, -300.0])
    y = np.array([0.0, -7.0, 1.0, 0.2, 12.0])
    distance = np.hypot(x, y)
    levels, bearings = level_db(distance, 70.0, 2.5, xp=np), bearing(x, y, xp=np)
    assert levels == pytest.approx([level_db(float(d), 70.0, 2.5) for d in distance], rel=1e-15)
    assert bearings == pytest.approx([bearing(float(a), float(b)) for a, b in zip(x, y, strict=True)], rel=1e-15)
    assert wrap(bearings + 4.0) == pytest.approx([wrap(float(b) + 4.0) for b in bearings], rel=1e-15)


@pytest.mark.parametrize(
    ("dx", "dy", "degrees"), [(0, 1, 0), (1, 1, 45), (1, 0, 90), (0, -1, 180), (-1, 0, -90), (-1, 1, -45)]
)
def test_bearing_runs_clockwise_from_north(dx, dy, degrees):
    assert math.degrees(bearing(float(dx), float(dy))) == pytest.approx(degrees)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (math.pi, -math.pi),
        (-math.pi, -math.pi),
        (3.0 * math.pi, -math.pi),
        (math.radians(181.0), math.radians(-179.0)),
        (math.radians(-181.0), math.radians(179.0)),
        (math.radians(719.0), math.radians(-1.0)),
        (-math.pi - 1e-300, -math.pi),  # rounds to a full turn on the way
    ],
)
def test_wrap_at_its_edges(angle, wrapped):
    assert wrap(angle) == pytest.approx(wrapped)


@given(st.floats(-1e4, 1e4))
def test_wrap_keeps_the_direction_and_its_range(angle):
    wrapped = wrap(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
    assert float(wrap(np.array([angle]))[0]) == wrapped


# --- motion ---


def test_constant_acceleration_over_a_step_is_exact():
    state = np.array(motion.transition(2.0)) @ [10.0, 20.0, 3.0, -4.0]
    state = state + np.array(motion.noise_gain(2.0)) @ [0.5, 1.0]
    assert state == pytest.approx([10 + 6 + 1, 20 - 8 + 2, 3 + 1, -4 + 2])


@given(st.floats(0.0, 60.0), st.floats(0.0, 60.0))
def test_two_transitions_are_one_of_their_sum(a, b):
    both = np.array(motion.transition(a)) @ np.array(motion.transition(b))
    assert both == pytest.approx(np.array(motion.transition(a + b)))


def test_process_noise_is_gamma_gamma_transposed():
    gain = np.array(motion.noise_gain(3.0))
    Q = np.array(motion.process_noise(3.0, 0.2))
    assert pytest.approx(0.04 * gain @ gain.T) == Q
    assert np.linalg.matrix_rank(Q) == 2
    assert not np.any(motion.process_noise(0.0, 0.2))


def test_a_standing_target_forgets_its_velocity_and_stirs():
    assert np.array(motion.standing_transition()) @ [1.0, 2.0, 9.0, 9.0] == pytest.approx([1.0, 2.0, 0.0, 0.0])
    Q = np.array(motion.standing_noise(2.0, 0.5))
    assert Q[0] == pytest.approx([0.25 * 4.0, 0.0, 0.25 * 2.0, 0.0])  # the place moves by velocity times dt
    assert Q[3] == pytest.approx([0.0, 0.25 * 2.0, 0.0, 0.25])


# --- direction of arrival ---

SENSORS = np.array([[0.0, 0.0], [50.0, 0.0], [-20.0, 80.0]])


def test_measure_is_the_bearing_from_each_sensor():
    state = np.array([30.0, 40.0, 1.0, 2.0])
    expected = [bearing(30.0 - x, 40.0 - y) for x, y in SENSORS]
    assert doa.measure(state, SENSORS) == pytest.approx(expected, rel=1e-15)


def test_jacobian_is_the_slope_of_measure():
    rng = np.random.default_rng(1)
    states, h = rng.normal(0.0, 60.0, (200, 4)), 1e-5
    slopes = doa.jacobian(states, SENSORS)
    for i, unit in enumerate(np.eye(4)):
        rise = wrap(doa.measure(states + h * unit, SENSORS) - doa.measure(states - h * unit, SENSORS))
        assert slopes[..., i] == pytest.approx(rise / (2.0 * h), rel=1e-5, abs=1e-9)


def test_batches_are_their_parts():
    states = np.random.default_rng(2).normal(0.0, 60.0, (3, 5, 4))
    assert doa.measure(states, SENSORS).shape == (3, 5, 3)
    assert doa.jacobian(states, SENSORS).shape == (3, 5, 3, 4)
    assert np.array_equal(doa.measure(states, SENSORS)[1, 2], doa.measure(states[1, 2], SENSORS))
    assert np.array_equal(doa.jacobian(states, SENSORS)[1, 2], doa.jacobian(states[1, 2], SENSORS))


def test_no_sensor_and_on_top_of_one():
    state = np.array([50.0, 0.0, 1.0, 1.0])
    assert doa.measure(state, np.empty((0, 2))).shape == (0,)
    assert doa.jacobian(state, np.empty((0, 2))).shape == (0, 4)
    assert np.isfinite(doa.jacobian(state, SENSORS)).all()


def test_what_nodes_use_loads_no_numpy():
    code = "import sys, trackfield.models.sound, trackfield.models.motion; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
