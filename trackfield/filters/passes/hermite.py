"""One curved path through the raw reports of several events: a cubic Hermite spline, by least squares.

The knots are the fixes of the events, each with its place and velocity at its time, which stays. Between two knots the
path is the cubic that has both; before the first and after the last it is that of the nearest pair, continued. A
sensor at s hears the target loudest at t + |p(t) - s| / c, where t is its closest point of approach: (p(t) - s) . v(t)
= 0. All strengths tell of the same source level.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.passes.descent import descend
from trackfield.filters.passes.likelihood import Likelihood
from trackfield.filters.passes.types import Event, Flags, Passes, Solved, event_of
from trackfield.filters.types import Array

_ROUNDS: Final = 6
_TINY_M: Final = 1e-3


class Spline(NamedTuple):
    """A path: knots ``states`` (..., E, 4), x, y, vx, vy at ``times_s`` (..., E), and their ``covariance`` (..., E, 4,
    4).

    ``converged`` (...,): whether it is the best; else the knots are NaN.
    """

    times_s: Array
    states: Array
    covariance: Array
    converged: Flags

    def at(self, times_s: Array) -> Array:
        """The states (..., M, 4) at ``times_s`` (..., M)."""
        place, velocity, _ = _moved(self.times_s, self.states, times_s)
        return np.concatenate((place, velocity), axis=-1)


def hermite(passes: Passes, fixes: Solved, *, sound_m_s: float = 340.0) -> Spline:
    """The path of one target through E events in the order of time, arrays (..., E, K), from their ``fixes`` (..., E).

    Reports that the fixes do not use are left out. There must be two fixes at least; without a fix of every event
    there is no path.
    """
    event = event_of(passes)
    knots = fixes.time_s
    epoch = knots[..., :1]
    all_of = _joined(event, fixes, epoch)
    here = _distances(all_of, knots - epoch, fixes.mean)
    spread = event.place_sd / np.maximum(here, event.place_sd + _TINY_M)
    speed = np.linalg.norm(fixes.mean[..., 2:], axis=-1).mean(axis=-1)[..., None]
    noise = _Noise(np.hypot(all_of.time_sd, event.place_sd / speed), np.hypot(all_of.log_sd, spread))
    levels = np.where(all_of.loud, all_of.logs + np.log(here), 0.0)
    level = levels.sum(axis=-1) / np.maximum(all_of.loud.sum(axis=-1), 1)
    flat = fixes.mean.reshape(*fixes.mean.shape[:-2], -1)
    start = np.concatenate((flat, level[..., None]), axis=-1)
    with np.errstate(all="ignore"):
        found = descend(start, lambda x: _likelihood(x, all_of, knots - epoch, noise, sound_m_s), rivals=False)
        information = found.at.information
        scale = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
        both = scale[..., :, None] * scale[..., None, :]
        C = np.linalg.inv(information / both + 1e-12 * np.eye(both.shape[-1])) / both
    states = np.where(found.converged[..., None], found.parameters[..., :-1], np.nan).reshape(fixes.mean.shape)
    blocks = np.stack([C[..., k : k + 4, k : k + 4] for k in range(0, flat.shape[-1], 4)], axis=-3)
    return Spline(knots, states, blocks, found.converged)


class _Noise(NamedTuple):
    """The sds (..., M) of times and logarithms of strengths, as the straight paths say."""

    time: Array
    log: Array


def _joined(event: Event, fixes: Solved, epoch: Array) -> Event:
    """The reports (..., E K) of all events of a path, times from ``epoch``, at their places."""
    axis = event.epoch_s.ndim - 1
    used = event.only(fixes.used)
    absolute = used._replace(
        at=used.at + used.centroid[..., None, :], times=used.times + (used.epoch_s - epoch)[..., None]
    )
    places = absolute.at.reshape(*absolute.at.shape[:axis], -1, 2)
    return absolute.map(lambda part: part.reshape(*part.shape[:axis], -1))._replace(at=places)


def _distances(event: Event, knots: Array, states: Array) -> Array:
    """How far (..., M) the spline passes from the sensors, at least 1 mm."""
    times = _nearest(event, knots, states, event.times)
    place, _, _ = _moved(knots, states, times)
    return np.asarray(np.maximum(np.linalg.norm(place - event.at, axis=-1), _TINY_M))


def _nearest(event: Event, knots: Array, states: Array, times: Array) -> Array:
    """When (..., M) the target is nearest to each sensor, by Newton's method from ``times``."""
    for _ in range(_ROUNDS):
        place, velocity, acceleration = _moved(knots, states, times)
        away = place - event.at
        square = np.square(velocity).sum(axis=-1)
        # where the path turns about the sensor the true slope is no use
        slope = np.maximum(square + (away * acceleration).sum(axis=-1), 0.3 * square)
        times = times - (away * velocity).sum(axis=-1) / slope
    return times


