"""The smoother against the joint Gaussian of all states, and at its edges."""

import numpy as np
import pytest

from tests import kalman
from trackfield.filters import rts
from trackfield.filters.gaussian import Motion, constant_velocity
from trackfield.filters.types import Gaussian
from trackfield.models import motion

H, NOISE, DT, SIGMA_V = np.eye(2, 4), 2.0, 1.5, 0.4
STEP = constant_velocity(DT, SIGMA_V)
PRIOR = Gaussian(np.array([3.0, -2.0, 1.0, 0.5]), np.diag([9.0, 9.0, 1.0, 1.0]))


def filtered(prior, measurements, heard=None):
    """Kalman's beliefs (T, 4) at the times of ``measurements`` (T, 2); those not ``heard`` are predicted."""
    beliefs, belief = [], prior
    for t, z in enumerate(measurements):
        belief = kalman.predict(belief, DT, SIGMA_V) if t else belief
        if heard is None or heard[t]:
            belief = Gaussian(*kalman.update(belief, z, H, NOISE**2 * np.eye(2))[:2])
        beliefs.append(belief)
    return Gaussian(np.stack([b.mean for b in beliefs]), np.stack([b.covariance for b in beliefs]))


def jointly(prior, measurements, heard=None):
    """All states at once: linear in the start and the accelerations, whose posterior is one Kalman update."""
    n = len(measurements)
    F, gain = np.array(motion.transition(DT)), np.array(motion.noise_gain(DT))
    states = [np.eye(4, 4 + 2 * (n - 1))]
    for t in range(1, n):
        states.append(F @ states[-1])
        states[-1][:, 2 + 2 * t : 4 + 2 * t] += gain
    A = np.concatenate(states)
    unknown = Gaussian(np.append(prior.mean, np.zeros(2 * (n - 1))), np.diag(np.full(4 + 2 * (n - 1), SIGMA_V**2)))
    unknown.covariance[:4, :4] = prior.covariance
    rows = np.repeat(np.ones(n, bool) if heard is None else heard, 2)
    HA = (np.kron(np.eye(n), H) @ A)[rows]
    exact = kalman.update(unknown, measurements.reshape(-1)[rows], HA, NOISE**2 * np.eye(len(HA)))
    P = A @ exact.covariance @ A.T
    return (A @ exact.mean).reshape(n, 4), np.stack([P[4 * t : 4 * t + 4, 4 * t : 4 * t + 4] for t in range(n)])


def wandering(seed, n=25):
    return np.cumsum(np.random.default_rng(seed).normal(0.0, 2.0, (n, 2)), axis=0)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_joint_gaussians_mean_and_covariance(seed):
    z = wandering(seed)
    heard = np.random.default_rng(seed).random(len(z)) < 0.6
    mean, covariance = jointly(PRIOR, z, heard)
    smoothed = rts.smooth(filtered(PRIOR, z, heard), STEP)
    assert smoothed.mean == pytest.approx(mean)
    assert smoothed.covariance == pytest.approx(covariance, abs=1e-9)


@pytest.mark.parametrize("P", [np.zeros((4, 4)), np.diag([4.0, 0.0, 1.0, 0.0])])
def test_a_certain_start_stays_and_the_singular_predictions_after_it_are_no_harm(P):
    z = wandering(7)
    mean, covariance = jointly(Gaussian(PRIOR.mean, P), z)
    smoothed = rts.smooth(filtered(Gaussian(PRIOR.mean, P), z), STEP)
    assert smoothed.mean == pytest.approx(mean, abs=1e-6)
    assert smoothed.covariance == pytest.approx(covariance, abs=1e-6)
    assert smoothed.mean[0, 3] == pytest.approx(PRIOR.mean[3])


def test_without_noise_the_last_belief_is_led_back():
    still = Motion(STEP.F, np.zeros((4, 4)))
    last = Gaussian(np.array([5.0, 6.0, 1.0, 2.0]), np.diag([1.0, 2.0, 0.1, 0.2]))
    back = np.linalg.inv(STEP.F)
    beliefs = Gaussian(np.stack((np.zeros(4), last.mean)), np.stack((np.diag([1e4, 1e4, 1e2, 1e2]), last.covariance)))
    smoothed = rts.smooth(beliefs, still)
    assert smoothed.mean[0] == pytest.approx(back @ last.mean)
    assert smoothed.covariance[0] == pytest.approx(back @ last.covariance @ back.T)


def test_motions_may_differ_from_step_to_step():
    """Smoothed back in two calls, each with its own motion, or in one: the same."""
    beliefs = filtered(PRIOR, wandering(2, 3))
    motions = [constant_velocity(dt, SIGMA_V) for dt in (DT, 3.0 * DT)]
    smoothed = rts.smooth(beliefs, Motion(*(np.stack(parts) for parts in zip(*motions, strict=True))))
    later = rts.smooth(Gaussian(beliefs.mean[1:], beliefs.covariance[1:]), motions[1])
    assert smoothed.mean[1] == pytest.approx(later.mean[0])
    first = rts.smooth(Gaussian(*(np.stack((a[0], b[0])) for a, b in zip(beliefs, later, strict=True))), motions[0])
    assert smoothed.mean[0] == pytest.approx(first.mean[0])
    assert smoothed.covariance[0] == pytest.approx(first.covariance[0])


def test_one_belief_alone_is_left_as_it_is():
    beliefs = filtered(PRIOR, wandering(0, 1))
    assert np.array_equal(rts.smooth(beliefs, STEP).mean, beliefs.mean)


def test_a_batch_is_its_parts_and_nobody_writes_into_the_beliefs():
    parts = [filtered(PRIOR, wandering(seed, 6)) for seed in range(3)]
    whole = Gaussian(np.stack([p.mean for p in parts]), np.stack([p.covariance for p in parts]))
    for array in whole:
        array.flags.writeable = False
    together = rts.smooth(whole, STEP)
    for i, part in enumerate(parts):
        alone = rts.smooth(part, STEP)
        assert together.mean[i] == pytest.approx(alone.mean, rel=1e-12)
        assert together.covariance[i] == pytest.approx(alone.covariance, rel=1e-12, abs=1e-12)
