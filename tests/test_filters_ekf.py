"""The extended update: Kalman's in the linear case, right about angles, sound with a singular prior."""

import numpy as np
import pytest

from tests import kalman
from trackfield.filters import ekf, ukf
from trackfield.filters.types import Gaussian
from trackfield.models import doa
from trackfield.models.sound import wrap

SENSORS = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]])


def belief(rng, n=4, batch=()):
    A = rng.normal(0.0, 2.0, (*batch, n, n))
    return Gaussian(rng.normal(0.0, 5.0, (*batch, n)), A @ np.swapaxes(A, -1, -2) + 0.1 * np.eye(n))


def linear_update(prior, z, sd, H):
    return ekf.update(prior, z, sd, lambda x: x @ H.T, lambda _: H)


def bearings_update(prior, z, sensors=SENSORS, sd=0.05):
    return ekf.update(prior, z, sd, lambda x: doa.measure(x, sensors), lambda x: doa.jacobian(x, sensors), wrap)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("n", "k"), [(4, 1), (4, 3), (2, 7), (6, 2)])
def test_linear_case_is_kalmans_mean_covariance_and_evidence(seed, n, k):
    rng = np.random.default_rng(seed)
    prior, H, sd = belief(rng, n), rng.normal(size=(k, n)), rng.uniform(0.1, 2.0, k)
    z = rng.normal(0.0, 5.0, k)
    posterior, log_evidence = linear_update(prior, z, sd, H)
    exact = kalman.update(prior, z, H, np.diag(sd**2))
    assert posterior.mean == pytest.approx(exact.mean)
    assert posterior.covariance == pytest.approx(exact.covariance, abs=1e-9)
    assert log_evidence == pytest.approx(exact.log_evidence)


def test_a_bearing_is_taken_in_at_its_slope():
    """The textbook's filter with the slopes at the prior's mean, also for what is not linear."""
    prior = Gaussian(np.array([20.0, 30.0, 1.0, 2.0]), np.diag([9.0, 16.0, 1.0, 1.0]))
    z = doa.measure(prior.mean, SENSORS) + np.array([0.1, -0.05, 0.02])
    H = doa.jacobian(prior.mean, SENSORS)
    exact = kalman.update(prior, z - doa.measure(prior.mean, SENSORS) + H @ prior.mean, H, 0.05**2 * np.eye(3))
    posterior, log_evidence = bearings_update(prior, z)
    assert posterior.mean == pytest.approx(exact.mean)
    assert posterior.covariance == pytest.approx(exact.covariance)
    assert log_evidence == pytest.approx(exact.log_evidence)


def test_the_posterior_alone_is_that_of_the_update():
    prior, z = belief(np.random.default_rng(2)), np.array([0.1, -0.4, 1.0])
    measure, slopes = (lambda x: doa.measure(x, SENSORS)), (lambda x: doa.jacobian(x, SENSORS))
    pairs = (
        (ekf.posterior(prior, z, 0.05, measure, slopes, wrap), ekf.update(prior, z, 0.05, measure, slopes, wrap)),
        (ukf.posterior(prior, z, 0.05, measure, wrap), ukf.update(prior, z, 0.05, measure, wrap)),
    )
    for alone, whole in pairs:
        assert np.array_equal(alone.mean, whole.posterior.mean)
        assert np.array_equal(alone.covariance, whole.posterior.covariance)


@pytest.mark.parametrize("kernel", [ekf, ukf])
def test_a_batch_of_reports_of_different_number_is_its_parts(kernel):
    """Padded by measurements of infinite noise; each with sensors of its own."""
    rng = np.random.default_rng(1)
    prior, counts = belief(rng, 4, (3,)), [2, 4, 0]
    sensors, z = rng.uniform(-50.0, 50.0, (3, 4, 2)), rng.uniform(-3.0, 3.0, (3, 4))
    sd = np.where(np.arange(4) < np.array(counts)[:, None], 0.05, np.inf)

    def update(prior, z, sd, sensors):
        if kernel is ekf:
            return bearings_update(prior, z, sensors, sd)
        return ukf.update(prior, z, sd, lambda x: doa.measure(x, sensors[..., None, :, :]), wrap)

    together = update(prior, z, sd, sensors)
    for i, k in enumerate(counts):
        alone = update(Gaussian(prior.mean[i], prior.covariance[i]), z[i, :k], sd[i, :k], sensors[i, :k])
        assert together.posterior.mean[i] == pytest.approx(alone.posterior.mean, rel=1e-9)
        assert together.posterior.covariance[i] == pytest.approx(alone.posterior.covariance, rel=1e-9, abs=1e-9)
        assert together.log_evidence[i] == pytest.approx(float(alone.log_evidence), rel=1e-9)
    assert together.posterior.mean[2] == pytest.approx(prior.mean[2])
    assert together.log_evidence[2] == pytest.approx(0.0, abs=1e-9)


def test_turning_the_world_across_the_cut_of_the_angle_changes_nothing():
    """South of its sensor a target's bearing jumps from pi to -pi: the update must not notice."""
    P = np.diag([9.0, 4.0, 1.0, 1.0])
    north = bearings_update(Gaussian(np.array([1.0, 40.0, 0.0, 0.0]), P), np.array([-0.02]), np.zeros((1, 2)))
    bearing = wrap(np.array([np.pi - 0.02]))
    south = bearings_update(Gaussian(np.array([-1.0, -40.0, 0.0, 0.0]), P), bearing, np.zeros((1, 2)))
    assert south.posterior.mean == pytest.approx(-north.posterior.mean)
    assert south.posterior.covariance == pytest.approx(north.posterior.covariance)
    assert south.log_evidence == pytest.approx(float(north.log_evidence))


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