def _likelihood(x: Array, event: Event, knots: Array, noise: _Noise, sound_m_s: float) -> Likelihood:
    """Of knots and source level ``x`` (..., 4 E + 1), by linearisation about the closest points of approach."""
    states = x[..., :-1].reshape(*x.shape[:-1], -1, 4)
    times = _nearest(event, knots, states, event.times)
    place, velocity, acceleration = _moved(knots, states, times)
    away = place - event.at
    d = np.maximum(np.linalg.norm(away, axis=-1), _TINY_M)
    turning = np.square(velocity).sum(axis=-1) + (away * acceleration).sum(axis=-1)
    weights, rates, _ = _weights(knots, times)
    d_slopes = _rows(weights, away / d[..., None])
    t_slopes = d_slopes / sound_m_s - (_rows(weights, velocity) + _rows(rates, away)) / turning[..., None]
    late = np.where(event.heard, (event.times - times - d / sound_m_s) / noise.time, 0.0)
    loud = np.where(event.loud, (event.logs - x[..., -1:] + np.log(d)) / noise.log, 0.0)
    ones = np.ones((*d.shape, 1))
    slopes = np.concatenate(
        (
            np.concatenate((t_slopes, 0.0 * ones), axis=-1) * (event.heard / noise.time)[..., None],
            np.concatenate((-d_slopes / d[..., None], ones), axis=-1) * (event.loud / noise.log)[..., None],
        ),
        axis=-2,
    )
    misses = np.concatenate((late, loud), axis=-1)
    cost = np.square(misses).sum(axis=-1)
    gradient = -np.einsum("...m,...mi->...i", misses, slopes)
    return Likelihood(cost, cost, gradient, np.swapaxes(slopes, -1, -2) @ slopes)


def _moved(knots: Array, states: Array, times: Array) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration (..., M, 2) at ``times`` (..., M)."""
    place, velocity = states[..., :2], states[..., 2:]
    of = (weights[..., 0] @ place + weights[..., 1] @ velocity for weights in _weights(knots, times))
    return tuple(of)  # type: ignore[return-value]


def _weights(knots: Array, times: Array) -> tuple[Array, Array, Array]:
    """The weights (..., M, E, 2) of the knots' places and velocities in the place at ``times``, and two derivatives."""
    after = (times[..., :, None] >= knots[..., None, 1:-1]).sum(axis=-1)
    first = np.take_along_axis(knots, after, axis=-1)
    h = np.take_along_axis(knots, after + 1, axis=-1) - first
    u = (times - first) / h
    one, zero = np.ones_like(u), np.zeros_like(u)
    cubics = (
        (2 * u**3 - 3 * u**2 + one, (u**3 - 2 * u**2 + u) * h, 3 * u**2 - 2 * u**3, (u**3 - u**2) * h),
        ((6 * u**2 - 6 * u) / h, 3 * u**2 - 4 * u + one, (6 * u - 6 * u**2) / h, 3 * u**2 - 2 * u),
        ((12 * u - 6) / h**2, (6 * u - 4) / h, (6 - 12 * u) / h**2, (6 * u - 2) / h + zero),
    )
    found = []
    for p0, v0, p1, v1 in cubics:
        weights = np.zeros((*times.shape, knots.shape[-1], 2))
        for column, (left, right) in enumerate(((p0, p1), (v0, v1))):
            np.put_along_axis(weights[..., column], after[..., None], left[..., None], axis=-1)
            np.put_along_axis(weights[..., column], after[..., None] + 1, right[..., None], axis=-1)
        found.append(weights)
    return found[0], found[1], found[2]


def _rows(weights: Array, vectors: Array) -> Array:
    """The slopes (..., M, 4 E) by the knots of the products of ``vectors`` (..., M, 2) with what ``weights`` give."""
    both: Array = weights[..., :, :, None] * vectors[..., None, None, :]
    return both.reshape(*both.shape[:-3], -1)
