"""The likelihood of a path, given the CPA times and strengths of all sensors that reported.

The parameters (..., 5) are a line (``geometry``) and L, the logarithm of the amplitude at 1 m. Sensor k reports
t_k = T + g . s_k + |q_k| / c and log s_k = L - log |q_k|, each with independent Gaussian noise. If the places are known
with an sd of p per axis, a sensor is off along the path, which shifts its time by p |g|, and off across it, by u. The
moments are taken as

    mean |q + u|      sqrt(q^2 + .6366 p^2)
    mean log |q + u|  log(q^2 + .2807 p^2) / 2,  variance p^2 / (q^2 + .8106 p^2),

which are exact for q = 0 (2 / pi = .6366, exp(-euler_gamma) / 2 = .2807, 8 / pi^2 = .8106) and for q >> p.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from trackfield.filters.passes.types import Event
from trackfield.filters.types import Array

_DISTANCE_AT_0 = 2.0 / math.pi
_MEAN_AT_0 = math.exp(-np.euler_gamma) / 2.0
_VARIANCE_AT_0 = 8.0 / math.pi**2
_TINY_M2 = 1e-12


class Likelihood(NamedTuple):
    """Of parameters (..., 5): ``cost`` (...,) is -2 log likelihood but for a constant, ``chi2`` (...,) its misses only.

    ``gradient`` (..., 5) is that of cost / 2, ``information`` (..., 5, 5) Fisher's.
    """

    cost: Array
    chi2: Array
    gradient: Array
    information: Array


class Predicted(NamedTuple):
    """The 2 K numbers of an event, times first, for parameters (..., 5).

    ``mean`` and ``variance`` (..., 2 K), their ``slopes`` (..., 2 K, 5) and those of log variance, ``log_slopes``;
    None: the variance is the same everywhere.
    """

    mean: Array
    variance: Array
    slopes: Array
    log_slopes: Array | None


def predicted(parameters: Array, event: Event, sound_m_s: float) -> Predicted:
    """What is reported by sensors at the places of ``event``, from a target on the line."""
    g, p2 = parameters[..., None, 1:3], event.place_sd**2
    slowness2 = g[..., 0] ** 2 + g[..., 1] ** 2
    e = g / np.sqrt(slowness2)[..., None]
    x, y, ex, ey = event.at[..., 0], event.at[..., 1], e[..., 0], e[..., 1]
    q = x * ey - y * ex - parameters[..., 3:4]
    turn = -(x * ex + y * ey) / np.sqrt(slowness2)  # dq/dg along n
    q2 = q * q
    d, soft = np.sqrt(q2 + _DISTANCE_AT_0 * p2 + _TINY_M2), q2 + _MEAN_AT_0 * p2 + _TINY_M2
    count = q.shape[-1]
    slopes = np.zeros((*q.shape[:-1], 2 * count, 5))
    times, logs = slopes[..., :count, :], slopes[..., count:, :]
    times[..., 0], logs[..., 4] = 1.0, 1.0
    for part, by_q in ((times, q / (d * sound_m_s)), (logs, -q / soft)):
        part[..., 1], part[..., 2], part[..., 3] = by_q * turn * ey, -by_q * turn * ex, -by_q
    times[..., 1:3] += event.at
    mean = np.empty(slopes.shape[:-1])
    mean[..., :count] = parameters[..., :1] + x * g[..., 0] + y * g[..., 1] + d / sound_m_s
    mean[..., count:] = parameters[..., 4:] - 0.5 * np.log(soft)
    variance = np.empty_like(mean)
    variance[..., :count], variance[..., count:] = event.time_sd**2, event.log_sd**2
    if p2 == 0.0:
        return Predicted(mean, variance, slopes, None)
    wide = q2 + _VARIANCE_AT_0 * p2 + _TINY_M2
    variance[..., :count] += p2 * slowness2
    variance[..., count:] += p2 / wide
    log_slopes = np.zeros_like(slopes)
    log_slopes[..., :count, 1:3] = 2.0 * p2 * g / variance[..., :count, None]
    by_q = -2.0 * p2 * q / (wide * wide * variance[..., count:])
    part = log_slopes[..., count:, :]
    part[..., 1], part[..., 2], part[..., 3] = by_q * turn * ey, -by_q * turn * ex, -by_q
    return Predicted(mean, variance, slopes, log_slopes)


def likelihood(parameters: Array, event: Event, sound_m_s: float) -> Likelihood:
    """Of the path ``parameters`` (..., 5), with Fisher's information (Kay 1993, eqs. 3.31 and 3.32)."""
    told = predicted(parameters, event, sound_m_s)
    given = np.concatenate((event.heard, event.loud), axis=-1)
    share = given / told.variance
    misses = np.where(given, np.concatenate((event.times, event.logs), axis=-1) - told.mean, 0.0)
    chi2 = (misses * misses * share).sum(axis=-1)
    cost, gradient = chi2, -((misses * share)[..., None, :] @ told.slopes)[..., 0, :]
    if told.log_slopes is not None:
        cost = chi2 + (given * np.log(told.variance)).sum(axis=-1)
        surprise = given - misses * misses * share
        gradient = gradient + 0.5 * (surprise[..., None, :] @ told.log_slopes)[..., 0, :]
    return Likelihood(cost, chi2, gradient, information(told, share))


def information(told: Predicted, share: Array) -> Array:
    """Fisher's information (..., 5, 5); ``share`` (..., 2 K) is 1 / variance of the numbers given, 0 of others."""
    found: Array = np.swapaxes(told.slopes, -1, -2) @ (told.slopes * share[..., None])
    if told.log_slopes is not None:
        found = found + np.swapaxes(told.log_slopes, -1, -2) @ (told.log_slopes * (0.5 * (share > 0.0))[..., None])
    return found
