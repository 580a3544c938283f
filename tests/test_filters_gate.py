"""Which bearings are believed: against exact answers, and what is learnt of the sensors."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from immutables import Map

from tests import kalman
from tests.sensing import with_bearings
from tests.zhai_field import GRID, MODEL, hear
from trackfield.filters import ukf
from trackfield.filters.fix import agreeing
from trackfield.filters.gate import CLUTTER, left_out, likeliest
from trackfield.filters.gaussian import extent
from trackfield.filters.imm_ukf import ImmUkf
from trackfield.filters.suspicion import clutter, learn
from trackfield.filters.types import Gaussian, of_bearings
from trackfield.models import doa

ANY = -np.log(2.0 * np.pi)
"""Log density of a bearing that may be any."""


def problem(rng, k, n=4, spread=2.0):
    """A belief, and k linear measurements of a state drawn from it."""
    A = rng.normal(0.0, spread, (n, n))
    prior = Gaussian(rng.normal(0.0, 5.0, n), A @ A.T + 0.1 * spread * np.eye(n))
    H, sd = rng.normal(size=(k, n)), rng.uniform(0.05, 0.3, k)
    state = prior.mean + np.linalg.cholesky(prior.covariance) @ rng.normal(size=n)
    return prior, H, sd, H @ state + sd * rng.normal(size=k)


def evidence(prior, H, sd, z, which):
    which = list(which)
    return kalman.update(prior, z[which], H[which], np.diag(sd[which] ** 2)).log_evidence if which else 0.0


class Kalman:
    """The exact judge in the linear case."""

    def __init__(self, *problem):
        self.problem = problem

    def evidence(self, which):
        return evidence(*self.problem, which)

    def without(self, which):
        return np.array([self.evidence(np.delete(which, k)) for k in range(len(which))])


def by_enumeration(prior, H, sd, z, chances):
    """The likeliest of all 2^K stories, and its log odds."""
    gain = left_out(chances, ANY)
    stories = [which for size in range(len(z) + 1) for which in combinations(range(len(z)), size)]
    odds = [evidence(prior, H, sd, z, which) - gain[list(which)].sum() for which in stories]
    return stories[int(np.argmax(odds))], max(odds)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("n", "k"), [(4, 1), (4, 3), (2, 7)])
def test_what_the_others_let_expect_is_kalmans_to_the_digit(seed, n, k):
    """log p(z_k | all others) = log p(all) - log p(all others)."""
    prior, H, sd, z = problem(np.random.default_rng(seed), k, n)
    z[0] += 3.0
    exact, all_of_them = Kalman(prior, H, sd, z), np.arange(k)
    found = ukf.predictive(prior, z, sd, lambda x: x @ H.T)
    assert found == pytest.approx(exact.evidence(all_of_them) - exact.without(all_of_them))


def exact_ones(wrong):
    """In how many of 25 problems the story found is the likeliest of all; its odds are exact in any case."""
    count = 0
    for seed in range(25):
        rng = np.random.default_rng(seed)
        prior, H, sd, z = problem(rng, 6, spread=0.05)
        z[list(wrong)] += rng.choice([-1.0, 1.0], len(wrong)) * rng.uniform(1.0, 3.0, len(wrong))
        chances = rng.uniform(0.02, 0.5, 6)
        story = likeliest(left_out(chances, ANY), Kalman(prior, H, sd, z))
        found = evidence(prior, H, sd, z, story.believed) - left_out(chances, ANY)[story.believed].sum()
        assert story.log_odds == pytest.approx(found)
        count += tuple(story.believed) == by_enumeration(prior, H, sd, z, chances)[0]
    return count


def test_the_story_found_is_the_likeliest_of_all():
    assert exact_ones(()) == exact_ones((1,)) == 25


def test_two_that_err_in_the_same_way_seldom_hide_each_other():
    assert exact_ones((0, 4)) >= 22


def test_a_single_bearing_is_left_out_where_bayes_rule_says():
    """Believed while (1 - c) N(z; h, S) exceeds c / 2 pi: with S = 2 sigma^2 here, up to 3.61 sd of S."""
    sd, c = 0.05, CLUTTER
    edge = np.sqrt(-2.0 * np.log(c / (1.0 - c) / (2.0 * np.pi) * np.sqrt(2.0 * np.pi * 2.0 * sd**2)))
    assert edge == pytest.approx(3.61, abs=0.01)
    prior, H = Gaussian(np.zeros(1), np.array([[sd**2]])), np.eye(1)
    for off, believed in ((edge - 1e-6, 1), (edge + 1e-6, 0)):
        z = np.array([off * np.sqrt(2.0) * sd])
        assert len(likeliest(left_out(np.array([c]), ANY), Kalman(prior, H, np.array([sd]), z)).believed) == believed


# --- in the tracker ---


def settled(truth, rng, gate=True, steps=12, velocity=(6.0, 5.0)):
    """The tracker's state after it followed a straight path to one second before ``truth``."""
    tracker, v = ImmUkf(gate=gate), np.array(velocity)
    prior = Gaussian(np.append(truth - steps * v, v), np.diag([9.0, 9.0, 1.0, 1.0]))
    state = tracker.init(prior, MODEL)
    for step in range(steps - 1, 0, -1):
        state, _ = tracker.step(state, hear(truth - step * v, rng), 1.0, rng)
    return tracker, state


