"""Particle filters against Kalman where bearings are linear; the bank of EKFs against the paper."""

import numpy as np
import pytest
from scipy.stats import norm

from tests import kalman
from tests.sensing import bearings_model
from tests.zhai_field import MODEL, hear
from trackfield.filters import sp_pekf
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.fix_doa import FixDoa
from trackfield.filters.gaussian import collapse
from trackfield.filters.measurement import intensity_weights, log_likelihood
from trackfield.filters.particles import draw, propagate
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.types import Gaussian
from trackfield.models import doa, motion
from trackfield.models.sound import wrap

NOISE = 2.0  # m, of the linear measurements
LINEAR = bearings_model(NOISE / kalman.FAR, sigma_v=0.5)
PRIOR = Gaussian(np.array([3.0, -2.0, 1.0, 0.5]), np.diag([9.0, 9.0, 1.0, 1.0]))


def exact_and_theirs(tracker, seed, steps=6):
    """Kalman's and the tracker's last estimate after the same linear measurements."""
    rng = np.random.default_rng(seed)
    exact, state = PRIOR, tracker.init(PRIOR, LINEAR)
    for step in range(steps):
        z = np.array([3.0 + step, -2.0 + 0.5 * step]) + NOISE * rng.normal(size=2)
        exact = kalman.predict(exact, 1.0, LINEAR.sigma_v)
        exact = Gaussian(*kalman.update(exact, z, np.eye(2, 4), NOISE**2 * np.eye(2))[:2])
        state, estimate = tracker.step(state, kalman.far_reports(z), 1.0, rng)
    return exact, estimate


@pytest.mark.parametrize(
    "tracker",
    [
        Bootstrap(n=20_000),
        Bootstrap(n=20_000, resampling="residual", ess_share=0.5),
        SpCpf(particles=20_000, nominals=50, weights="gaussian-prior"),
        FixDoa(particles=20_000, sigma_v=LINEAR.sigma_v),
    ],
)
def test_linear_case_is_kalmans(tracker):
    """Over several seeds mean and covariance scatter as 20,000 particles do (1/sqrt(n) = 0.007), no more."""
    means, covariances = [], []
    for seed in range(8):
        exact, estimate = exact_and_theirs(tracker, seed)
        sd = np.sqrt(np.diag(exact.covariance))
        means.append((estimate.mean - exact.mean) / sd)
        covariances.append((estimate.covariance - exact.covariance) / np.outer(sd, sd))
    for misses, scatter in ((np.array(means), 0.03), (np.array(covariances), 0.05)):
        assert np.sqrt(np.square(misses).mean()) < scatter
        assert np.abs(misses.mean(axis=0)).max() < scatter


def test_more_particles_come_nearer_to_kalman():
    def error(n):
        misses = [exact_and_theirs(Bootstrap(n=n), seed) for seed in range(12)]
        return np.sqrt(np.mean([np.square(e.mean - k.mean).mean() for k, e in misses]))

    assert error(6400) < 0.4 * error(100)  # 1 / sqrt(n) says 0.125


def test_particles_that_are_not_resampled_keep_their_weights():
    """A step of two halves of the noise's information, without a draw between: the weights of one."""
    halves, once = Bootstrap(n=50, ess_share=1e-9), Bootstrap(n=50)
    still = bearings_model(LINEAR.sigma_w * np.sqrt(2.0), sigma_v=0.0)
    reports = kalman.far_reports(np.array([5.0, 1.0]))
    state = halves.init(PRIOR, still)
    for _ in range(2):
        state, estimate = halves.step(state, reports, 0.0, np.random.default_rng(0))
    _, expected = once.step(once.init(PRIOR, bearings_model(LINEAR.sigma_w)), reports, 0.0, np.random.default_rng(0))
    assert estimate.mean == pytest.approx(expected.mean)
    assert estimate.covariance == pytest.approx(expected.covariance)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_step_without_reports_neither_draws_nor_weighs(share):
    tracker, none = Bootstrap(n=50, ess_share=share), kalman.far_reports(np.zeros(2)).only(np.array([], int))
    state, _ = tracker.step(tracker.init(PRIOR, LINEAR), kalman.far_reports(np.zeros(2)), 1.0, np.random.default_rng(0))
    after, _ = tracker.step(state, none, 0.0, np.random.default_rng(1))
    assert after.particles == pytest.approx(state.particles)
    assert after.weights is state.weights


def test_draws_have_the_moments_of_the_belief():
    P = np.array([[4.0, 3.0], [3.0, 9.0]])
    points = draw(Gaussian(np.array([1.0, -1.0]), P), 200_000, np.random.default_rng(0))
    assert points.mean(axis=0) == pytest.approx([1.0, -1.0], abs=0.03)
    assert np.cov(points.T) == pytest.approx(P, rel=0.02)
    flat = draw(Gaussian(np.array([1.0, 2.0]), np.diag([4.0, 0.0])), 100, np.random.default_rng(0))
    assert np.all(flat[:, 1] == 2.0)


