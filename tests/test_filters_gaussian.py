"""Gaussian beliefs: prediction, moment matching, square roots of what is singular, densities."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tests import kalman
from trackfield.filters.gaussian import (
    collapse,
    constant_velocity,
    log_density,
    moments,
    predict,
    root,
    symmetric,
)
from trackfield.filters.types import Gaussian


def covariance(rng, n=4):
    A = rng.normal(0.0, 2.0, (n, n))
    return A @ A.T


@pytest.mark.parametrize("seed", range(5))
def test_prediction_is_kalmans_and_a_batch_is_its_parts(seed):
    rng = np.random.default_rng(seed)
    belief = Gaussian(rng.normal(size=(3, 4)), np.array([covariance(rng) for _ in range(3)]))
    ahead = predict(belief, constant_velocity(1.5, 0.7))
    for i in range(3):
        exact = kalman.predict(Gaussian(belief.mean[i], belief.covariance[i]), 1.5, 0.7)
        assert ahead.mean[i] == pytest.approx(exact.mean)
        assert ahead.covariance[i] == pytest.approx(exact.covariance)


def test_collapse_has_the_moments_of_the_mixture():
    rng = np.random.default_rng(3)
    weights, means = np.array([0.2, 0.5, 0.3]), rng.normal(0.0, 5.0, (3, 2))
    covariances = np.array([covariance(rng, 2) for _ in range(3)])
    one = collapse(weights, means, covariances)
    assert one.mean == pytest.approx(weights @ means)
    second = sum(w * (P + np.outer(m, m)) for w, m, P in zip(weights, means, covariances, strict=True))
    assert one.covariance == pytest.approx(second - np.outer(one.mean, one.mean))


def test_collapsing_groups_first_changes_nothing():
    rng = np.random.default_rng(4)
    weights, means = rng.dirichlet(np.ones(6)), rng.normal(size=(6, 2))
    covariances = np.array([covariance(rng, 2) for _ in range(6)])
    share = weights.reshape(2, 3).sum(axis=1)
    inner = collapse(weights.reshape(2, 3) / share[:, None], means.reshape(2, 3, 2), covariances.reshape(2, 3, 2, 2))
    nested, direct = collapse(share, *inner), collapse(weights, means, covariances)
    assert nested.mean == pytest.approx(direct.mean)
    assert nested.covariance == pytest.approx(direct.covariance)


def test_moments_of_weighted_points():
    points = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 8.0]])
    belief = moments(np.array([0.5, 0.25, 0.25]), points)
    assert belief.mean == pytest.approx([1.0, 2.0])
    assert belief.covariance == pytest.approx(np.array([[3.0, -2.0], [-2.0, 12.0]]))


@pytest.mark.parametrize(
    "P",
    [
        np.diag([4.0, 9.0]),
        np.array([[4.0, 2.0], [2.0, 1.0]]),
        np.diag([1.0, 0.0]),
        np.zeros((2, 2)),
        np.stack((np.eye(2), np.zeros((2, 2)))),
    ],
)
def test_root_squares_to_the_covariance_even_if_singular(P):
    L = root(P)
    assert L @ np.swapaxes(L, -1, -2) == pytest.approx(P)


def test_root_takes_a_variance_below_zero_as_zero():
    L = root(np.diag([1.0, -1e-12]))
    assert pytest.approx(np.diag([1.0, 0.0]), abs=1e-15) == L @ L.T


def test_a_singular_covariance_changes_nothing_for_the_others_of_its_batch():
    rng = np.random.default_rng(6)
    P = np.array([[covariance(rng) for _ in range(3)] for _ in range(4)])
    P[1, 2], P[3, 0] = np.diag([1.0, 2.0, 0.0, 3.0]), np.zeros((4, 4))
    together = root(P)
    alone = np.array([[root(one) for one in some] for some in P])
    assert together.tobytes() == alone.tobytes()


def test_symmetric():
    assert symmetric(np.array([[1.0, 2.0], [4.0, 1.0]])).tolist() == [[1.0, 3.0], [3.0, 1.0]]


def test_log_density_is_the_normal_one():
    rng = np.random.default_rng(5)
    belief = Gaussian(rng.normal(size=4), covariance(rng))
    points = rng.normal(0.0, 3.0, (10, 4))
    assert log_density(points, belief) == pytest.approx(multivariate_normal(*belief).logpdf(points))


def test_log_density_of_a_singular_belief_still_ranks_points():
    flat = Gaussian(np.zeros(2), np.diag([1.0, 0.0]))
    on, aside, off = log_density(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 0.1]]), flat)
    assert on > aside > off
    assert np.isfinite(off)