def exactly(place, off=()):
    """What all who hear ``place`` would report without noise, some of it off by so many degrees."""
    heard = hear(np.array(place), np.random.default_rng(0), sigma_w=0.0)
    bearings = heard.bearings.copy()
    for k, degrees in off:
        bearings[k] += np.radians(degrees)
    return with_bearings(heard, bearings)


TRUTH = np.array([226.0, 227.0])


@pytest.mark.parametrize("seed", range(5))
def test_where_no_bearing_is_off_the_estimate_is_that_without_a_gate(seed):
    rng = [np.random.default_rng(seed) for _ in range(2)]
    (gated, state), (plain, other) = settled(TRUTH, rng[0]), settled(TRUTH, rng[1], gate=False)
    heard = exactly(TRUTH)
    _, with_gate = gated.step(state, heard, 1.0, rng[0])
    _, without = plain.step(other, heard, 1.0, rng[1])
    assert np.array_equal(with_gate.mean, without.mean)
    assert np.array_equal(with_gate.covariance, without.covariance)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("degrees", [25.0, -90.0, 180.0])
def test_one_bearing_that_is_off_counts_for_nothing(seed, degrees):
    """The estimate is bit for bit that of the others alone."""
    tracker, state = settled(TRUTH, np.random.default_rng(seed))
    whole = exactly(TRUTH)
    for k in range(len(whole)):
        _, one_off = tracker.step(state, exactly(TRUTH, [(k, degrees)]), 1.0, np.random.default_rng(0))
        _, alone = tracker.step(state, whole.only(np.delete(np.arange(len(whole)), k)), 1.0, np.random.default_rng(0))
        assert np.array_equal(one_off.mean, alone.mean)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("aside", [6.0, 12.0, 20.0])
def test_all_bearings_off_together_are_a_manoeuvre(seed, aside):
    """The target is not where it was expected, by up to ten times the track's sd: the track goes with it."""
    tracker, state = settled(TRUTH, np.random.default_rng(seed))
    moved = TRUTH + aside * np.array([5.0, -6.0]) / np.hypot(5.0, 6.0)
    for _ in range(2):
        state, estimate = tracker.step(state, exactly(moved), 1.0, np.random.default_rng(0))
        moved = moved + np.array([6.0, 5.0])
    assert np.hypot(*(estimate.mean[:2] - (moved - [6.0, 5.0]))) < 3.0


def test_a_step_in_which_nothing_is_believed_is_coasted_through():
    tracker, state = settled(TRUTH, np.random.default_rng(0))
    heard = exactly(TRUTH)
    one = heard.only(np.array([0]))
    wrong = with_bearings(one, one.bearings + np.pi)
    nothing = heard.only(np.array([], dtype=int))
    _, after_wrong = tracker.step(state, wrong, 1.0, np.random.default_rng(0))
    _, after_nothing = tracker.step(state, nothing, 1.0, np.random.default_rng(0))
    assert np.array_equal(after_wrong.mean, after_nothing.mean)