def test_propagation_has_the_moments_of_the_motion_model():
    particles = np.tile([1.0, 2.0, 3.0, 4.0], (200_000, 1))
    moved = propagate(particles, 2.0, 0.5, np.random.default_rng(0))
    assert moved.mean(axis=0) == pytest.approx([7.0, 10.0, 3.0, 4.0], abs=0.01)
    assert np.cov(moved.T) == pytest.approx(np.array(motion.process_noise(2.0, 0.5)), abs=0.02)


def test_likelihood_is_of_all_bearings_and_wraps():
    heard = hear(np.array([220.0, 130.0]), np.random.default_rng(0))
    particles = np.random.default_rng(1).uniform(100.0, 300.0, (50, 4))
    by_hand = np.zeros(50)
    for bearing, sensor in zip(heard.bearings, heard.positions, strict=True):
        by_hand += norm.logpdf(wrap(bearing - doa.measure(particles, sensor[None])[:, 0]), scale=0.1)
    constant = by_hand - log_likelihood(bearings_model(0.1), particles, heard)
    assert constant == pytest.approx(np.full(50, constant[0]))


@pytest.mark.parametrize("seed", range(5))
def test_the_bank_of_ekfs_is_the_papers_equations(seed):
    """Every filter on its own, as eqs. 14-23 are written, then the weighted sum over sensors."""
    rng = np.random.default_rng(seed)
    dt, sigma_v, sigma_w = 1.0, 0.3, 0.05
    A = rng.normal(0.0, 3.0, (4, 4))
    R, nominals = A @ A.T, rng.normal([200.0, 130.0, 5.0, 6.0], [8.0, 8.0, 2.0, 2.0], (7, 4))
    noisy = propagate(nominals, dt, sigma_v, rng)
    heard = hear(np.array([205.0, 138.0]), rng)
    shares = intensity_weights(heard.levels)
    F, Q = np.array(motion.transition(dt)), np.array(motion.process_noise(dt, sigma_v))

    sensors_mean, sensors_cov, carried = [], [], np.zeros((4, 4))
    for k, share in enumerate(shares):
        means, covariances, likelihoods = [], [], []
        for x, x_noisy in zip(nominals, noisy, strict=True):
            residual = F @ x - x_noisy  # eq. 15: the nominal's noise with its sign turned
            H = doa.jacobian(x_noisy, heard.positions[k : k + 1])  # eq. 14
            ahead = F @ R @ F.T + Q  # eq. 18
            innovation = wrap(heard.bearings[k] - doa.measure(x_noisy + residual, heard.positions[k : k + 1]))
            S = H @ ahead @ H.T + sigma_w**2  # eq. 20
            G = ahead @ H.T / S  # eq. 17
            means.append(x_noisy + residual + G @ innovation)  # eq. 16
            covariances.append((np.eye(4) - G @ H) @ ahead)  # eq. 19
            likelihoods.append((S**-0.5 * np.exp(-0.5 * innovation**2 / S)).item())
        psi = np.array(likelihoods) / np.sum(likelihoods)  # eq. 22
        total = collapse(psi, np.array(means), np.array(covariances))  # eqs. 21, 23
        sensors_mean.append(total.mean)
        sensors_cov.append(total.covariance)
        carried += share * np.einsum("n,nij->ij", psi, np.array(covariances))
    expected = collapse(shares, np.array(sensors_mean), np.array(sensors_cov))

    fused = sp_pekf.advance(nominals @ F.T, noisy, R, heard, shares, bearings_model(sigma_w, sigma_v), dt)
    assert fused.proposal.mean == pytest.approx(expected.mean)
    assert fused.proposal.covariance == pytest.approx(expected.covariance)
    assert fused.carried == pytest.approx(carried, abs=1e-9)
    assert np.array_equal(fused.carried, fused.carried.T)


def test_with_one_sensor_both_weights_are_one():
    """A single bearing says nothing of range: paper weights would forget the prior's."""
    heard = hear(np.array([203.0, 104.0]), np.random.default_rng(3))
    nearest = heard.only(np.array([0]))
    prior = Gaussian(np.array([200.0, 110.0, 5.0, 5.0]), np.diag([16.0, 16.0, 1.0, 1.0]))
    estimates = []
    for weights in ("paper", "gaussian-prior"):
        tracker = SpCpf(weights=weights)
        rng = np.random.default_rng(0)
        state, _ = tracker.step(tracker.init(prior, MODEL), nearest, 1.0, rng)
        estimates.append(tracker.step(state, nearest, 1.0, rng)[1])
    assert np.array_equal(estimates[0].mean, estimates[1].mean)
    several = [
        SpCpf(weights=w).step(SpCpf().init(prior, MODEL), heard, 1.0, np.random.default_rng(0))[1]
        for w in ("paper", "gaussian-prior")
    ]
    assert len(heard) > 1
    assert not np.array_equal(several[0].mean, several[1].mean)


def test_covariance_has_extent_even_if_one_particle_holds_all_the_weight():
    prior = Gaussian(np.array([190.0, 90.0, 5.0, 5.0]), np.diag([400.0, 400.0, 16.0, 16.0]))
    heard = hear(np.array([203.0, 104.0]), np.random.default_rng(0), sigma_w=1e-5)
    start = SpCpf().init(prior, bearings_model(1e-5))
    _, estimate = SpCpf().step(start, heard, 1.0, np.random.default_rng(0))
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0.0
