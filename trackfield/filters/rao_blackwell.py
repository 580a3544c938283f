"""Rao-Blackwellised particles: positions are drawn, velocities are Gaussian given them (Yu et al. 2009, eq. 8).

A particle is a tuple: position, mean and variance of the velocity, unknowns of the sensing, mode, rate of turn. It is
moved, started anew and resampled as a whole; Yu et al. resample the position only. Step 2d and step 6 of their Table 1
are one update here, of the joint Gaussian of velocity and drawn position under one mode (``moved``).

The velocity's variance is one number, the same in all directions: turns and process noise keep it so. Of a prior that
knows one direction better, the particles take over what the other has more (``begin``), which is exact as well.

The likelihood is that of position, unknowns and mean velocity. It is exact for kinds whose readings do not depend on
the velocity; those that allow for the delay of sound or for a window take the mean to say where the target was.

All arrays may have leading axes of runs. A state is (x, y, vx, vy, unknowns), n numbers in all, u of them unknowns.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from trackfield.filters.belief import Modes
from trackfield.filters.gaussian import Motion, root
from trackfield.filters.measurement import STATE, heard
from trackfield.filters.resampling import evenly
from trackfield.filters.turning import Complex, Indices, Turns, rates_of, shares, turned
from trackfield.filters.types import Array, Gaussian, Model, Reports

_LOUDEST = 4
AROUND_M, SPEED_M_S = 40.0, 5.0
"""The sd of position and velocity, per axis, of a track that starts anew around the loudest sensors."""
_TINY = float(np.finfo(np.float64).tiny)


class Cloud(NamedTuple):
    """N particles. ``probability`` is that of the modes at the last step; ``silent`` steps in a row had no reports."""

    points: Array
    """(..., N, n): x, y, the mean of vx, vy, the unknowns."""
    variance: Array
    """(..., N) m^2/s^2, of the velocity per axis."""
    mode: Indices
    """(..., N)"""
    rate: Array
    """(..., N) rad/s"""
    probability: Array
    """(..., M)"""
    silent: Indices
    """(...,)"""


class Start(NamedTuple):
    """The random numbers of a start: for the modes, their rates, and the particles."""

    u: Array | float
    """(...,) uniform"""
    rates: Array
    """(..., N) uniform"""
    normals: Array
    """(..., N, 3 + u)"""


class Draws(NamedTuple):
    """The random numbers of a step: for modes, their rates, the particles' motion, and resampling."""

    modes: Array
    """(..., N) uniform"""
    rates: Array
    """(..., N) uniform"""
    normals: Array
    """(..., N, 2 + u)"""
    u: Array | float
    """(...,) uniform"""


def begin(prior: Modes, draws: Start, turns: Turns) -> Cloud:
    """The particles of a prior: of one Gaussian straight ahead, or of one for each mode of ``turns``."""
    particles, m = draws.rates.shape[-1], len(turns.rates)
    of = evenly(prior.weights, particles, draws.u)
    places = [0, 1, *range(STATE, prior.means.shape[-1])]
    P = prior.covariances[..., places, :][..., places]
    across = prior.covariances[..., 2:STATE, :][..., places]
    gain = across @ np.linalg.pinv(P, hermitian=True)
    values, axes = np.linalg.eigh(prior.covariances[..., 2:STATE, 2:STATE] - gain @ across.mT)
    values = np.maximum(values, 0.0)
    wider = np.sqrt(values[..., 1] - values[..., 0])[..., None] * axes[..., 1]
    away = _times(_of(root(P), of), draws.normals[..., :-1])
    points = _of(prior.means, of)
    points[..., places] += away
    points[..., 2:STATE] += _times(_of(gain, of), away) + draws.normals[..., -1:] * _of(wider, of)
    several = prior.weights.shape[-1] == m
    mode = of if several else np.zeros_like(of)
    probability = prior.weights if several else np.broadcast_to(np.eye(m)[0], (*of.shape[:-1], m))
    variance = np.take_along_axis(values[..., 0], of, axis=-1)
    rate = rates_of(mode, np.full_like(mode, -1), np.zeros(of.shape), draws.rates, turns)
    return Cloud(points, variance, mode, rate, probability, np.zeros(of.shape[:-1], np.intp))