def test_a_single_bearing_does_not_say_where_a_lost_target_went():
    """Beside its sensor the target may be in any direction; whatever is told, the track gets hardly wider for it."""
    beside = GRID[60] + np.array([4.0, 2.0])
    for seed in range(5):
        tracker, state = settled(beside, np.random.default_rng(seed))
        nothing = exactly(beside).only(np.array([], dtype=int))
        _, coasted = tracker.step(state, nothing, 1.0, np.random.default_rng(0))
        for degrees in range(0, 360, 15):
            one = of_bearings(0, ("n060",), GRID[[60]], np.radians([float(degrees)]), np.array([60.0]))
            _, told = tracker.step(state, one, 1.0, np.random.default_rng(0))
            assert extent(told.covariance) < 2.0 * extent(coasted.covariance)


# --- the first fix ---


@pytest.mark.parametrize("degrees", [40.0, 120.0, -150.0])
def test_a_fix_from_many_leaves_out_the_one_that_does_not_fit(degrees):
    sensors, truth = GRID[[48, 49, 59, 60, 61]], np.array([226.0, 227.0])
    wide = Gaussian(np.array([240.0, 230.0, 0.0, 0.0]), np.diag([1e6, 1e6, 100.0, 100.0]))
    for wrong in range(5):
        bearings = doa.measure(truth, sensors)
        bearings[wrong] += np.radians(degrees)
        heard = of_bearings(0, tuple("abcde"), sensors, bearings, np.full(5, 60.0))
        assert agreeing(wide, heard, MODEL).believed.tolist() == [k for k in range(5) if k != wrong]


def test_two_bearings_cannot_tell_which_of_them_is_wrong():
    heard = of_bearings(0, ("a", "b"), GRID[[48, 60]], np.array([2.0, 3.0]), np.full(2, 60.0))
    wide = Gaussian(np.array([240.0, 230.0, 0.0, 0.0]), np.diag([1e6, 1e6, 100.0, 100.0]))
    assert agreeing(wide, heard, MODEL).believed.tolist() == [0, 1]


# --- what is learnt of sensors ---


def test_of_unknown_sensors_the_gate_believes_what_it_always_did():
    assert clutter(Map(), ["a", "b"]) == pytest.approx([CLUTTER, CLUTTER])
    assert len(clutter(Map(), [])) == 0


def test_bayes_rule_for_one_sensor():
    """Left out once: faulty with p = 0.026 * 0.8 / (0.026 * 0.8 + 0.974 * 0.03), then a step of the chain."""
    before = 0.02 / 0.77
    after = before * 0.8 / (before * 0.8 + (1.0 - before) * 0.03)
    learnt = learn(Map(), ["a", "b", "c"], np.array([1, 2]))
    assert learnt["a"] == pytest.approx(after * 0.97 + (1.0 - after) * 0.001)
    assert learnt["b"] < before
    assert clutter(learnt, ["a"]) == pytest.approx([0.03 + 0.77 * learnt["a"]])


def test_who_is_left_out_again_and_again_is_hardly_believed_and_recovers():
    suspicion, chances = Map(), []
    for step in range(24):
        suspicion = learn(suspicion, ["a", "b", "c"], np.array([1, 2] if step < 6 else [0, 1, 2]))
        chances.append(float(clutter(suspicion, ["a"])[0]))
    assert chances[2] > 0.7
    assert chances[:6] == sorted(chances[:6])
    assert chances[-1] < CLUTTER
    assert clutter(suspicion, ["b"])[0] < CLUTTER


@pytest.mark.parametrize("believed", [[], [0], [0, 1]])
def test_where_most_are_left_out_it_is_the_track_that_is_doubtful(believed):
    suspicion = Map({"a": 0.3})
    assert learn(suspicion, ["a", "b", "c", "d"], np.array(believed, dtype=int)) is suspicion
