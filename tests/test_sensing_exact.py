"""Unknowns and noise that depends on the state, against exact answers: textbook filters, densities, information."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pytest
from scipy.stats import norm

from tests.stranger import Strength
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.gaussian import Motion
from trackfield.filters.measurement import (
    extended,
    jacobians,
    log_likelihood,
    noise_sd,
    sensing_information,
)
from trackfield.filters.single_model import Ekf, Ukf
from trackfield.filters.types import Array, Gaussian, Model, Readings, Reports
from trackfield.models import motion
from trackfield.models.unknowns import Unknown
from trackfield.sensing.complete import Kind
from trackfield.tracking.following import Following

PLACES: Final = np.array([[0.0, 0.0], [60.0, 10.0], [-20.0, 80.0], [90.0, 90.0]])


def reports(values: Array, step: int = 1, kind: str = "one") -> Reports:
    """These readings (4,) of sensors at ``PLACES``."""
    return Reports(step, tuple("abcd"), PLACES, (Readings(kind, values[:, None]),))


# --- a linear kind ---

WALK: Final = Unknown("offset", sd=3.0, walk_sd=0.4, mean=2.0)
SLOPES: Final = np.array([[0.8, 0.6], [-0.6, 0.8], [1.0, 0.0], [0.0, 1.0]])
SD: Final = 0.7


@dataclass(frozen=True)
class Linear:
    """Each sensor tells how far the target is along a direction of its own, all with the same offset."""

    range_m: float = 1000.0

    sd = (SD,)
    resolution = (0.001,)
    unknowns = (WALK,)

    def simulate(self, scene: Any, t_ns: int, place: Any, normals: Any) -> None:
        return None

    def h(self, x: Array, at: Array) -> Array:
        return ((x[..., None, :2] - at) * SLOPES[: len(at)]).sum(axis=-1, keepdims=True) + x[..., None, 4:]

    def jacobian(self, x: Array, at: Array) -> Array:
        slopes = np.zeros((len(at), 1, 5))
        slopes[:, 0, :2], slopes[:, 0, 4] = SLOPES[: len(at)], 1.0
        return np.broadcast_to(slopes, (*x.shape[:-1], len(at), 1, 5))


LINEAR: Final = Model({"one": Kind("one", Linear())}, sigma_v=0.3)
PRIOR: Final = Gaussian(np.array([5.0, -3.0, 1.0, 2.0]), np.diag([4.0, 5.0, 1.0, 1.5]) ** 2)


def textbook(steps: list[Reports], dt: float, prior: Gaussian = PRIOR) -> list[Gaussian]:
    """The Kalman filter of the state with the offset as a fifth number, written out (Kalman 1960)."""
    F, Q = np.eye(5), np.zeros((5, 5))
    F[:4, :4], Q[:4, :4] = motion.transition(dt), motion.process_noise(dt, 0.3)
    Q[4, 4] = 0.4**2 * dt
    H, R = np.hstack((SLOPES, np.zeros((4, 2)), np.ones((4, 1)))), SD**2 * np.eye(4)
    x, P = np.append(prior.mean, 2.0), np.zeros((5, 5))
    P[:4, :4], P[4, 4] = prior.covariance, 9.0
    found = []
    for one in steps:
        x, P = F @ x, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (one.values[:, 0] + (PLACES * SLOPES).sum(axis=1) - H @ x), (np.eye(5) - K @ H) @ P
        found.append(Gaussian(x, P))
    return found


STEPS: Final = [reports(np.random.default_rng(k).normal(0.0, 20.0, 4), k) for k in range(1, 9)]


@pytest.mark.parametrize("tracker", [Ekf(), Ukf()])
def test_with_a_linear_kind_they_are_the_textbooks_filter(tracker: Any) -> None:
    following = Following(tracker, LINEAR)
    state, rng = following.begin(PRIOR), np.random.default_rng(0)
    for one, exact in zip(STEPS, textbook(STEPS, 0.5), strict=True):
        state, estimate = following.step(state, one, 0.5, rng)
        assert estimate is not None
        assert estimate.mean == pytest.approx(exact.mean, rel=1e-9, abs=1e-9)
        assert estimate.covariance == pytest.approx(exact.covariance, rel=1e-9, abs=1e-9)


def test_particles_agree_within_their_monte_carlo_error() -> None:
    """One step from a prior of 1 m, so that thousands of 20,000 particles count, in 40 filters.

    Their mean is within 4.5 standard errors, of the spread between them: a failure has a probability of 7e-6 a number.
    """
    prior = Gaussian(PRIOR.mean, PRIOR.covariance / 16.0)
    expected = LINEAR.sensor.h(np.append(PRIOR.mean, WALK.mean), PLACES)[:, 0]
    one = [reports(expected + np.array([1.0, 2.0, 1.5, -0.5]))]
    (exact,) = textbook(one, 0.5, prior)
    following = Following(Bootstrap(n=20_000), LINEAR)
    found = [following.step(following.begin(prior), one[0], 0.5, np.random.default_rng(seed))[1] for seed in range(40)]
    means, covariances = (np.array([getattr(e, part) for e in found]) for part in ("mean", "covariance"))
    for values, right in ((means, exact.mean), (covariances, exact.covariance)):
        assert np.ptp(values, axis=0).max() > 0.0
        assert (np.abs(values.mean(axis=0) - right) < 4.5 * values.std(axis=0, ddof=1) / np.sqrt(40)).all()


def test_an_unknown_is_foreseen_as_a_random_walk() -> None:
    """Without reports its variance grows by walk_sd^2 a second, and nothing else changes it."""
    for tracker in (Ekf(), Ukf(), Bootstrap(n=100_000)):
        following: Any = Following(tracker, LINEAR)
        state, rng = following.begin(PRIOR), np.random.default_rng(3)
        nothing = Reports(1, (), np.empty((0, 2)), (Readings("one", np.empty((0, 1))),))
        for _ in range(10):
            state, estimate = following.step(state, nothing, 2.5, rng)
        near = 1e-9 if not isinstance(tracker, Bootstrap) else 0.02
        assert estimate.mean[4] == pytest.approx(2.0, rel=near)
        assert estimate.covariance[4, 4] == pytest.approx(9.0 + 0.4**2 * 25.0, rel=near)
        ahead: Motion = following.tracker.motion(state.track, state.track, 2.5)
        assert (ahead.F[4, 4], ahead.Q[4, 4]) == (1.0, pytest.approx(0.4**2 * 2.5))


# --- noise that depends on the state ---

STRONG: Final = Model({"one": Kind("one", Strength())})
STATE: Final = np.array([30.0, 25.0, 3.0, -2.0, 21.0])
HEARD: Final = reports(np.array([-10.0, -12.5, -14.0, -19.0]))


def test_the_density_is_that_of_independent_normals() -> None:
    states = STATE + np.random.default_rng(1).normal(0.0, 5.0, (7, 5))
    away = np.sqrt(np.square(states[:, None, :2] - PLACES).sum(axis=-1) + 15.0**2)
    sd = np.sqrt(1.0 + np.square(away / 40.0))
    exact = norm.logpdf(HEARD.values[:, 0], states[:, 4:] - 20.0 * np.log10(away), sd).sum(axis=1)
    found = log_likelihood(STRONG, states, HEARD)
    assert found - found[0] == pytest.approx(exact - exact[0], abs=1e-9)  # up to a constant
    assert np.ptp(exact) > 1.0


def test_slopes_are_those_of_differences() -> None:
    kind, step = STRONG.sensor, 1e-5
    moved = STATE + step * np.stack((np.eye(5), -np.eye(5)))
    up, down = (kind.h(these, PLACES)[..., 0] for these in moved)
    assert jacobians(STRONG, STATE, HEARD) == pytest.approx(((up - down) / (2.0 * step)).T, abs=1e-8)


def test_the_information_is_the_mean_of_the_scores_outer_product() -> None:
    """By its definition (Kay 1993, eq. 3.20), each reading's mean by Gauss-Hermite quadrature over its density."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    weights = weights / weights.sum()
    step, sd, D = 1e-4, noise_sd(STRONG, HEARD, STATE), np.zeros((5, 5))
    for k, place in enumerate(PLACES):

        def log_density(x: Array, z: Array, place: Array = place) -> Array:
            away = np.hypot(np.hypot(*(x[:2] - place)), 15.0)
            found: Array = norm.logpdf(z, x[4] - 20.0 * np.log10(away), np.hypot(1.0, away / 40.0))
            return found

        z = STRONG.sensor.h(STATE, place[None])[0, 0] + sd[k] * nodes
        around = step * np.eye(5)
        scores = [(log_density(STATE + e, z) - log_density(STATE - e, z)) / (2.0 * step) for e in around]
        D += np.einsum("an,bn,n->ab", scores, scores, weights)
    found = sensing_information(STRONG, STATE, HEARD)
    assert found == pytest.approx(D, rel=1e-5, abs=1e-9)
    H = jacobians(STRONG, STATE, HEARD) / sd[:, None]
    assert not np.allclose(found, H.T @ H, rtol=1e-2)  # what the noise alone tells about the distance counts


def test_beliefs_are_widened_by_what_is_known_at_the_start() -> None:
    belief = extended(PRIOR, STRONG.unknowns)
    (power,) = Strength.unknowns
    assert belief.mean[4] == power.mean
    assert belief.covariance[4].tolist() == [0.0, 0.0, 0.0, 0.0, power.sd**2]
    assert (belief.covariance[:4, :4] == PRIOR.covariance).all()
    assert extended(belief, STRONG.unknowns) is belief
