"""Particle filters that know outliers: the density of their weights, exact posteriors, and Zhou et al.'s outliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from launcher.reproduce.kernels.draws import Generators, generators, stacked
from launcher.reproduce.papers.zhou import filters
from launcher.reproduce.papers.zhou.setups import OUTLIERS, WALK, Setup, world
from tests.command_line import Call, trackfield
from tests.matrix import field
from tests.sensing import model_of
from trackfield.errors import ScenarioError
from trackfield.filters import batch, measurement, rao_blackwell, recovery, spcpf
from trackfield.filters import stacked as several
from trackfield.filters.blackwell import Blackwell, one
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.clouds import CloudTracker
from trackfield.filters.gpf_ukf import GpfUkf
from trackfield.filters.metrics import LOST_M
from trackfield.filters.robust import BEYOND, inflated, tailed
from trackfield.filters.search import searched
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.trackers import NOT_ROBUST, TRACKERS, make_tracker
from trackfield.filters.types import Array, Gaussian, Readings, Reports
from trackfield.sensing.energy import Energy
from trackfield.sensing.range import Range
from trackfield.tracking.following import ANYWHERE

__all__ = ["trackfield"]

CRYSTAL = stats.crystalball(BEYOND, BEYOND**2)
"""Normal above -c, and below it a power of c^2: to both sides it is the density of the weights."""


def log_density(sds: Array) -> Array:
    """Of misses in sds, 0 at 0: by scipy."""
    return np.asarray(CRYSTAL.logpdf(-np.abs(sds)) - CRYSTAL.logpdf(0.0))


# --- the density ---


def test_the_tails_are_those_of_the_crystal_ball() -> None:
    sds = np.linspace(-40.0, 40.0, 1601)
    assert -0.5 * tailed(np.square(sds)) == pytest.approx(log_density(sds), rel=1e-12, abs=1e-12)


def test_within_the_limit_nothing_changes() -> None:
    squares = np.linspace(0.0, BEYOND**2, 100)
    assert (tailed(squares) == squares).all()


def test_a_reading_pulls_as_under_the_noise_that_the_kalman_filters_take() -> None:
    sd, miss = 0.7, np.array([-30.0, -2.0, -1.0, 0.3, 1.7, 1.8, 50.0])
    h = 1e-6
    slope = (tailed(np.square((miss + h) / sd)) - tailed(np.square((miss - h) / sd))) / (4.0 * h)
    by_noise = miss / np.square(inflated(np.full(miss.shape, sd), miss, np.zeros(miss.shape)))
    assert slope == pytest.approx(by_noise, rel=1e-6)


@pytest.mark.parametrize("name", ["doa", "range", "rss", "energy", "doa and range", "rss and energy"])
def test_the_likelihood_by_hand(name: str) -> None:
    """With misses within the limit as without the option, elsewhere that density."""
    of, rng = field(name), np.random.default_rng(0)
    truth = of.truth(rng)[5]
    heard = of.heard(truth, 5, rng)
    around = np.array([3.0, 3.0, 0.5, 0.5])
    near, far = (np.tile(truth, (20, 1)) for _ in range(2))
    near[:, :4] += 0.02 * around * rng.standard_normal((20, 4))
    far[:, :4] += 10.0 * around * rng.standard_normal((20, 4))
    for states in (near, far):
        sd = np.broadcast_to(
            measurement.noise_sd(of.model, heard, states),
            (sds := measurement.innovations(of.model, states, heard)).shape,
        )
        by_hand = log_density(sds / sd) - np.where(measurement.varies(of.model), np.log(sd), 0.0)
        found = measurement.log_likelihood(of.model, states, heard, robust=True)
        assert np.ptp(found - by_hand.sum(axis=-1)) < 1e-8
    inside = (np.abs(sds / sd) < BEYOND).all(axis=-1)
    plain = measurement.log_likelihood(of.model, far, heard)
    assert (found[~inside] > plain[~inside]).all()
    assert found[inside] == pytest.approx(plain[inside], rel=1e-12)


def test_padding_says_nothing() -> None:
    of, rng = field("range"), np.random.default_rng(0)
    truth = of.truth(rng)[5]
    alone = of.heard(truth, 5, rng)
    ((kind, values, _),) = alone.readings
    padded = np.full((1, len(values) + 2, 1), np.nan)
    padded[0, :-2] = values
    at = np.zeros((1, len(values) + 2, 2))
    at[0, :-2] = alone.positions
    states = truth + 20.0 * rng.standard_normal((1, 10, 4))
    found = measurement.log_likelihood(of.model, states, Reports(5, (), at, (Readings(kind, padded),)), robust=True)
    assert found[0] == pytest.approx(measurement.log_likelihood(of.model, states[0], alone, robust=True), rel=1e-12)


def test_sums_of_energies_have_the_same_tails() -> None:
    kind, points = Energy(), np.zeros((1, 3, 5))
    points[..., :2], points[..., 4] = [[10.0, 0.0], [15.0, 5.0], [40.0, 0.0]], np.log(1e5)
    at = np.array([[0.0, 0.0], [30.0, 0.0]])
    expected = kind.h(points[0], at)[..., 0]
    z, variance = expected[0] * [1.0, 9.0], kind.variance_of(expected)
    by_hand = (log_density((z - expected) / np.sqrt(variance)) - 0.5 * np.log(variance)).sum(axis=-1)
    assert several.log_likelihood(kind, points, z, at, robust=True) == pytest.approx(by_hand, rel=1e-9)


# --- exact posteriors ---


@pytest.mark.parametrize("off_m", [1.0, 4.5, 12.0])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("bootstrap", {"n": 40_000}),
        ("gpf-ukf", {"particles": 40_000, "wider": 4.0, "reset": False}),
        ("upf", {"particles": 40_000, "ess": 0.0}),
        ("fa-upf", {"particles": 40_000}),
        ("spcpf", {"particles": 40_000}),
        ("rbpf", {"particles": 40_000}),
        ("jm-rbpf", {"particles": 40_000, "enter": 0.0}),
    ],
)
def test_the_posterior_after_one_far_range_is_that_of_its_density(
    name: str, options: dict[str, Any], off_m: float
) -> None:
    """A range along one axis, far away, is linear: the posterior of x is a product of two densities, on a grid.

    So the weights are right whatever the proposal. The tolerance is five standard errors of so many particles, drawn
    from the prior.
    """
    model, far, dt = model_of(Range(range_m=1e6, floor_sd_m=1.0, growth_m=0.0)), 1e5, 1.0
    prior = Gaussian(np.zeros(4), np.diag([2.0, 0.01, 0.5, 0.01]))
    x = np.linspace(-15.0, 25.0, 40_001)
    before = stats.norm(0.0, np.sqrt(2.5 + 0.1**2 / 4.0)).pdf(x)
    before /= before.sum()
    p = before * np.exp(log_density(off_m - x))
    p /= p.sum()
    mean = p @ x
    sd = np.sqrt(p @ np.square(x - mean))
    reports = Reports(1, ("a",), np.array([[-far, 0.0]]), (Readings("own", np.array([[far + off_m]])),), 1, False)
    tracker = make_tracker(name, {**options, "robust": True})
    _, estimate = tracker.step(tracker.init(prior, model), reports, dt, np.random.default_rng(0))
    error = sd / np.sqrt(40_000 / (np.square(p) / before).sum())
    assert estimate.mean[0] == pytest.approx(mean, abs=5.0 * error)
    assert np.sqrt(estimate.covariance[0, 0]) == pytest.approx(sd, abs=5.0 * error)


# --- the walk, ranges of 1 m to the three nearest nodes, 10 % of them up to 20 m too long ---

RUNS = 25


def means(tracker: Any, setup: Setup, heard: Sequence[Reports], rngs: Generators) -> Array:
    """The means (R, T, 4) of a tracker on the reports of R runs at once."""
    if isinstance(tracker, GpfUkf):
        return filters.gpf_ukf(tracker)(setup.prior, heard, setup.model, rngs).mean
    if isinstance(tracker, CloudTracker):
        return filters.particles(tracker)(setup.prior, heard, setup.model, rngs).mean
    found, model, prior = [], setup.model, Gaussian(*(np.stack([part] * len(rngs)) for part in setup.prior))
    if isinstance(tracker, Blackwell):
        cloud = rao_blackwell.begin(one(prior), stacked(lambda rng: tracker.start(rng, model), rngs), tracker.turns)
        for some in heard:
            looks = [stacked(lambda rng: tracker.draws(rng, model), rngs) for _ in range(tracker.looks)]
            cloud, posterior = tracker.advance(cloud, some, model, 1.0, looks[0], looks[-1])
            found.append(posterior.mean)
    elif isinstance(tracker, Bootstrap):
        for run, rng in enumerate(rngs):
            state, track = tracker.init(setup.prior, model), []
            for some in heard:
                state, estimate = tracker.step(state, recovery.alone(some, (run,)), 1.0, rng)
                track.append(estimate.mean)
            found.append(np.array(track))
        return np.array(found)
    else:
        assert isinstance(tracker, SpCpf)
        bank = batch.begin(tracker, [setup.prior] * len(rngs), rngs)
        for some in heard:
            draws = stacked(tracker.draws, rngs)
            bank = spcpf.fuse(bank, some, model, 1.0, draws, by_prior=False, robust=tracker.robust)
            found.append(bank.posterior.mean)
    return np.stack(found, axis=1)


def error_m(name: str, setup: Setup, *, robust: bool) -> float:
    """Position error, rms over runs and steps. Without the option outliers would only mislead into new beginnings."""
    told = world(setup, seeds := range(1, RUNS + 1))
    options: dict[str, Any] = {"robust": robust}
    if name in {"gpf-ukf", "upf", "fa-upf"} and not robust:
        options["reset"] = False
    off = means(make_tracker(name, options), setup, told.reports, generators(seeds, name)) - told.truth
    return float(np.sqrt(np.square(off[..., :2]).sum(axis=-1).mean()))


@pytest.mark.parametrize(
    "name", ["bootstrap", "gpf-ukf", "upf", "fa-upf", "rbpf", "mrbpf", "mrbpf-weightmass", "jm-rbpf", "spcpf"]
)
def test_outliers_cost_a_robust_filter_little_and_knowing_them_nothing(name: str) -> None:
    """Without outliers 0.8 to 1.1 m; with them 1.0 to 1.8 instead of 3.5 to 5.6 (docs/tracking.md)."""
    walk, outliers = (replace(setup, steps=40) for setup in (WALK, OUTLIERS))
    clean, ready = (error_m(name, walk, robust=robust) for robust in (False, True))
    plain, robust = (error_m(name, outliers, robust=robust) for robust in (False, True))
    assert ready < 1.1 * clean
    assert robust < 0.6 * plain
    assert robust < 1.8 * clean


# --- a filter that has lost its target ---


def ranges(off_m: Array) -> tuple[Any, Array, Reports]:
    """A model, a place, and ranges from there to sensors on a circle, off by this much."""
    model, angles = model_of(Range(range_m=200.0, floor_sd_m=1.0, growth_m=0.0)), np.arange(len(off_m)) * 2.4
    at, x = 80.0 * np.stack((np.sin(angles), np.cos(angles)), axis=-1), np.array([7.0, -4.0, 0.0, 0.0])
    z = np.hypot(*(at - x[:2]).T) + off_m
    return model, x, Reports(1, tuple(map(str, angles)), at, (Readings("own", z[:, None]),), 1, False)


@pytest.mark.parametrize(
    ("off_m", "plain", "robust"),
    [
        ([0.0] * 6, False, False),
        ([20.0, 0.0, 0.0], True, False),
        ([20.0, 9.0, 0.0], True, True),  # most are off
        ([20.0, -20.0, 0.0, 0.0, 0.0, 0.0], True, False),
        ([2.4] * 16, True, True),  # all are off, but none by so much
    ],
)
def test_a_few_outliers_are_no_loss_of_a_robust_filter(off_m: list[float], plain: bool, robust: bool) -> None:
    model, x, reports = ranges(np.array(off_m))
    assert recovery.unexplained(x, reports, model) == plain
    assert recovery.unexplained(x, reports, model, robust=True) == robust


def test_a_place_is_found_among_outliers() -> None:
    model, x, reports = ranges(np.array([0.0, 30.0, 0.0, 0.0, -25.0, 0.0, 0.0]))
    plain, robust = (searched(ANYWHERE, model, reports, LOST_M, robust=robust) for robust in (False, True))
    assert plain is not None
    assert robust is not None
    assert np.hypot(*(plain.mean - x)[:2]) > 3.0
    assert np.hypot(*(robust.mean - x)[:2]) < 0.5


# --- the option ---


def test_every_tracker_has_the_option_or_says_why_not() -> None:
    for name in TRACKERS.own.keys() - NOT_ROBUST.keys():
        assert make_tracker(name, {"robust": True}).robust is True  # type: ignore[attr-defined]
    for name, why in NOT_ROBUST.items():
        with pytest.raises(ScenarioError) as refused:
            make_tracker("mine", {"tracker": name, "robust": True})
        assert str(refused.value) == (
            f"fusion.options.mine.robust: {name} cannot be robust to outliers: {why}; "
            "expected gpf-ukf, or another tracker with this option"
        )


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("upf-paper.robust=true", "upf-paper.robust: upf-paper cannot be robust to outliers: it is the filter as Zhou"),
        ("gpf-ukf.robust=3", "gpf-ukf.robust: is 3; expected true or false"),
        ("upf.robost=true", "upf.robost: unknown option; did you mean robust?; expected one of particles, "),
    ],
)
def test_one_message_for_what_is_wrong(trackfield: Call, setting: str, says: str) -> None:
    name = setting.partition(".")[0]
    options = ("--tracker", name, "--set", f"fusion.options.{setting}", "--out", "a")
    said = trackfield("run", "zhai-spcpf", "--virtual", *options)
    assert said.code == 2
    assert said.err.startswith(f"trackfield: fusion.options.{says}")
    assert said.err.count("\n") == 1
