"""Where a path of known direction lies, from the strengths alone: s_k ~ 1 / d_k, the source level unknown.

The path is where log(d_k s_k) is most nearly the same for all sensors; it is searched on a grid. (Yang et al.'s eq. 34
takes the two weakest only, which is ill-conditioned.)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trackfield.filters.passes.geometry import dot, right, unit
from trackfield.filters.passes.types import Event
from trackfield.filters.types import Array

_POINTS = 64
_FINER = 12
_TINY_M = 1e-6


def spread(event: Event, direction: Array, offsets: Array) -> Array:
    """The squared spread of log(d_k s_k), in its sd, if the path lies at ``offsets`` (..., G) right of the centroid."""
    aside = dot(event.at, right(unit(direction)))
    d = np.maximum(np.abs(aside[..., None, :] - offsets[..., :, None]), _TINY_M)
    weights = np.where(event.loud, 1.0 / np.square(event.log_sd), 0.0)[..., None, :]
    levels = event.logs[..., None, :] + np.log(d)
    total = np.maximum(weights.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    mean = (weights * levels).sum(axis=-1, keepdims=True) / total
    return np.asarray((weights * np.square(levels - mean)).sum(axis=-1))


def extent(event: Event, direction: Array) -> tuple[Array, Array]:
    """How far to the right of the centroid sensors stand, seen along the path: the least and the most (...,), m."""
    aside = dot(event.at, right(unit(direction)))
    return (
        np.where(event.heard, aside, np.inf).min(axis=-1, initial=np.inf),
        np.where(event.heard, aside, -np.inf).max(axis=-1, initial=-np.inf),
    )


def located(event: Event, direction: Array) -> Array:
    """The offset (...,) of the path along ``direction`` (..., 2), through the hull of the sensors as in eq. 34."""
    ends = low, high = extent(event, direction)
    points = _POINTS
    for finer in (_FINER, _FINER, 0):
        grid = _between(low, high, points)
        least = spread(event, direction, grid).argmin(axis=-1)[..., None]
        best, step = np.take_along_axis(grid, least, axis=-1)[..., 0], (high - low) / points
        low, high, points = np.maximum(best - step, ends[0]), np.minimum(best + step, ends[1]), finer
    return best


def candidates(event: Event, direction: Array, count: int, margin: float = 1.0) -> Array:
    """(..., count): offsets at the deepest minima of the spread, outside of the hull up to ``margin`` half widths.

    If there are fewer, the deepest is repeated.
    """
    low, high = extent(event, direction)
    outside = margin * (high - low) / 2.0
    grid = _between(low - outside, high + outside, _POINTS)
    cost = spread(event, direction, grid)
    padded = np.pad(cost, [(0, 0)] * (cost.ndim - 1) + [(1, 1)], constant_values=np.inf)
    minimum = (cost <= padded[..., :-2]) & (cost < padded[..., 2:])
    order: npt.NDArray[np.intp] = np.argsort(np.where(minimum, cost, np.inf), axis=-1)[..., :count]
    found = np.take_along_axis(minimum, order, axis=-1)
    return np.take_along_axis(grid, np.where(found, order, order[..., :1]), axis=-1)


def _between(low: Array, high: Array, points: int) -> Array:
    """(..., points) evenly between the ends, which are left out: a sensor stands there."""
    share = (np.arange(points) + 0.5) / points
    return np.asarray(low[..., None] + (high - low)[..., None] * share)
