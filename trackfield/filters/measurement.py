"""The reports of a step as one measurement vector, for filters that take any kind of sensing.

Its numbers are those of the first sensor, then those of the second, and so on: m of each, K m in all, or with several
kinds the sum of K m over kinds. States (..., 4 + u) have the unknowns of all kinds after (x, y, vx, vy); they may have
leading batch axes.

The arrays of reports may have leading axes, too: those of runs, one step of each. States then have the same axes
first. Runs with fewer reports than others are padded: a reading of NaN says nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import exp, log
from typing import Final

import numpy as np
import numpy.typing as npt

from trackfield.filters.bounds import information
from trackfield.filters.gaussian import Motion, constant_velocity
from trackfield.filters.parts import OWN, Part, flat, joined, parts_of, rows, spread
from trackfield.filters.robust import tailed
from trackfield.filters.types import Array, Gaussian, Model, Reports
from trackfield.models.unknowns import Unknown

STATE: Final = OWN
"""The numbers of a state that are not unknowns of the sensing: x, y, vx, vy."""
_PER_DB: Final = log(10.0) / 10.0
Indices = npt.NDArray[np.intp]
Map = Callable[[Array], Array]


def measured(model: Model, reports: Reports) -> Array:
    """The readings z (K m,)."""
    return joined([flat(part.z) for part in parts_of(model, reports)])


def heard(reports: Reports) -> npt.NDArray[np.bool_]:
    """Whether there are any readings (...,) besides padding."""
    found = [~np.isnan(one.values).all(axis=(-2, -1)) for one in reports.readings if one.values.size]
    return np.asarray(np.logical_or.reduce(found)) if found else np.zeros(reports.positions.shape[:-2], bool)


def noise_sd(model: Model, reports: Reports, states: Array | None = None) -> Array:
    """The noise's sd of each of them (K m,), or (..., K m) at ``states`` (..., 4 + u) where it depends on them.

    Raises ``ValueError`` if it depends on the state, and none is given.
    """
    found = []
    for part in parts_of(model, reports):
        if part.values.ndim > 2:
            found.append(_batched_sd(part, states))
        elif part.kind.variance is None:
            found.append(_repeated(tuple(part.kind.sd), len(part.values)))
        elif states is None:
            raise ValueError("the noise of this kind of sensing depends on the state; expected states")
        else:
            found.append(np.sqrt(flat(part.variance(states))))
    if len(found) > 1:
        batch = np.broadcast_shapes(*(one.shape[:-1] for one in found))
        found = [np.broadcast_to(one, (*batch, one.shape[-1])) for one in found]
    return joined(found)


@lru_cache(maxsize=64)
def _repeated(sd: tuple[float, ...], count: int) -> Array:
    """The sds (m,) of so many readings (count m,), made once and then shared."""
    found = np.tile(np.asarray(sd, float), count)
    found.flags.writeable = False
    return found


def _batched_sd(part: Part, states: Array | None) -> Array:
    """The sd of readings with leading axes (runs..., k m), or (runs..., ..., k m) at states; infinite for padding."""
    values, padded = part.z, part.padded
    if part.kind.variance is not None and states is None:
        raise ValueError("the noise of this kind of sensing depends on the state; expected states")
    sd = np.broadcast_to(np.asarray(part.kind.sd, float), values.shape)
    if states is None:
        return flat(sd if padded is None else sd + padded)
    sd = spread(sd, states) if part.kind.variance is None else np.sqrt(part.variance(states))
    return flat(sd if padded is None else sd + spread(padded, states))


@lru_cache(maxsize=64)
def varies(model: Model) -> bool:
    """Whether the noise of any kind depends on the state."""
    return any(kind.variance is not None for kind in model.kinds.values())


def expected(model: Model, states: Array, reports: Reports) -> Array:
    """h(x) (..., K m): the noiseless readings of ``states`` (..., 4 + u)."""
    parts = parts_of(model, reports)
    return flat(parts[0].h(states)) if len(parts) == 1 else joined([flat(part.h(states)) for part in parts])


def jacobians(model: Model, states: Array, reports: Reports) -> Array:
    """dh/dx (..., K m, 4 + u) at ``states`` (..., 4 + u)."""
    parts = parts_of(model, reports)
    if len(parts) == 1:
        return rows(parts[0].jacobian(states))
    return joined([rows(part.jacobian(states)) for part in parts], axis=-2)


def problem(model: Model, reports: Reports) -> tuple[Array, Map, Map]:
    """``measured``, and ``expected`` and ``residual`` as functions of states, and of differences, alone."""
    parts = parts_of(model, reports)
    if len(parts) > 1 or not parts or parts[0].kind.m > 1:
        z = measured(model, reports)
        return z, lambda states: expected(model, states, reports), lambda apart: residual(model, reports, apart)
    h, within, z = parts[0].h, parts[0].kind.residual, parts[0].z[..., 0]
    return z, lambda states: h(states)[..., 0], lambda apart: np.asarray(within(apart[..., None]), float)[..., 0]


def residual(model: Model, reports: Reports, difference: Array) -> Array:
    """Differences of readings (..., K m) in their valid range; angles are wrapped."""
    parts, first = [], 0
    for part in parts_of(model, reports):
        count = part.values.shape[-2] * part.kind.m
        apart = difference if count == difference.shape[-1] else difference[..., first : first + count]
        first += count
        each = apart[..., None] if part.kind.m == 1 else apart.reshape(*apart.shape[:-1], -1, part.kind.m)
        parts.append(flat(np.asarray(part.kind.residual(each), float)))
    return joined(parts)


def innovations(model: Model, states: Array, reports: Reports) -> Array:
    """z - h(x) (..., K m) for ``states`` (..., 4 + u)."""
    parts = parts_of(model, reports)
    return flat(parts[0].misses(states)) if len(parts) == 1 else joined([flat(part.misses(states)) for part in parts])


def linearised(model: Model, state: Array, reports: Reports) -> tuple[Array, Array, Array]:
    """At a ``state`` (..., 4 + u): z - h(x) (..., K m), dh/dx (..., K m, 4 + u), and the noise's sd (..., K m)."""
    parts = parts_of(model, reports)
    if len(parts) > 1 or not parts:
        return innovations(model, state, reports), jacobians(model, state, reports), noise_sd(model, reports, state)
    (part,) = parts
    same = part.kind.variance is None and part.z.ndim == 2
    sd = _repeated(tuple(part.kind.sd), len(part.z)) if same else noise_sd(model, reports, state)
    return flat(part.misses(state)), rows(part.jacobian(state)), sd


