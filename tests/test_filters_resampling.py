"""Resampling: its law, the edges that rounding makes, and when it is not done."""

import numpy as np
import pytest

from trackfield.filters.resampling import due, effective_size, normalised, residual, systematic


class Fixed(np.random.Generator):
    """A generator whose ``random()`` is known."""

    def __init__(self, u):
        super().__init__(np.random.PCG64(0))
        self.u = u

    def random(self, size=None):
        return self.u if size is None else np.full(size, self.u)


LAST = np.nextafter(1.0, 0.0)
both = pytest.mark.parametrize("resample", [systematic, residual])


@pytest.mark.parametrize("seed", range(20))
def test_each_index_occurs_floor_or_ceil_of_its_share(seed):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(37, 0.3))
    counts = np.bincount(systematic(weights, 100, rng), minlength=37)
    assert counts.sum() == 100
    assert np.all((counts == np.floor(100 * weights)) | (counts == np.ceil(100 * weights)))


@pytest.mark.parametrize("seed", range(20))
def test_residual_draws_by_chance_only_what_is_left_of_the_shares(seed):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(37, 0.3))
    counts = np.bincount(residual(weights, 100, rng), minlength=37)
    assert counts.sum() == 100
    assert np.all(counts >= np.floor(100 * weights))


def test_residual_scatters_as_its_law_says():
    """Of 7 draws 4 are certain, and 3 come from the rests .7, .7, .7, .9: a multinomial of 3."""
    weights, rng = np.array([0.1, 0.1, 0.1, 0.7]), np.random.default_rng(1)
    counts = np.array([np.bincount(residual(weights, 7, rng), minlength=4) for _ in range(20_000)])
    p = np.array([0.7, 0.7, 0.7, 0.9]) / 3.0
    assert counts.var(axis=0) == pytest.approx(3.0 * p * (1.0 - p), rel=0.05)


@both
def test_it_is_unbiased(resample):
    weights, rng = np.array([0.05, 0.33, 0.0, 0.62]), np.random.default_rng(0)
    mean = np.mean([np.bincount(resample(weights, 7, rng), minlength=4) for _ in range(4000)], axis=0)
    assert mean == pytest.approx(7 * weights, abs=0.03)  # sd of a count is below 0.5


@both
def test_equal_weights_keep_every_particle(resample):
    assert resample(np.full(6, 1 / 6), 6, Fixed(0.5)).tolist() == list(range(6))


@both
@pytest.mark.parametrize("u", [0.0, 0.5, LAST])
def test_what_has_no_weight_is_never_drawn(resample, u):
    weights = np.array([0.0, 0.5, 0.0, 0.0, 0.5, 0.0])
    assert set(resample(weights, 4, Fixed(u)).tolist()) == {1, 4}
    assert set(resample(weights, 7, Fixed(u)).tolist()) == {1, 4}


@both
@pytest.mark.parametrize("u", [0.0, LAST])
def test_a_single_survivor_takes_all(resample, u):
    assert resample(np.array([0.0, 0.0, 1.0, 0.0]), 5, Fixed(u)).tolist() == [2] * 5


@both
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("u", [0.0, 0.5, LAST])
def test_a_sum_that_rounding_left_below_or_above_one(resample, dtype, u):
    weights = np.full(100_003, 1 / 100_003, dtype=dtype)
    assert weights.cumsum()[-1] != 1.0
    drawn = resample(weights, 100_003, Fixed(u))
    assert len(drawn) == 100_003
    assert drawn.min() >= 0
    assert drawn.max() <= 100_002
    assert np.all(np.diff(drawn) >= 0)


def test_more_or_fewer_than_there_are():
    weights = np.array([0.25, 0.75])
    assert systematic(weights, 8, Fixed(0.5)).tolist() == [0, 0] + [1] * 6
    assert systematic(weights, 1, Fixed(0.5)).tolist() == [1]


@both
@pytest.mark.parametrize("weights", [[0.0, 0.0], [np.nan, 1.0]])
def test_nothing_to_draw_from_is_an_error(resample, weights):
    with pytest.raises(ValueError, match="no weight is positive"):
        resample(np.array(weights), 3, np.random.default_rng(0))


def test_log_weights_of_any_size_become_shares():
    assert normalised(np.array([-1e6, -1e6 + np.log(3.0)])) == pytest.approx([0.25, 0.75])
    assert normalised(np.array([5e5, -np.inf, 5e5])) == pytest.approx([0.5, 0.0, 0.5])
    rows = np.random.default_rng(1).normal(0.0, 100.0, (4, 9))
    assert normalised(rows).sum(axis=-1) == pytest.approx(np.ones(4))
    assert np.array_equal(normalised(rows)[2], normalised(rows[2]))


def test_effective_size_counts_equal_weights():
    weights = np.array([[0.25, 0.25, 0.25, 0.25], [1.0, 0.0, 0.0, 0.0], [0.4, 0.4, 0.0, 0.0]])
    assert effective_size(weights) == pytest.approx([4.0, 1.0, 2.0])


def test_only_uneven_weights_are_due():
    even, uneven = np.array([0.3, 0.2, 0.3, 0.2]), np.array([0.85, 0.05, 0.05, 0.05])
    assert [due(weights, 0.5) for weights in (even, uneven)] == [False, True]
    assert due(np.array([0.5, 0.5, 0.0, 0.0]), 0.5)
    assert due(even, 1.0)
    assert not due(uneven, 0.25)
