"""Metrics by hand, and random numbers by key."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import chi2

from tests import kalman
from trackfield.filters.metrics import Lost, effective_count, median_error, nees, nees_band, rmse
from trackfield.filters.rng import generator
from trackfield.filters.types import Gaussian
from trackfield.models import motion


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


@pytest.mark.parametrize(("dof", "n", "level"), [(4, 60, 0.95), (1, 1, 0.95), (2, 12.5, 0.5), (4, 10_000, 0.99)])
def test_bands_are_chi_squares_quantiles(dof, n, level):
    tails = [(1.0 - level) / 2.0, (1.0 + level) / 2.0]
    assert nees_band(dof, n, level) == pytest.approx(chi2.ppf(tails, dof * n) / n)


def test_a_kalman_filters_nees_and_nis_are_in_their_bands():
    """Means of 400 runs at each of 40 steps: of 95 in 100 steps; fewer than 30 of 40 has a chance below 1e-5."""
    runs, rng = 400, np.random.default_rng(2)
    F, gain, H = np.array(motion.transition(1.0)), np.array(motion.noise_gain(1.0)), np.eye(2, 4)
    prior = Gaussian(np.zeros(4), np.diag([9.0, 9.0, 1.0, 1.0]))
    truth = 1.0 * rng.multivariate_normal(*prior, size=runs)
    beliefs, inside = [prior] * runs, {"nees": 0, "nis": 0}
    for _ in range(40):
        truth = truth @ F.T + 0.4 * rng.normal(size=(runs, 2)) @ gain.T
        z = truth @ H.T + 2.0 * rng.normal(size=(runs, 2))
        ahead = [kalman.predict(belief, 1.0, 0.4) for belief in beliefs]
        innovations = z - np.array([a.mean for a in ahead]) @ H.T
        S = np.array([H @ a.covariance @ H.T for a in ahead]) + 4.0 * np.eye(2)
        beliefs = [Gaussian(*kalman.update(a, z[i], H, 4.0 * np.eye(2))[:2]) for i, a in enumerate(ahead)]
        errors = np.array([b.mean for b in beliefs]) - truth
        found = {"nees": nees(errors, np.array([b.covariance for b in beliefs])), "nis": nees(innovations, S)}
        for name, dof in (("nees", 4), ("nis", 2)):
            low, high = nees_band(dof, runs)
            inside[name] += low < found[name].mean() < high
    assert min(inside.values()) >= 30


def test_values_that_are_alike_count_less():
    """Of an autoregression of coefficient a, n values are worth n (1 - a) / (1 + a)."""
    noise = np.random.default_rng(0).normal(size=40_000)
    for a in (0.0, 0.5, 0.9):
        values = lfilter([1.0], [1.0, -a], noise)
        assert effective_count(values) == pytest.approx(40_000 * (1.0 - a) / (1.0 + a), rel=0.1)


@pytest.mark.parametrize("values", [[3.0], [3.0, 3.0, 3.0], [1.0, 3.0, 1.0, 3.0, 1.0]])
def test_no_values_count_more_than_there_are(values):
    assert effective_count(np.array(values)) == len(values)


def test_lost_is_more_than_50_m_at_the_last_step():
    errors = np.zeros((3, 4, 2))
    errors[0, 2] = 300.0  # found again
    errors[1, 3] = [30.0, 40.0]
    errors[2, 3] = [30.0, 40.1]
    assert Lost().holds(errors).tolist() == [False, False, True]


@given(
    st.lists(st.sampled_from([0.0, 30.0, 30.1, np.inf, np.nan]), max_size=24),
    st.sampled_from([(1,), (2,), (2, 3)]),
    st.integers(1, 4),
    st.none() | st.integers(1, 9),
)
def test_lost_is_who_is_off_for_so_many_steps_in_a_row(lengths, runs, steps, within):
    """Beside a plain loop, over any leading axes; an error in one coordinate alone is no track either."""
    assume(within is None or within >= steps)
    count = len(lengths) // int(np.prod(runs))
    errors = np.zeros((*runs, count, 2))
    errors[..., 0].flat[:] = lengths[: errors[..., 0].size]
    found = Lost(30.0, steps, within).holds(errors)
    assert found.shape == runs
    for run in np.ndindex(runs):
        row, longest = 0, 0
        for x, _ in errors[run].tolist()[0 if within is None else max(count - within, 0) :]:
            row = 0 if x <= 30.0 else row + 1
            longest = max(longest, row)
        assert found[run] == (longest >= steps)


@pytest.mark.parametrize(("rule", "message"), [((9.0, 0, None), "steps: 0"), ((9.0, 3, 2), "within: the last 2")])
def test_a_rule_that_makes_no_sense_is_refused(rule, message):
    with pytest.raises(ValueError, match=message):
        Lost(*rule)


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
