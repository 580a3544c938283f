"""The original CPA algorithm (Dommermuth 1988), as Yang et al. restate it in their section 3.1, and its errata.

A lone sensor n0 is the origin; three *far* sensors are on the other side of the path. With the unit vector n = (cos
phi, sin phi) from n0 to the path, at the distance r, and the Mach number M, positive if the target goes from right to
left as seen from n0, v = c M (-sin phi, cos phi). The far sensors are heard c (t_k - t_0) = d_k after n0 (eq. 11), and
their differences from the third are xi, eta, delta (eq. 14).
"""

from __future__ import annotations

from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.passes.geometry import across, arrivals, right
from trackfield.filters.passes.types import (
    DIVIDED_OTHERWISE,
    FIX,
    NEGATIVE,
    NO_SPEED,
    NOT_DIVIDED,
    Codes,
    Event,
    Flags,
    Numbers,
)
from trackfield.filters.types import Array

SIGNS: Final = np.array([1.0, -1.0])
"""Of the Mach number."""
_SAME: Final = 1e-6
"""Misfits that differ by so little, or by so small a share, are the same but for rounding."""


class Far(NamedTuple):
    """Three sensors on one side of the path: ``places`` (..., 3, 2) from n0, m, and ``delays`` d_k (..., 3), m."""

    places: Array
    delays: Array


class Computed(NamedTuple):
    """Solutions (..., 2), one for each of ``SIGNS``: ``mach``, ``phi`` (rad) and ``r`` (m); NaN: no speed."""

    mach: Array
    phi: Array
    r: Array


def mach_number(far: Far) -> Array:
    """|M| (...,) by eq. 18; NaN if its right side is not above 1."""
    b, a = _components(far)
    return np.asarray(1.0 / _root(np.square(a) + np.square(b) - 1.0))


def joint(far: Far) -> Computed:
    """The solutions of all three equations 11: e^(i phi) = (B + i A) / (1 + i / M), one phi for each sign of M."""
    b, a = _components(far)
    mach = SIGNS * mach_number(far)[..., None]
    phi = np.arctan2(a, b)[..., None] - np.arctan2(1.0 / mach, 1.0)
    return Computed(mach, phi, distance(far, mach, phi))


def distance(far: Far, mach: Array, phi: Array) -> Array:
    """r (..., 2) by eq. 15, from the third far sensor."""
    x, y = (far.places[..., 2, axis, None] for axis in (0, 1))
    cos, sin = np.cos(phi), np.sin(phi)
    return np.asarray((x * cos + y * sin + (y * cos - x * sin) / mach - far.delays[..., 2, None]) / 2.0)


def angles(difference: Array, delta: Array, mach: Array) -> Array:
    """The four phi (..., 2, 2) of one pair of far sensors, two for each sign of M, by eq. 19.

    ``difference`` (..., 2) is (xi, eta), ``delta`` (...,) is theirs, ``mach`` (..., 2). Eq. 19 is taken as (xi + eta /
    M) cos phi + (eta - xi / M) sin phi = delta, which follows from eq. 14; its printed form has other signs.
    """
    xi, eta = difference[..., 0, None], difference[..., 1, None]
    return _both(xi + eta / mach, eta - xi / mach, delta[..., None])


def _both(p: Array, q: Array, delta: Array) -> Array:
    """The two solutions of p cos phi + q sin phi = delta, on a new last axis; NaN if there is none."""
    share = delta / np.hypot(p, q)
    turn = np.arccos(np.where(np.abs(share) <= 1.0, share, np.nan))[..., None] * SIGNS
    return np.asarray(np.arctan2(q, p)[..., None] + turn)


def _components(far: Far) -> tuple[Array, Array]:
    """B and A (...,): of the slowness of what the far sensors hear, in units of 1 / c."""
    xi, eta = np.moveaxis(far.places[..., :2, :] - far.places[..., 2:, :], -1, 0)
    delta = far.delays[..., :2] - far.delays[..., 2:]
    d = xi[..., 0] * eta[..., 1] - xi[..., 1] * eta[..., 0]
    b = (delta[..., 0] * eta[..., 1] - delta[..., 1] * eta[..., 0]) / d
    return b, -(delta[..., 0] * xi[..., 1] - delta[..., 1] * xi[..., 0]) / d


def _root(values: Array) -> Array:
    return np.sqrt(np.where(values > 0.0, values, np.nan))


def line_from(origin: Array, time: Array, r: Array, phi: Array, mach: Array, sound_m_s: float) -> Array:
    """The line (..., 4) of a solution about the centroid; n0 is at ``origin`` (..., 2) and hears at ``time``."""
    n = np.stack((np.cos(phi), np.sin(phi)), axis=-1)
    g = -right(n) / (mach * sound_m_s)[..., None]  # v / v^2
    # from right to left as seen from n0 (M > 0), n points to the right of the path
    offset = np.sign(mach) * ((origin * n).sum(axis=-1) + r)
    start = time - r / sound_m_s - (origin * g).sum(axis=-1)
    return np.concatenate((start[..., None], g, offset[..., None]), axis=-1)


def four_of(sides: Array, heard: Flags) -> tuple[Numbers, Flags]:
    """Indices (..., 4) of n0 and three far sensors: the first that there are, as the original takes any.

    ``sides`` (..., K) is 1 or -1 by the side of the path. The far sensors are on that of more. The flags (...,) say
    whether there are such four.
    """
    right_side = heard & (sides > 0)
    left = heard & (sides < 0)
    more = right_side.sum(axis=-1) >= left.sum(axis=-1)
    far, near = np.where(more[..., None], right_side, left), np.where(more[..., None], left, right_side)
    picked = np.concatenate(
        (near.argmax(axis=-1)[..., None], np.argsort(~far, axis=-1, kind="stable")[..., :3]), axis=-1
    )
    return picked, (far.sum(axis=-1) >= 3) & near.any(axis=-1)