def moved(cloud: Cloud, model: Model, dt: float, normals: Array, q: float) -> Cloud:
    """The particles ``dt`` seconds later, each by its rate; ``q`` m^2/s^3 is the density of the acceleration's noise.

    z' is drawn from N(z + a v, S) with S = |a|^2 p + q dt^3/3, the velocity's uncertainty included. With d = z' - z - a
    v and c = f conj(a) p + q dt^2/2 the velocity becomes f v + (c/S) d, its variance p + q dt - |c|^2/S.
    """
    a, f = turned(cloud.rate, dt)
    p, flow = cloud.variance, _complex(cloud.points[..., :STATE])
    z, v = flow[..., 0], flow[..., 1]
    S = np.maximum(_squared(a) * p + q * dt**3 / 3.0, _TINY)
    c = f * a.conj() * p + q * dt**2 / 2.0
    d = np.sqrt(S) * _complex(normals[..., :2])[..., 0]
    points = np.empty_like(cloud.points)
    later = _complex(points[..., :STATE])
    later[..., 0] = z + a * v + d
    later[..., 1] = f * v + c / S * d
    if model.unknowns:
        walks = np.array([one.walk_sd for one in model.unknowns]) * np.sqrt(dt)
        points[..., STATE:] = cloud.points[..., STATE:] + walks * normals[..., 2:]
    return cloud._replace(points=points, variance=np.maximum(p + q * dt - _squared(c) / S, 0.0))


def renewed(cloud: Cloud, reports: Reports, model: Model, normals: Array, after: int) -> Cloud:
    """The particles anew at the centroid of the loudest sensors, if ``after`` steps without reports came before.

    With ``after`` 0 they never are; else the velocity is then unknown and the target goes straight ahead.
    """
    there = heard(reports)
    silent = np.where(there, 0, cloud.silent + 1)
    anew = there & (cloud.silent >= after) if after else np.zeros_like(there)
    if not anew.any():
        return cloud._replace(silent=silent)
    points = np.zeros_like(cloud.points)
    points[..., :2] = centroid(reports, model)[..., None, :] + AROUND_M * normals[..., :2]
    if model.unknowns:
        mean, sd = np.array([(one.mean, one.sd) for one in model.unknowns]).T
        points[..., STATE:] = mean + sd * normals[..., 2:]
    each, m = anew[..., None], cloud.probability.shape[-1]
    return Cloud(
        np.where(each[..., None], points, cloud.points),
        np.where(each, SPEED_M_S**2, cloud.variance),
        np.where(each, 0, cloud.mode),
        np.where(each, 0.0, cloud.rate),
        np.where(each, np.eye(m)[0], cloud.probability),
        silent,
    )


def believed(weights: Array, cloud: Cloud) -> Gaussian:
    """Mean (..., n) and covariance of weighted particles."""
    return _about((weights[..., None, :] @ cloud.points)[..., 0, :], weights, cloud)


def posterior(weights: Array, cloud: Cloud) -> Gaussian:
    """The same as an estimate: if few particles have all the weight, their own spread says too little.

    So the spread of all about the mean counts as one more sample beside their effective number, as in ``spcpf``.
    """
    effective = 1.0 / np.vecdot(weights, weights)[..., None]
    every = (effective * weights + 1.0 / weights.shape[-1]) / (effective + 1.0)
    return _about((weights[..., None, :] @ cloud.points)[..., 0, :], every, cloud)


def resampled(cloud: Cloud, weights: Array, u: Array | float) -> Cloud:
    """As many particles, drawn by their weights (..., N): each as a whole."""
    chosen = evenly(weights, weights.shape[-1], u)
    points, variance, mode, rate = (_taken(part, chosen) for part in cloud[:4])
    return Cloud(points, variance, mode, rate, cloud.probability, cloud.silent)


def by_mode(cloud: Cloud) -> Modes:
    """A Gaussian for each mode, of particles of equal weight; a mode without particles has that of all."""
    n, m = cloud.mode.shape[-1], cloud.probability.shape[-1]
    equal = np.full(cloud.mode.shape, 1.0 / n)
    every, weights = believed(equal, cloud), shares(equal, cloud.mode, m)
    means, covariances = [], []
    for k in range(m):
        share = weights[..., k : k + 1]
        own = believed(np.where(cloud.mode == k, equal, 0.0) / np.where(share > 0.0, share, 1.0), cloud)
        means.append(np.where(share > 0.0, own.mean, every.mean))
        covariances.append(np.where(share[..., None] > 0.0, own.covariance, every.covariance))
    return Modes(weights, np.stack(means, axis=-2), np.stack(covariances, axis=-3))


