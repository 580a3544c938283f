"""How far off paths are, and the least that any unbiased solver can be off: the Cramer-Rao bound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.passes.geometry import line_of, right, state, state_slopes, unit
from trackfield.filters.passes.likelihood import information, predicted
from trackfield.filters.passes.types import Passes, event_of
from trackfield.filters.types import Array


class Errors(NamedTuple):
    """Of paths: ``location_m`` between their points nearest to the centroid, ``speed_m_s``, ``heading_rad``; (...,)."""

    location_m: Array
    speed_m_s: Array
    heading_rad: Array


def line_errors(mean: Array, truth: Array, centroid: Array) -> Errors:
    """How far paths through the states ``mean`` (..., 4) are from those through ``truth`` (..., 4); none is negative.

    Only lines are compared, not where on them the target is at which time. ``centroid`` (..., 2) is that of the
    sensors.
    """
    points = [_nearest(one, centroid) for one in (mean, truth)]
    speeds = [np.linalg.norm(one[..., 2:4], axis=-1) for one in (mean, truth)]
    (ax, ay), (bx, by) = (np.moveaxis(one[..., 2:4], -1, 0) for one in (mean, truth))
    turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    return Errors(
        np.linalg.norm(points[0] - points[1], axis=-1), np.abs(speeds[0] - speeds[1]), np.asarray(np.abs(turn))
    )


def _nearest(mean: Array, centroid: Array) -> Array:
    """The point (..., 2) of the path through a state that is nearest to ``centroid``."""
    e = unit(mean[..., 2:4])
    away = mean[..., :2] - centroid
    return np.asarray(centroid + away - (away * e).sum(axis=-1, keepdims=True) * e)


def bound(truth: Array, passes: Passes, *, sound_m_s: float = 340.0) -> Array:
    """The Cramer-Rao bound (..., 4, 4) of x, y, vx, vy when the target is nearest to the sensors' centroid.

    ``truth`` (..., 4) is a state on the path at any time. Of ``passes`` only the places, which numbers are known, and
    their noise matter; the source level is unknown.
    """
    event = event_of(passes)
    line = line_of(np.concatenate((truth[..., :2] - event.centroid, truth[..., 2:4]), axis=-1))
    told = predicted(np.concatenate((line, np.zeros_like(line[..., :1])), axis=-1), event, sound_m_s)
    given = np.concatenate((event.heard, event.loud), axis=-1)
    least = np.linalg.inv(information(told, given / told.variance))
    slopes = state_slopes(line)
    return np.asarray(slopes @ least[..., :4, :4] @ np.swapaxes(slopes, -1, -2))


def bound_errors(truth: Array, passes: Passes, *, sound_m_s: float = 340.0) -> Errors:
    """The root mean squares (...,) below which errors as of ``line_errors`` cannot be, of unbiased solvers."""
    event = event_of(passes)
    line = line_of(np.concatenate((truth[..., :2] - event.centroid, truth[..., 2:4]), axis=-1))
    mean, C = state(line), bound(truth, passes, sound_m_s=sound_m_s)
    e = unit(mean[..., 2:4])
    n = right(e)
    speed = np.linalg.norm(mean[..., 2:4], axis=-1)
    ahead, aside = np.concatenate((0.0 * e, e), axis=-1), np.concatenate((0.0 * n, n), axis=-1)
    turned = _quadratic(C, aside) / np.square(speed)
    # the point is b n: it moves by n db and, as n turns by dphi, by b dphi along e
    off = _quadratic(C, np.concatenate((n, 0.0 * n), axis=-1)) + np.square(line[..., 3]) * turned
    return Errors(np.sqrt(off), np.sqrt(_quadratic(C, ahead)), np.sqrt(turned))


def _quadratic(C: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("...i,...ij,...j->...", vector, C, vector))
