"""Interacting models against what is known exactly: one model, models that never switch or are alike."""

import numpy as np
import pytest

from tests import kalman
from trackfield.filters import imm, ukf
from trackfield.filters.gaussian import collapse
from trackfield.filters.types import Gaussian

H = np.eye(2, 4)
PRIOR = Gaussian(np.array([0.0, 0.0, 1.0, -1.0]), np.diag([25.0, 25.0, 4.0, 4.0]))


def run(accelerations, switching, measurements, start=None):
    """The bank after linear measurements (T, 2) of unit noise."""
    m = len(accelerations)
    bank = imm.Bank(
        np.full(m, 1.0 / m) if start is None else start,
        np.tile(PRIOR.mean, (m, 1)),
        np.tile(PRIOR.covariance, (m, 1, 1)),
    )
    for z in measurements:
        mixed = imm.mix(bank, np.asarray(switching))
        ahead = [
            kalman.predict(Gaussian(x, P), 1.0, a)
            for x, P, a in zip(mixed.mean, mixed.covariance, accelerations, strict=True)
        ]
        belief = Gaussian(np.stack([g.mean for g in ahead]), np.stack([g.covariance for g in ahead]))
        posterior, log_evidence = ukf.update(belief, z, 1.0, lambda x: x @ H.T)
        bank = imm.Bank(imm.reweigh(mixed.probability, log_evidence), *posterior)
    return bank


def exact(acceleration, measurements):
    belief, log_evidence = PRIOR, 0.0
    for z in measurements:
        mean, covariance, gained = kalman.update(kalman.predict(belief, 1.0, acceleration), z, H, np.eye(2))
        belief, log_evidence = Gaussian(mean, covariance), log_evidence + gained
    return belief, log_evidence


def wandering(seed, n=30):
    return np.cumsum(np.random.default_rng(seed).normal(0.0, 2.0, (n, 2)), axis=0)


@pytest.mark.parametrize("seed", range(5))
def test_one_model_is_a_kalman_filter(seed):
    bank = run([0.4], [[1.0]], wandering(seed))
    belief, _ = exact(0.4, wandering(seed))
    assert imm.combined(bank).mean == pytest.approx(belief.mean)
    assert imm.combined(bank).covariance == pytest.approx(belief.covariance)
    assert bank.probability == pytest.approx([1.0])


@pytest.mark.parametrize("seed", range(5))
def test_models_that_never_switch_are_averaged_by_their_evidence(seed):
    accelerations = [0.1, 0.8, 2.0]
    bank = run(accelerations, np.eye(3), wandering(seed))
    beliefs, evidence = zip(*(exact(a, wandering(seed)) for a in accelerations), strict=True)
    share = np.exp(np.array(evidence) - max(evidence))
    share /= share.sum()
    assert bank.probability == pytest.approx(share, rel=1e-6)
    means, covariances = zip(*beliefs, strict=True)
    average = collapse(share, np.stack(means), np.stack(covariances))
    assert imm.combined(bank).mean == pytest.approx(average.mean)
    assert imm.combined(bank).covariance == pytest.approx(average.covariance)


def test_models_that_are_alike_are_one_however_they_switch():
    bank = run([0.5, 0.5], [[0.7, 0.3], [0.2, 0.8]], wandering(1))
    belief, _ = exact(0.5, wandering(1))
    assert imm.combined(bank).mean == pytest.approx(belief.mean)
    assert imm.combined(bank).covariance == pytest.approx(belief.covariance)
    assert bank.probability == pytest.approx([0.4, 0.6], abs=1e-6)  # the chain's own long run


def test_mixing_by_hand():
    bank = imm.Bank(np.array([0.6, 0.4]), np.array([[0.0], [10.0]]), np.array([[[1.0]], [[4.0]]]))
    mixed = imm.mix(bank, np.array([[0.9, 0.1], [0.5, 0.5]]))
    assert mixed.probability == pytest.approx([0.74, 0.26])
    first, second = 0.2 / 0.74, 0.2 / 0.26  # shares that come from the second model
    assert mixed.mean[:, 0] == pytest.approx([10.0 * first, 10.0 * second])
    spread = [(1 - s) * 1.0 + s * 4.0 + s * (1 - s) * 100.0 for s in (first, second)]
    assert mixed.covariance[:, 0, 0] == pytest.approx(spread)


def test_a_manoeuvre_wakes_its_model_until_it_is_over():
    still, away = np.zeros((20, 2)), 10.0 * np.stack((np.zeros(20), np.arange(1.0, 21.0)), axis=-1)
    switching = [[0.95, 0.05], [0.1, 0.9]]
    track = np.concatenate((still, away))
    manoeuvring = [run([0.05, 3.0], switching, track[:n]).probability[1] for n in (20, 21, 40)]
    assert manoeuvring[0] < 0.3
    assert manoeuvring[1] > 0.9
    assert manoeuvring[2] < 0.3


def test_an_impossible_model_stays_impossible_and_harmless():
    bank = run([0.4, 2.0], np.eye(2), wandering(2), start=np.array([1.0, 0.0]))
    belief, _ = exact(0.4, wandering(2))
    assert bank.probability.tolist() == [1.0, 0.0]
    assert imm.combined(bank).mean == pytest.approx(belief.mean)


def test_a_batch_is_its_parts():
    rng = np.random.default_rng(6)
    A = rng.normal(size=(5, 3, 4, 4))
    bank = imm.Bank(rng.dirichlet(np.ones(3), 5), rng.normal(size=(5, 3, 4)), A @ np.swapaxes(A, -1, -2))
    switching = rng.dirichlet(np.ones(3), 3)
    together = imm.mix(bank, switching)
    one = imm.mix(imm.Bank(*(part[2] for part in bank)), switching)
    for whole, part in zip(together, one, strict=True):
        assert whole[2] == pytest.approx(part)
    assert imm.combined(bank).covariance[2] == pytest.approx(
        imm.combined(imm.Bank(*(part[2] for part in bank))).covariance
    )