def foreseen(then: Array, rate: Array, model: Model, dt: float, q: float) -> Motion:
    """One linear motion for a step of particles with these rates (..., N), from the mean ``then`` (..., n).

    F is the mean over particles; Q has the process noise, and how far their rates take the mean velocity apart.
    """
    a, f = turned(rate, dt)
    both = np.stack((a, f), axis=-1)
    mean = both.mean(axis=-2)
    apart = (both - mean[..., None, :]) * _complex(then[..., 2:STATE])[..., None, :]
    spread = apart.view(float)
    n = then.shape[-1]
    F = np.broadcast_to(np.eye(n), (*rate.shape[:-1], n, n)).copy()
    Q = np.zeros(F.shape)
    for row, number in ((0, mean[..., 0]), (2, mean[..., 1])):
        F[..., row, 2] = F[..., row + 1, 3] = number.real
        F[..., row + 1, 2], F[..., row, 3] = number.imag, -number.imag
    noise = q * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    Q[..., :STATE, :STATE] = np.kron(noise, np.eye(2)) + spread.mT @ spread / rate.shape[-1]
    for i, unknown in enumerate(model.unknowns, STATE):
        Q[..., i, i] = unknown.walk_sd**2 * dt
    return Motion(F, Q)


def centroid(reports: Reports, model: Model) -> Array:
    """The mean place (..., 2) of the loudest sensors."""
    levels = [
        np.where(np.isnan(one.values[..., 0]), -np.inf, model.kinds[one.kind].loudness(one.values))
        for one in reports.readings
    ]
    loud = np.concatenate(levels, axis=-1)
    loudest = np.argsort(-loud, axis=-1, kind="stable")[..., :_LOUDEST]
    weights = np.isfinite(np.take_along_axis(loud, loudest, axis=-1)).astype(float)
    places = np.take_along_axis(reports.positions, loudest[..., None], axis=-2)
    mean: Array = (weights[..., None] * places).sum(axis=-2) / np.maximum(weights.sum(axis=-1), 1.0)[..., None]
    return mean


# --- parts ------------------------------------------------------------------------------------------------------------


def _about(mean: Array, weights: Array, cloud: Cloud) -> Gaussian:
    """The mean, and the spread of weighted particles about it."""
    apart = np.subtract(cloud.points, mean[..., None, :], order="F")  # long loops over particles, as in ``moments``
    apart *= np.sqrt(weights)[..., None]
    covariance = apart.mT @ apart
    inner = np.vecdot(weights, cloud.variance)
    covariance[..., 2, 2] += inner
    covariance[..., 3, 3] += inner
    return Gaussian(mean, covariance)


def _complex(pairs: Array) -> Complex:
    """Numbers (..., 2 k) as (..., k) complex ones; a view."""
    return pairs.view(np.complex128)


def _squared(numbers: Complex) -> Array:
    """The squared absolute values."""
    found: Array = np.square(numbers.real) + np.square(numbers.imag)
    return found


def _of(table: Array, of: Indices) -> Array:
    """The entries (..., N, ...) at ``of`` (..., N) of a table (..., M, ...)."""
    wide = of.reshape(*of.shape, *(1,) * (table.ndim - of.ndim))
    return np.take_along_axis(table, wide, axis=of.ndim - 1)


def _times(matrices: Array, vectors: Array) -> Array:
    """(..., i) of (..., i, j) and (..., j)."""
    product: Array = (matrices @ vectors[..., None])[..., 0]
    return product


def _taken(part: Any, chosen: Indices) -> Any:
    """The entries at ``chosen`` (..., N) of (..., N) or (..., N, n)."""
    if chosen.ndim == 1:
        return part.take(chosen, axis=0)
    return np.take_along_axis(part, chosen.reshape(*chosen.shape, *(1,) * (part.ndim - chosen.ndim)), chosen.ndim - 1)