def log_likelihood(model: Model, states: Array, reports: Reports, *, robust: bool = False) -> Array:
    """log p(z | x) (...,) of all readings for ``states`` (..., 4 + u), up to a constant.

    With ``robust`` the noise of each number has the tails of outliers (``robust.tailed``).
    """
    parts = parts_of(model, reports)
    if len(parts) == 1 and parts[0].kind.variance is None and parts[0].kind.m == 1 and not robust:  # fewer calls
        miss = flat(parts[0].misses(states))
        likely: Array = np.vecdot(miss, miss)
        likely *= -0.5 / parts[0].kind.sd[0] ** 2
        return likely
    log_weights = np.zeros(states.shape[:-1])
    for part in parts:
        kind, miss = part.kind, part.misses(states)
        if kind.variance is None:
            for j, sd in enumerate(kind.sd):
                if robust:
                    log_weights -= 0.5 * tailed(np.square(miss[..., j] / sd)).sum(axis=-1)
                else:
                    log_weights += np.vecdot(miss[..., j], miss[..., j]) * (-0.5 / sd**2)
        else:
            variance = part.variance(states)
            squares = np.square(miss) / variance
            cost = (tailed(squares) if robust else squares) + np.log(variance)
            if (padded := part.padded) is not None:
                cost = np.where(spread(padded, states) > 0.0, 0.0, cost)
            log_weights -= 0.5 * cost.sum(axis=(-2, -1))
    return log_weights


def log_ratios(model: Model, belief: Gaussian, reports: Reports) -> Array:
    """Log of the density of each reading (K,) from the ``belief`` to that of one from anywhere.

    Only of kinds that know the latter (``log_clutter``); the belief is over (4 + u,).
    """
    found = []
    for part in parts_of(model, reports):
        kind, at = part.kind, part.positions
        if kind.log_clutter is None or not len(at):
            continue
        H, miss = part.jacobian(belief.mean), part.misses(belief.mean)
        if kind.m == 1:  # in numbers, which takes half the time
            H, miss = H[:, 0], miss[:, 0]
            S = np.vecdot(H @ belief.covariance, H)
            S += kind.sd[0] ** 2 if kind.variance is None else part.variance(belief.mean)[:, 0]
            miss *= miss
            miss /= S
            S *= 2.0 * np.pi
            cost = miss + np.log(S)
        else:
            R = np.square(np.asarray(kind.sd, float)) if kind.variance is None else part.variance(belief.mean)
            S = H @ belief.covariance @ H.mT + R[..., None] * np.eye(kind.m)
            square = np.vecdot(miss, np.linalg.solve(S, miss[..., None])[..., 0])
            cost = square + np.linalg.slogdet(2.0 * np.pi * S)[1]
        cost *= -0.5
        cost -= kind.log_clutter(part.values, at)
        found.append(cost)
    return joined(found)


