"""Many runs at once are each run alone, to rounding."""

import numpy as np
import pytest

from tests.zhai_field import MODEL, hear, only, prior_around, s1
from trackfield.filters import batch
from trackfield.filters.gaussian import moments
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.particles import moved, picked
from trackfield.filters.resampling import evenly, normalised
from trackfield.filters.rng import generator
from trackfield.filters.spcpf import SpCpf

RUNS, STEPS = 5, 25


def campaign():
    """Priors, and reports by run and step: some steps are silent, some have a single sensor."""
    priors, heard = [], []
    for run in range(RUNS):
        rng = np.random.default_rng(run)
        truth = s1(rng)[: STEPS + 1]
        priors.append(prior_around(truth[0], rng))
        heard.append([hear(state[:2], rng, step=t) for t, state in enumerate(truth)][1:])
        heard[-1][3 + run] = only(heard[-1][3 + run], [])
        heard[-1][6 + 2 * run] = only(heard[-1][6 + 2 * run], [0])
        heard[-1][20] = only(heard[-1][20], [])  # silent in all
    return priors, heard


@pytest.mark.parametrize("weights", ["paper", "gaussian-prior"])
def test_a_campaign_of_spcpf_is_its_runs(weights):
    priors, heard = campaign()
    tracker = SpCpf(weights=weights)
    alone = np.empty((STEPS, RUNS, 4, 5))
    for run in range(RUNS):
        state = tracker.init(priors[run], MODEL)
        for t in range(STEPS):
            state, estimate = tracker.step(state, heard[run][t], 1.0, generator(run, t))
            alone[t, run] = np.column_stack((estimate.mean, estimate.covariance))
    for t in range(STEPS):
        rngs = [generator(run, t) for run in range(RUNS)]
        if t == 0:
            cloud = batch.begin(tracker, priors, rngs)
        cloud = batch.step(tracker, cloud, [heard[run][t] for run in range(RUNS)], MODEL, 1.0, rngs)
        assert cloud.posterior.mean == pytest.approx(alone[t, ..., 0], rel=1e-9, abs=1e-9)
        assert cloud.posterior.covariance == pytest.approx(alone[t, ..., 1:], rel=1e-9, abs=1e-9)


def test_the_bootstraps_kernels_take_runs_too():
    """A step of propagation, weights, moments and resampling, of all runs and of each."""
    _, heard = campaign()
    rng, reports = np.random.default_rng(9), [only(heard[run][0], range(1 + run % 4)) for run in range(RUNS)]
    particles = rng.normal([56.0, 75.0, 6.0, 5.0], [9.0, 9.0, 1.0, 1.0], (RUNS, 300, 4))
    normals, u = rng.normal(size=(RUNS, 300, 2)), rng.random(RUNS)

    def step(particles, normals, reports, u):
        particles = moved(particles, 1.0, 0.1, normals)
        weights = normalised(log_likelihood(MODEL, particles, reports))
        return *moments(weights, particles), picked(particles, evenly(weights, 300, u))

    together = step(particles, normals, batch.stacked(reports), u)
    assert len({len(one) for one in reports}) > 1
    for run in range(RUNS):
        for whole, part in zip(together, step(particles[run], normals[run], reports[run], u[run]), strict=True):
            assert whole[run] == pytest.approx(part, rel=1e-9, abs=1e-9)