class Found(NamedTuple):
    """What the algorithm finds: ``line`` (..., 4), and ``reason`` (...,) why there is none.

    It is computed from the sensors ``four`` (..., 4), n0 first, with the sign of M at ``sign`` (...,) of ``SIGNS``.
    """

    line: Array
    reason: Codes
    four: Numbers
    sign: Numbers


def cpa(event: Event, sides: Array, sound_m_s: float) -> Found:
    """The paths by the original algorithm, if ``sides`` (..., K) are known.

    A solution is accepted if r > 0 and its path divides the sensors as ``sides`` does. Of two, that with the first sign
    counts.
    """
    four, enough = four_of(sides, event.heard)
    lines, r = _of_four(event, four, sound_m_s)
    aside = np.sign(across(lines, event.at[..., None, :, :]))
    agrees = np.asarray(np.abs((aside * sides[..., None, :]).sum(axis=-1)) == np.abs(sides).sum(axis=-1)[..., None])
    sign = ((r > 0.0) & agrees).argmax(axis=-1)
    return Found(_taken(lines, sign), _failures(enough, r, agrees), four, sign)


def tried(event: Event, sound_m_s: float) -> Found:
    """The same if nothing is known: each sensor is tried as the lone one, with any three others as the far ones.

    Accepted is a solution with r > 0 whose path has the lone sensor on one side and the three on the other. Of several,
    the one counts that fits the times of all sensors best.
    """
    count, axis = event.at.shape[-2], event.epoch_s.ndim
    threes = list(combinations(range(count), 3))
    fours = np.array([(k, *three) for k in range(count) for three in threes if k not in three])
    each = event.map(lambda part: np.repeat(np.expand_dims(part, axis), len(fours), axis))
    numbers = np.broadcast_to(fours, (*event.epoch_s.shape, *fours.shape))
    lines, r = _of_four(each, numbers, sound_m_s)
    aside = np.sign(across(lines, np.take_along_axis(each.at, numbers[..., None], axis=-2)[..., None, :, :]))
    enough = np.asarray(event.heard[..., fours].all(axis=-1))
    r = np.where(enough[..., None], r, np.nan)
    agrees = np.asarray((aside[..., 1:] == -aside[..., :1]).all(axis=-1))
    times = arrivals(lines, each.at[..., None, :, :], sound_m_s)
    misses = np.where(each.heard, each.times / each.time_sd, 0.0)[..., None, :] - times / each.time_sd[..., None, :]
    misfit = np.where(each.heard[..., None, :], np.square(misses), 0.0).sum(axis=-1)
    flat = (*event.epoch_s.shape, 2 * len(fours))
    misfit = np.where(agrees & (r > 0.0), misfit, np.inf).reshape(flat)
    # two lone sensors with the same far ones leave the same misfit, each at the other: the earlier one counts
    as_good = misfit <= misfit.min(axis=-1, keepdims=True) * (1.0 + _SAME) + _SAME
    when = np.repeat(event.times[..., fours[:, 0]], 2, axis=-1)
    choice = np.where(as_good, when, np.inf).argmin(axis=-1)
    reason = _failures(np.asarray(enough.any(axis=-1)), r.reshape(flat), agrees.reshape(flat))
    return Found(_taken(lines.reshape(*flat, 4), choice), reason, fours[choice // 2], choice % 2)


def alike(event: Event, found: Found, sound_m_s: float) -> tuple[Array, Codes]:
    """The lines (..., 4) from the same sensors with the same sign of M, whether accepted or not; NaN: no speed."""
    four = np.broadcast_to(found.four, (*event.epoch_s.shape, 4))
    lines, _ = _of_four(event, four, sound_m_s)
    line = _taken(lines, np.broadcast_to(found.sign, event.epoch_s.shape))
    return line, np.where(np.isnan(line).any(axis=-1), np.uint8(NO_SPEED), np.uint8(FIX))


def _taken(lines: Array, number: Numbers) -> Array:
    """One (..., 4) of lines (..., S, 4)."""
    return np.take_along_axis(lines, number[..., None, None], axis=-2)[..., 0, :]


def _of_four(event: Event, four: Numbers, sound_m_s: float) -> tuple[Array, Array]:
    """The lines (..., 2, 4) from n0 and three far sensors, numbers (..., 4), for each sign of M, and r (..., 2)."""
    at = np.take_along_axis(event.at, four[..., None], axis=-2)
    times = np.take_along_axis(event.times, four, axis=-1)
    far = Far(at[..., 1:, :] - at[..., :1, :], sound_m_s * (times[..., 1:] - times[..., :1]))
    mach, phi, r = joint(far)
    return line_from(at[..., :1, :], times[..., :1], r, phi, mach, sound_m_s), r


def _failures(enough: Flags, r: Array, agrees: Flags) -> Codes:
    """How far the algorithm comes: reasons (...,) of solutions (..., S)."""
    positive = r > 0.0
    failed = (~enough, np.isnan(r).all(axis=-1), ~positive.any(axis=-1), ~(positive & agrees).any(axis=-1))
    return np.select(failed, (NOT_DIVIDED, NO_SPEED, NEGATIVE, DIVIDED_OTHERWISE), FIX).astype(np.uint8)
