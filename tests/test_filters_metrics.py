"""Metrics by hand, and random numbers by key."""

import numpy as np
import pytest

from trackfield.filters.metrics import lost, median_error, nees, rmse
from trackfield.filters.rng import generator


def test_rmse_is_pooled_over_runs_and_time():
    errors = np.array([[[3.0, 4.0], [0.0, 0.0]], [[0.0, 5.0], [5.0, 0.0]]])
    assert rmse(errors) == pytest.approx(np.sqrt(75.0 / 4.0))
    assert rmse(errors[..., :1]) == pytest.approx(np.sqrt(34.0 / 4.0))


def test_median_is_of_lengths():
    assert median_error(np.array([[3.0, 4.0], [0.0, 1.0], [100.0, 0.0]])) == 5.0


def test_nees_is_the_squared_error_in_units_of_its_covariance():
    P = np.array([[4.0, 1.0], [1.0, 2.0]])
    error = np.array([1.0, -2.0])
    assert nees(error, P) == pytest.approx(error @ np.linalg.inv(P) @ error)
    assert nees(np.stack((error, 0.0 * error)), P) == pytest.approx([error @ np.linalg.inv(P) @ error, 0.0])


def test_nees_of_errors_as_large_as_they_claim_is_their_dimension():
    P = np.diag([4.0, 9.0, 1.0, 0.25])
    errors = np.random.default_rng(0).normal(size=(20_000, 4)) * np.sqrt(np.diag(P))
    assert nees(errors, np.tile(P, (20_000, 1, 1))).mean() == pytest.approx(4.0, abs=0.1)


def test_nees_of_a_certain_estimate_is_infinite_unless_it_is_right():
    flat = np.diag([1.0, 0.0])
    assert nees(np.array([[2.0, 0.1], [2.0, 0.0], [0.0, 0.0]]), flat).tolist() == [np.inf, 4.0, 0.0]


def test_lost_is_more_than_50_m_at_the_last_step():
    errors = np.zeros((3, 4, 2))
    errors[0, 2] = 300.0  # found again
    errors[1, 3] = [30.0, 40.0]
    errors[2, 3] = [30.0, 40.1]
    assert lost(errors).tolist() == [False, False, True]


def test_generators_belong_to_their_key():
    def draws(*key):
        return generator(*key).random(4).tolist()

    assert draws(1, "fusion", "spcpf", 7) == draws(1, "fusion", "spcpf", 7)
    others = [(2, "fusion", "spcpf", 7), (1, "fusion", "spcpf", 8), (1, "fusion", "bootstrap", 7), (1,)]
    assert len({tuple(draws(*key)) for key in [(1, "fusion", "spcpf", 7), *others]}) == 5


def test_generators_of_neighbouring_keys_are_independent():
    first = np.array([generator(1, "fusion", step).standard_normal(2) for step in range(4000)])
    assert first.mean(axis=0) == pytest.approx(np.zeros(2), abs=0.06)
    assert np.cov(first.T) == pytest.approx(np.eye(2), abs=0.1)
    assert np.corrcoef(first[1:, 0], first[:-1, 0])[0, 1] == pytest.approx(0.0, abs=0.06)
