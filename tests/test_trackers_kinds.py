"""Fixes of every kind of sensing, and SP-CPF on those with one number."""

from __future__ import annotations

import numpy as np
import pytest

from tests.matrix import PRIOR, STEPS, cell, field, refused
from trackfield.filters import batch
from trackfield.filters.fix import certain_fix, enough, first_fix, map_fix
from trackfield.filters.measurement import extended, innovations, noise_sd
from trackfield.filters.rng import generator
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.types import Array, Gaussian, Model, Reports
from trackfield.tracking.following import ANYWHERE

KINDS = ("range", "rss", "energy", "doa and range", "rss and energy")


def cost(prior: Gaussian, model: Model, reports: Reports, x: Array) -> float:
    """-2 log of the posterior at x, up to a constant."""
    apart, sd = x - prior.mean, noise_sd(model, reports, x)
    misses = innovations(model, x, reports) / sd
    return float(apart @ np.linalg.solve(prior.covariance, apart) + misses @ misses + 2.0 * np.log(sd).sum())


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_fix_is_where_the_posterior_is_highest(name: str, seed: int) -> None:
    """In no direction, by a hundredth of the fix's sd or by one, is a state likelier."""
    of, rng = field(name), np.random.default_rng(seed)
    x = of.truth(rng)[8]
    wide = np.diag([400.0, 400.0, 16.0, 16.0])
    prior = extended(Gaussian(x[:4] + rng.standard_normal(4) * np.sqrt(np.diag(wide)), wide), of.model.unknowns)
    reports = of.heard(x, 8, rng)
    mean, covariance = map_fix(prior, reports, of.model).posterior
    best = cost(prior, of.model, reports, mean)
    L = np.linalg.cholesky(covariance)
    for scale in (1.0, 0.01):
        for way in rng.standard_normal((40, len(mean))):
            there = mean + scale * L @ (way / np.linalg.norm(way))
            assert cost(prior, of.model, reports, there) > best - 1e-4


@pytest.mark.parametrize("name", KINDS)
def test_a_fix_from_nothing_is_as_good_as_it_says(name: str) -> None:
    of, squares = field(name), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        x = of.truth(rng)[15]
        reports = of.heard(x, 15, rng)
        around = extended(Gaussian(np.append(reports.positions.mean(axis=0), [0.0, 0.0]), ANYWHERE), of.model.unknowns)
        fix = certain_fix(around, reports, of.model)
        assert fix is not None
        error = (fix.mean - x)[:2]
        squares.append(error @ np.linalg.solve(fix.covariance[:2, :2], error))
    assert 1.1 < np.mean(squares) < 3.1  # 2, of 30 values: three standard errors are 1.1


def test_fewer_reports_than_a_position_takes_are_no_fix() -> None:
    of, rng = field("range"), np.random.default_rng(1)
    x = of.truth(rng)[5]
    reports = of.heard(x, 5, rng)
    assert enough(of.model, reports) == 3
    assert first_fix(reports.only(np.array([0, 1])), of.model, ANYWHERE) is None
    both = field("doa and range")
    heard = both.heard(x, 5, rng)
    assert enough(both.model, heard) == 3
    bearings = heard.only(np.arange(len(heard.readings[0].values)))
    assert enough(both.model, bearings) == 2


# --- SP-CPF ---


@pytest.mark.parametrize(("name", "most"), [("doa", 2.2), ("range", 1.9), ("rss", 2.6)])
def test_spcpf_follows_by_any_kind_of_one_number(name: str, most: float) -> None:
    """docs/trackers.md has 1.6, 1.4 and 1.8 times the bound."""
    found = cell("spcpf", field(name), range(8), alone=False)
    assert found.tracked == 1.0
    assert 0.9 < found.ratio < most


@pytest.mark.parametrize(
    ("name", "why"), [("energy", "no unknowns"), ("doa and range", "one kind"), ("rss and energy", "one kind")]
)
def test_and_is_refused_where_it_cannot(name: str, why: str) -> None:
    assert refused("spcpf", field(name)) == why


@pytest.mark.parametrize("name", ["range", "rss"])
def test_a_campaign_of_spcpf_is_its_runs_with_noise_that_depends_on_the_state_too(name: str) -> None:
    """Runs of different numbers of reports, some of none, as one array."""
    of, runs, tracker, truths, heard = field(name), 4, SpCpf(), [], []
    for run in range(runs):
        rng = np.random.default_rng(run)
        truths.append(of.truth(rng))
        heard.append([of.heard(x, step, rng) for step, x in enumerate(truths[-1][1:], start=1)])
        heard[-1][2 + run] = heard[-1][2 + run].only(np.arange(0))
        heard[-1][6] = heard[-1][6].only(np.arange(1 + run))
    priors = [Gaussian(truth[0], PRIOR) for truth in truths]
    states = [tracker.init(prior, of.model) for prior in priors]
    cloud = batch.begin(tracker, priors, firsts := [generator(run, 0) for run in range(runs)])
    for step in range(STEPS // 2):
        rngs = firsts if step == 0 else [generator(run, step) for run in range(runs)]
        cloud = batch.step(tracker, cloud, [one[step] for one in heard], of.model, 1.0, rngs)
        for run in range(runs):
            states[run], alone = tracker.step(states[run], heard[run][step], 1.0, generator(run, step))
            assert cloud.posterior.mean[run] == pytest.approx(alone.mean, rel=1e-9, abs=1e-9)
            assert cloud.posterior.covariance[run] == pytest.approx(alone.covariance, rel=1e-9, abs=1e-9)
