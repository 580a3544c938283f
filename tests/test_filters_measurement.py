"""Reports of any sensor as one measurement vector: bearings as before, and sensors of two numbers a reading."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.sensing import model_of, reports_of, silence
from tests.zhai_field import MODEL, hear
from trackfield.filters import measurement
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.types import Gaussian
from trackfield.models import doa
from trackfield.models.doa import wrap

STATES = np.random.default_rng(1).normal((210.0, 140.0, 5.0, 5.0), (30.0, 30.0, 2.0, 2.0), (7, 4))
SENSORS = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]])


@dataclass(frozen=True)
class Offset:
    """Where the target is, east and north of the sensor: linear, with noise of 1 m and 2 m."""

    range_m: float = 1000.0
    sd: tuple[float, ...] = (1.0, 2.0)
    resolution: tuple[float, ...] = (0.1, 0.1)

    def simulate(self, target, position, normals):
        return target[0] - position[0] + normals[0], target[1] - position[1] + 2.0 * normals[1]

    def h(self, states, positions):
        return states[..., None, :2] - positions

    def jacobian(self, states, positions):
        return np.broadcast_to(np.eye(2, 4), (*states.shape[:-1], len(positions), 2, 4))

    def residual(self, difference):
        return difference


OWN = model_of(Offset())


def offsets(place, noise=0.0):
    """What three sensors of offsets read of a target at ``place`` (2,)."""
    return reports_of(SENSORS, np.asarray(place) - SENSORS + noise)


def test_bearings_are_what_they_were():
    heard = hear(np.array([210.0, 140.0]), np.random.default_rng(0))
    assert len(heard) > 2
    assert (measurement.measured(MODEL, heard) == heard.bearings).all()
    assert (measurement.noise_sd(MODEL, heard) == MODEL.sigma_w).all()
    assert (measurement.expected(MODEL, STATES, heard) == doa.measure(STATES, heard.positions)).all()
    assert (measurement.jacobians(MODEL, STATES, heard) == doa.jacobian(STATES, heard.positions)).all()
    misses = wrap(heard.bearings - doa.measure(STATES, heard.positions))
    assert (measurement.innovations(MODEL, STATES, heard) == misses).all()
    by_hand = -0.5 * np.square(misses / MODEL.sigma_w).sum(axis=-1)
    assert measurement.log_likelihood(MODEL, STATES, heard) == pytest.approx(by_hand, rel=1e-12)


def test_two_numbers_a_reading_lie_sensor_by_sensor():
    z = measurement.measured(OWN, offsets([10.0, 20.0]))
    assert z.tolist() == [10.0, 20.0, -90.0, 20.0, 10.0, -80.0]
    assert measurement.noise_sd(OWN, offsets([0.0, 0.0])).tolist() == [1.0, 2.0] * 3
    state = np.array([11.0, 18.0, 0.0, 0.0])
    assert measurement.innovations(OWN, state, offsets([10.0, 20.0])).tolist() == [-1.0, 2.0] * 3
    H = measurement.jacobians(OWN, STATES, offsets([10.0, 20.0]))
    assert H.shape == (7, 6, 4)
    assert (H[3, 2:4] == np.eye(2, 4)).all()
    assert measurement.log_likelihood(OWN, state, offsets([10.0, 20.0])) == pytest.approx(-0.5 * 3 * (1 + 1))


def test_some_of_the_reports_keep_their_readings():
    some = offsets([10.0, 20.0]).only(np.array([0, 2]))
    assert some.sensors == ("n0", "n2")
    assert some.values.tolist() == [[10.0, 20.0], [10.0, -80.0]]


@pytest.mark.parametrize(
    ("model", "nothing"), [(MODEL, silence()), (OWN, reports_of(np.empty((0, 2)), np.empty((0, 2))))]
)
def test_no_reports_are_an_empty_vector(model, nothing):
    assert measurement.innovations(model, STATES, nothing).shape == (7, 0)
    assert measurement.jacobians(model, STATES, nothing).shape == (7, 0, 4)
    assert (measurement.log_likelihood(model, STATES, nothing) == 0.0).all()


def test_bootstrap_takes_any_sensor():
    """Three readings of a linear sensor: the particles' mean is Bayes', to within a tenth of the posterior's sd."""
    prior = Gaussian(np.array([0.0, 0.0, 0.0, 0.0]), np.diag([4.0, 4.0, 1e-6, 1e-6]))
    tracker = Bootstrap(n=40_000)
    z = offsets([3.0, -2.0])
    _, estimate = tracker.step(tracker.init(prior, OWN), z, 1e-3, np.random.default_rng(0))
    exact = np.array([4.0, 4.0]) / (np.array([4.0, 4.0]) + np.array([1.0, 4.0]) / 3.0) * np.array([3.0, -2.0])
    assert estimate.mean[:2] == pytest.approx(exact, abs=0.05)
