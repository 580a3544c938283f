"""The unscented update: Kalman's in the linear case, right about angles, sound with a singular prior."""

import numpy as np
import pytest

from tests import kalman
from trackfield.filters import ukf
from trackfield.filters.types import Gaussian
from trackfield.models import doa
from trackfield.models.sound import wrap


def belief(rng, n=4, batch=()):
    A = rng.normal(0.0, 2.0, (*batch, n, n))
    return Gaussian(rng.normal(0.0, 5.0, (*batch, n)), A @ np.swapaxes(A, -1, -2) + 0.1 * np.eye(n))


def test_sigma_points_have_the_moments_of_the_belief():
    prior = belief(np.random.default_rng(0))
    points, weights = ukf.sigma_points(prior)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ points == pytest.approx(prior.mean)
    assert np.cov(points.T, aweights=weights, bias=True) == pytest.approx(prior.covariance)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("n", "k"), [(4, 1), (4, 3), (2, 7), (6, 2)])
def test_linear_case_is_kalmans_mean_covariance_and_evidence(seed, n, k):
    rng = np.random.default_rng(seed)
    prior, H, sd = belief(rng, n), rng.normal(size=(k, n)), rng.uniform(0.1, 2.0, k)
    z = rng.normal(0.0, 5.0, k)
    posterior, log_evidence = ukf.update(prior, z, sd, lambda x: x @ H.T)
    exact = kalman.update(prior, z, H, np.diag(sd**2))
    assert posterior.mean == pytest.approx(exact.mean)
    assert posterior.covariance == pytest.approx(exact.covariance, abs=1e-9)
    assert log_evidence == pytest.approx(exact.log_evidence)


@pytest.mark.parametrize("seed", range(4))
def test_a_track_of_many_steps_stays_on_kalmans(seed):
    rng = np.random.default_rng(seed)
    H, exact = np.eye(2, 4), Gaussian(np.zeros(4), np.diag([100.0, 100.0, 9.0, 9.0]))
    ours, evidence, exact_evidence = exact, 0.0, 0.0
    for _ in range(50):
        z = rng.normal(0.0, 10.0, 2)
        result = kalman.update(kalman.predict(exact, 1.0, 0.3), z, H, 4.0 * np.eye(2))
        exact, exact_evidence = Gaussian(result.mean, result.covariance), exact_evidence + result.log_evidence
        ours, log_evidence = ukf.update(kalman.predict(ours, 1.0, 0.3), z, 2.0, lambda x: x @ H.T)
        evidence += log_evidence
    assert ours.mean == pytest.approx(exact.mean)
    assert ours.covariance == pytest.approx(exact.covariance)
    assert evidence == pytest.approx(exact_evidence)


SENSORS = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]])


def bearings_update(prior, z, sensors=SENSORS):
    return ukf.update(prior, z, 0.05, lambda x: doa.measure(x, sensors), wrap)


def test_a_batch_is_its_parts():
    rng = np.random.default_rng(1)
    prior = belief(rng, 4, (2, 3))
    z = rng.normal(size=3)
    together = bearings_update(prior, z)
    for i in np.ndindex(2, 3):
        (mean, covariance), log_evidence = bearings_update(Gaussian(prior.mean[i], prior.covariance[i]), z)
        assert together.posterior.mean[i] == pytest.approx(mean, rel=1e-12)
        assert together.posterior.covariance[i] == pytest.approx(covariance, rel=1e-9, abs=1e-9)
        assert together.log_evidence[i] == pytest.approx(float(log_evidence), rel=1e-12)


def test_turning_the_world_across_the_cut_of_the_angle_changes_nothing():
    """South of its sensor a target's bearing jumps from pi to -pi: the update must not notice."""
    P = np.diag([9.0, 4.0, 1.0, 1.0])
    north = bearings_update(Gaussian(np.array([1.0, 40.0, 0.0, 0.0]), P), np.array([-0.02]), np.zeros((1, 2)))
    bearing = wrap(np.array([np.pi - 0.02]))
    south = bearings_update(Gaussian(np.array([-1.0, -40.0, 0.0, 0.0]), P), bearing, np.zeros((1, 2)))
    assert south.posterior.mean == pytest.approx(-north.posterior.mean)
    assert south.posterior.covariance == pytest.approx(north.posterior.covariance)
    assert south.log_evidence == pytest.approx(float(north.log_evidence))


def test_one_bearing_narrows_across_and_not_along():
    prior = Gaussian(np.array([0.0, 100.0, 0.0, 0.0]), np.diag([100.0, 100.0, 1.0, 1.0]))
    P = bearings_update(prior, np.array([0.0]), np.zeros((1, 2))).posterior.covariance
    assert P[0, 0] < 0.3 * prior.covariance[0, 0]  # sd 5 m across: 0.05 rad at 100 m
    assert P[1, 1] > 0.9 * prior.covariance[1, 1]


@pytest.mark.parametrize("P", [np.zeros((4, 4)), np.diag([1.0, 0.0, 0.0, 0.0]), np.full((4, 4), 2.0)])
def test_a_singular_prior_stays_where_it_has_no_extent(P):
    prior = Gaussian(np.array([20.0, 30.0, 0.0, 0.0]), P)
    posterior, log_evidence = bearings_update(prior, doa.measure(prior.mean, SENSORS) + 0.02)
    assert np.isfinite(log_evidence)
    off = np.eye(4) - P @ np.linalg.pinv(P)
    assert off @ (posterior.mean - prior.mean) == pytest.approx(np.zeros(4), abs=1e-9)
    assert np.linalg.eigvalsh(posterior.covariance).min() >= -1e-12


@pytest.mark.parametrize("seed", range(5))
def test_covariance_never_loses_its_sign(seed):
    rng, state = np.random.default_rng(seed), Gaussian(np.array([1e3, 1e3, 5.0, 5.0]), 1e8 * np.eye(4))
    for _ in range(60):
        state, _ = bearings_update(kalman.predict(state, 1.0, 0.01), rng.uniform(-np.pi, np.pi, 3))
        assert np.array_equal(state.covariance, state.covariance.T)
        assert np.linalg.eigvalsh(state.covariance).min() > 0.0
