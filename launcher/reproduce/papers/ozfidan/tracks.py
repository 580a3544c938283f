"""Many runs of a policy and a filter as one array operation, with the bound for the schedule of each run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from launcher.reproduce.papers.ozfidan import scaled
from launcher.reproduce.papers.ozfidan.field import NOBODY, Setup, Truth, drawn, motion
from launcher.reproduce.papers.ozfidan.scheduling import POLICIES, Chosen, Flags, Scene, listed
from trackfield.filters import ukf
from trackfield.filters.gate import Indices
from trackfield.filters.gaussian import Motion, predict
from trackfield.filters.resampling import systematic
from trackfield.filters.rng import generator
from trackfield.filters.types import Array, Gaussian
from trackfield.sensing.range import Range

PARTICLES: Final = 200
LEAST_EFFECTIVE: Final = 40.0


class Waking(NamedTuple):
    """Sleepers hear a beacon at every ``listen_every``-th step only; it keeps them awake for ``keep`` steps."""

    listen_every: int = 1
    keep: int = 1


ALWAYS: Final = Waking()
"""As a policy says, at every step."""


class Tracks(NamedTuple):
    """R runs: ``errors`` (R, T, 4), the ``bound`` (R, T) m, and the ``leader`` (R, T).

    ``awake`` (R, T, S) are the slaves that report, ``silent`` (R, T) how many of them report that there is no target.
    """

    errors: Array
    bound: Array
    leader: Indices
    awake: Flags
    silent: Indices


def followed(
    setup: Setup,
    policy: str,
    filter_name: str,
    runs: Sequence[int],
    *,
    waking: Waking = ALWAYS,
    expected: Motion | None = None,
) -> Tracks:
    """The tracks of these runs; the filter expects the motion ``expected``, None: that of the target."""
    truth, kind, moves = drawn(setup, runs), setup.kind, motion()
    follow = FILTERS[filter_name](truth, expected or moves, kind, runs)
    choose, belief = POLICIES[policy], truth.prior
    leader, until = np.full(len(runs), NOBODY), np.zeros(truth.owner.shape, int)
    J = np.linalg.inv(truth.prior.covariance)
    found: list[tuple[np.ndarray, ...]] = []
    for step in range(1, setup.steps + 1):
        ahead = predict(belief, expected or moves)
        chosen = choose(Scene(truth, belief.mean, ahead, leader, lambda x: _information(kind, truth.slaves, x)))
        awake = _awake(until, chosen, step, waking)
        measuring = listed(awake, np.arange(awake.shape[1])[None])
        state, places = truth.path[:, step], _places(truth, measuring)
        z, sd = _readings(kind, truth, measuring, places, state, step)
        sd = np.where(_ranges(state[:, None], places)[:, 0] > setup.detect_m, np.inf, sd)
        belief, leader = follow(z, places, sd), chosen.leader
        J = np.linalg.inv(moves.F @ np.linalg.inv(J) @ moves.F.T + moves.Q)
        J = J + np.where(np.isfinite(sd)[..., None, None], _information(kind, places, state), 0.0).sum(axis=1)
        bound = np.sqrt(np.trace(np.linalg.inv(J)[:, :2, :2], axis1=1, axis2=2))
        found.append((belief.mean - state, bound, leader, awake, awake.sum(axis=1) - np.isfinite(sd).sum(axis=1)))
    return Tracks(*(np.stack(each, axis=1) for each in zip(*found, strict=True)))


def _awake(until: Indices, chosen: Chosen, step: int, waking: Waking) -> Flags:
    """Who is awake (R, S) at this step; ``until`` (R, S), the last step at which each is, is brought up to date."""
    run, place = np.nonzero(chosen.slaves != NOBODY)
    slave = chosen.slaves[run, place]
    hears = until[run, slave] >= step - 1 if (step - 1) % waking.listen_every else np.full(len(run), True)
    until[run[hears], slave[hears]] = step - 1 + waking.keep
    return np.asarray(until >= step)


def _places(truth: Truth, measuring: Indices) -> Array:
    """(R, K, 2) of those that measure."""
    return np.take_along_axis(truth.slaves, np.maximum(measuring, 0)[..., None], axis=1)


def _readings(
    kind: Range, truth: Truth, measuring: Indices, places: Array, state: Array, step: int
) -> tuple[Array, Array]:
    """Ranges (R, K), and their sd at the true place, infinite for padding."""
    sd = _sd(kind, state[:, None], places)[:, 0]
    noise = np.take_along_axis(truth.normals[:, step - 1], np.maximum(measuring, 0), axis=1)
    z = _ranges(state[:, None], places)[:, 0] + sd * noise
    return z, np.where(measuring == NOBODY, np.inf, sd)


def _ranges(states: Array, places: Array) -> Array:
    """(R, ..., K) of states (R, ..., 4)."""
    return np.asarray(np.hypot(*np.moveaxis(states[..., None, :2] - _beside(places, states), -1, 0)))


def _beside(places: Array, states: Array) -> Array:
    """Places (R, K, 2) with axes of length 1 for those that states (R, ..., 4) have besides."""
    return places.reshape(len(places), *(1,) * (states.ndim - 2), *places.shape[1:])


def _sd(kind: Range, states: Array, places: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(kind.growth_m * _ranges(states, places), kind.floor_sd_m**2)))


def _information(kind: Range, places: Array, state: Array) -> Array:
    """D (R, K, 4, 4) of ranges from places (R, K, 2) about states (R, 4): eqs. 19 and 20, and the slope of their R."""
    apart = state[:, None, :2] - places
    away = np.maximum(np.hypot(apart[..., 0], apart[..., 1]), 1e-9)
    variance = np.maximum(kind.growth_m * away, kind.floor_sd_m**2)
    grows = kind.growth_m * away > kind.floor_sd_m**2
    weight = 1.0 / variance + np.where(grows, 0.5 / np.square(away), 0.0)
    slope = apart / away[..., None]
    found = np.zeros((*away.shape, 4, 4))
    found[..., :2, :2] = (weight[..., None] * slope)[..., None] * slope[..., None, :]
    return found


Posterior = Callable[[Gaussian, Array, Array, Callable[[Array], Array]], Gaussian]
Follow = Callable[[Array, Array, Array], Gaussian]
"""Readings (R, K), places (R, K, 2) and sds (R, K), infinite for padding: the belief after the step."""


def _by_ukf(
    truth: Truth, moves: Motion, kind: Range, runs: Sequence[int], posterior: Posterior = ukf.posterior
) -> Follow:
    belief = truth.prior

    def follow(z: Array, places: Array, sd: Array) -> Gaussian:
        nonlocal belief
        ahead = predict(belief, moves)
        expected = np.where(np.isfinite(sd), _sd(kind, ahead.mean[:, None], places)[:, 0], np.inf)
        belief = posterior(ahead, z, expected, lambda x: _ranges(x, places))
        return belief

    return follow


def _by_particles(truth: Truth, moves: Motion, kind: Range, runs: Sequence[int]) -> Follow:
    rngs = [generator(run, "ozfidan", "particles") for run in runs]
    root = np.linalg.cholesky(truth.prior.covariance)
    cloud = truth.prior.mean[:, None] + np.stack([r.standard_normal((PARTICLES, 4)) for r in rngs]) @ root.mT
    log_weights = np.zeros(cloud.shape[:2])
    kick = np.linalg.cholesky(moves.Q)

    def follow(z: Array, places: Array, sd: Array) -> Gaussian:
        nonlocal cloud, log_weights
        noise = np.stack([r.standard_normal((PARTICLES, 4)) for r in rngs])
        cloud = cloud @ moves.F.T + noise @ kick.T
        there, own = np.isfinite(sd)[:, None], _sd(kind, cloud, places)
        cost = np.square((z[:, None] - _ranges(cloud, places)) / own) + 2.0 * np.log(own)
        log_weights = log_weights - 0.5 * np.where(there, cost, 0.0).sum(axis=-1)
        log_weights -= log_weights.max(axis=1, keepdims=True)
        weights = np.exp(log_weights)
        weights /= weights.sum(axis=1, keepdims=True)
        mean = np.einsum("rn,rni->ri", weights, cloud)
        apart = cloud - mean[:, None]
        covariance = np.einsum("rn,rni,rnj->rij", weights, apart, apart)
        log_weights = np.log(np.maximum(weights, 1e-300))
        for run in np.flatnonzero(1.0 / np.square(weights).sum(axis=1) < LEAST_EFFECTIVE):
            cloud[run], log_weights[run] = cloud[run][systematic(weights[run], PARTICLES, rngs[run])], 0.0
        return Gaussian(mean, covariance + 1e-9 * np.eye(4))

    return follow


Make = Callable[[Truth, Motion, Range, Sequence[int]], Follow]
FILTERS: Final[dict[str, Make]] = {
    "ukf": _by_ukf,
    "pf": _by_particles,
    "scaled": partial(_by_ukf, posterior=scaled.posterior),
}
"""By name; ``scaled`` is the UKF with the paper's parameters."""
