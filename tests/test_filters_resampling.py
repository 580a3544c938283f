"""Systematic resampling: its law, and the edges that rounding makes."""

import numpy as np
import pytest

from trackfield.filters.resampling import normalised, systematic


class Fixed(np.random.Generator):
    """A generator whose ``random()`` is known."""

    def __init__(self, u):
        super().__init__(np.random.PCG64(0))
        self.u = u

    def random(self, *_, **__):
        return self.u


LAST = np.nextafter(1.0, 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_each_index_occurs_floor_or_ceil_of_its_share(seed):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(37, 0.3))
    counts = np.bincount(systematic(weights, 100, rng), minlength=37)
    assert counts.sum() == 100
    assert np.all((counts == np.floor(100 * weights)) | (counts == np.ceil(100 * weights)))


def test_it_is_unbiased():
    weights, rng = np.array([0.05, 0.33, 0.0, 0.62]), np.random.default_rng(0)
    mean = np.mean([np.bincount(systematic(weights, 7, rng), minlength=4) for _ in range(4000)], axis=0)
    assert mean == pytest.approx(7 * weights, abs=0.03)  # sd of a count is below 0.5


def test_equal_weights_keep_every_particle():
    assert systematic(np.full(6, 1 / 6), 6, Fixed(0.5)).tolist() == list(range(6))


@pytest.mark.parametrize("u", [0.0, 0.5, LAST])
def test_what_has_no_weight_is_never_drawn(u):
    weights = np.array([0.0, 0.5, 0.0, 0.0, 0.5, 0.0])
    assert set(systematic(weights, 4, Fixed(u)).tolist()) == {1, 4}


@pytest.mark.parametrize("u", [0.0, LAST])
def test_a_single_survivor_takes_all(u):
    assert systematic(np.array([0.0, 0.0, 1.0, 0.0]), 5, Fixed(u)).tolist() == [2] * 5


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("u", [0.0, 0.5, LAST])
def test_a_sum_that_rounding_left_below_or_above_one(dtype, u):
    weights = np.full(100_003, 1 / 100_003, dtype=dtype)
    assert weights.cumsum()[-1] != 1.0
    drawn = systematic(weights, 100_003, Fixed(u))
    assert drawn.min() >= 0
    assert drawn.max() <= 100_002
    assert np.all(np.diff(drawn) >= 0)


def test_more_or_fewer_than_there_are():
    weights = np.array([0.25, 0.75])
    assert systematic(weights, 8, Fixed(0.5)).tolist() == [0, 0] + [1] * 6
    assert systematic(weights, 1, Fixed(0.5)).tolist() == [1]


@pytest.mark.parametrize("weights", [[0.0, 0.0], [np.nan, 1.0]])
def test_nothing_to_draw_from_is_an_error(weights):
    with pytest.raises(ValueError, match="no weight is positive"):
        systematic(np.array(weights), 3, np.random.default_rng(0))


def test_log_weights_of_any_size_become_shares():
    assert normalised(np.array([-1e6, -1e6 + np.log(3.0)])) == pytest.approx([0.25, 0.75])
    assert normalised(np.array([5e5, -np.inf, 5e5])) == pytest.approx([0.5, 0.0, 0.5])
    rows = np.random.default_rng(1).normal(0.0, 100.0, (4, 9))
    assert normalised(rows).sum(axis=-1) == pytest.approx(np.ones(4))
    assert np.array_equal(normalised(rows)[2], normalised(rows[2]))