def log_anywhere(model: Model, reports: Reports) -> Array:
    """Log of the density of each reading (K,) if it comes from anywhere but the target; NaN: its kind does not know."""
    found = []
    for part in parts_of(model, reports):
        density, at = part.kind.log_clutter, part.positions
        found.append(np.full(len(at), np.nan) if density is None else np.asarray(density(part.values, at), float))
    return joined(found)


def shares(model: Model, reports: Reports) -> Array:
    """Each sensor's share (..., K) in what all sensors of its kind received; a kind's share is that of its readings.

    Shares are of power, from the loudness in dB (Zhai et al. 2009, sec. III-A). Padding has none.
    """
    found = []
    for part in parts_of(model, reports):
        loudness = np.asarray(part.kind.loudness(part.values), float)
        if loudness.ndim > 1:
            loudness = np.where(np.isnan(part.values[..., 0]), -np.inf, loudness)
        found.append(intensity_weights(loudness))
    if len(found) == 1:
        return found[0]
    return joined([one * (one.shape[-1] / reports.positions.shape[-2]) for one in found])


def intensity_weights(levels: Array) -> Array:
    """Each sensor's share (..., K) in the received power, from levels in dB (Zhai et al. 2009, sec. III-A)."""
    if not levels.shape[-1]:
        return levels
    if levels.ndim == 1:  # in numbers, which takes a third of the time
        numbers = levels.tolist()
        loudest = max(numbers)
        powers = [exp((one - loudest) * _PER_DB) for one in numbers]
        return np.array(powers) / sum(powers)
    power: Array = levels - np.maximum.reduce(levels, axis=-1, keepdims=True)
    power *= _PER_DB
    np.exp(power, out=power)
    power /= np.add.reduce(power, axis=-1, keepdims=True)
    return power


def owners(model: Model, reports: Reports) -> Indices:
    """Which report (K m,) each number of the measurement vector belongs to."""
    counts = np.concatenate([np.full(part.values.shape[-2], part.kind.m) for part in parts_of(model, reports)])
    return np.arange(len(counts)).repeat(counts)


def log_noise_slopes(model: Model, state: Array, reports: Reports) -> Array:
    """d log R / dx (K m, 4 + u) at a ``state`` (4 + u,), by central differences."""
    step = 1e-5 * np.maximum(np.abs(state), 1.0)
    ends = state + np.stack((np.diag(step), -np.diag(step)))
    up, down = (2.0 * np.log(noise_sd(model, reports, these)) for these in ends)
    return np.asarray(((up - down) / (2.0 * step[:, None])).T)


def sensing_information(model: Model, state: Array, reports: Reports) -> Array:
    """D (4 + u, 4 + u): the Fisher information of the readings about a ``state`` (4 + u,).

    H^T R^-1 H, and where the noise depends on the state half the squared slopes of log R (Kay 1993, eq. 3.31).
    """
    D = information(jacobians(model, state, reports), noise_sd(model, reports, state))
    if varies(model):
        slopes = log_noise_slopes(model, state, reports)
        D = D + 0.5 * slopes.T @ slopes
    return D


# --- unknowns of the sensing ------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def moving(model: Model, dt: float, sigma_v: float | None = None) -> Motion:
    """Nearly constant velocity over ``dt`` seconds, the unknowns of the sensing as random walks beside it."""
    motion = constant_velocity(dt, model.sigma_v if sigma_v is None else sigma_v)
    return widened(motion, model.unknowns, dt) if model.unknowns else motion


def widened(motion: Motion, unknowns: tuple[Unknown, ...], dt: float) -> Motion:
    """A motion (4, 4) with random walks of these unknowns beside it: (4 + u, 4 + u)."""
    walks = np.array([one.walk_sd for one in unknowns]) ** 2 * dt
    return Motion(_beside(motion.F, np.eye(len(unknowns))), _beside(motion.Q, np.diag(walks)))


def extended(belief: Gaussian, unknowns: tuple[Unknown, ...]) -> Gaussian:
    """A belief over (x, y, vx, vy) with what is known of the unknowns at the start: (4 + u,)."""
    if not unknowns or len(belief.mean) > STATE:
        return belief
    mean = np.append(belief.mean, [one.mean for one in unknowns])
    return Gaussian(mean, _beside(belief.covariance, np.diag([one.sd**2 for one in unknowns])))


def _beside(a: Array, b: Array) -> Array:
    """Two square matrices along the diagonal of one."""
    n = len(a) + len(b)
    matrix = np.zeros((n, n))
    matrix[: len(a), : len(a)], matrix[len(a) :, len(a) :] = a, b
    return matrix
