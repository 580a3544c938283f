"""Maximum likelihood over all reports of an event: CPA times, strengths, and how well the places are known.

The cost has a minimum in each way in which the path may divide the sensors, so it is descended from several offsets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from trackfield.filters.passes.descent import descend
from trackfield.filters.passes.ecpa import ecpa
from trackfield.filters.passes.geometry import across, state, state_slopes
from trackfield.filters.passes.likelihood import likelihood
from trackfield.filters.passes.plane import fitted
from trackfield.filters.passes.strength import candidates
from trackfield.filters.passes.types import Event, Flags
from trackfield.filters.types import Array

OFFSETS: Final = 3
MOST: Final = 8
"""CPA and ECPA try each few sensors of so many at most."""
_SHARE: Final = 0.9
"""The best path must be nine times as probable as all others together."""
_NEGLIGIBLE: Final = 1e-4
"""Paths that are less probable do not count, as their covariances may be immense."""
_APART: Final = 25.0
"""Squared, in sds: lines that are so far from each other are different minima."""


class Best(NamedTuple):
    """The likeliest path of each event."""

    line: Array
    """(..., 4)"""
    covariance: Array
    """(..., 4, 4) of the state at the line's time; less probable paths count by their probability."""
    chi2: Array
    """(...,) of what it leaves of the numbers reported."""
    information: Array
    """(..., 4, 4) about the line, the source level unknown."""
    freedom: Array
    """(...,) how many these are, less the five parameters."""
    converged: Flags
    ambiguous: Flags
    """(...,) whether another path is about as likely."""

    def map(self, change: Callable[[Any], Any]) -> Best:
        """The paths with ``change`` made to each array."""
        return Best(*map(change, self))


def likeliest(event: Event, sound_m_s: float) -> Best:
    """The likeliest path of each event; its fields mean nothing where fewer than three sensors reported."""
    starts = _starts(event, sound_m_s)
    each = event.spread()
    found = descend(starts, lambda parameters: likelihood(parameters, each, sound_m_s), rivals=True)
    cost = np.where(np.isfinite(found.at.cost), found.at.cost, np.inf)
    best = cost.argmin(axis=-1)[..., None]
    line = np.take_along_axis(found.parameters, best[..., None], axis=-2)[..., 0, :4]
    known = _of_lines(found.at.information)
    covariance, share = _mixed(found.parameters[..., :4], known, cost, line)
    return Best(
        line,
        covariance,
        np.take_along_axis(found.at.chi2, best, axis=-1)[..., 0],
        np.take_along_axis(known, best[..., None, None], axis=-3)[..., 0, :, :],
        event.heard.sum(axis=-1) + event.loud.sum(axis=-1) - 5,
        np.take_along_axis(found.converged, best, axis=-1)[..., 0],
        share < _SHARE,
    )


def _mixed(lines: Array, known: Array, cost: Array, line: Array) -> tuple[Array, Array]:
    """The covariance (..., 4, 4) of the state about the best ``line``, and the probability (...,) of that line.

    The different paths among ``lines`` (..., S, 4) are as probable as they are likely.
    """
    away = lines[..., :, None, :] - lines[..., None, :, :]
    same = ~apart(away, known[..., None, :, :])
    before = np.tril(np.ones(same.shape[-2:], bool), -1)
    # of those that are the same the best counts
    worse = (cost[..., None] > cost[..., None, :]) | ((cost[..., None] == cost[..., None, :]) & before)
    double = (same & worse).any(axis=-1)
    around = _inverse(known)
    share = np.where(double, 0.0, np.exp(-0.5 * (cost - cost.min(axis=-1, keepdims=True))))
    share = share / share.sum(axis=-1, keepdims=True)
    slopes, states = state_slopes(lines), state(lines)
    states[..., :2] += states[..., 2:] * (line[..., None, 0] - lines[..., 0])[..., None]
    off = states - state(line)[..., None, :]
    each = slopes @ around @ np.swapaxes(slopes, -1, -2) + off[..., :, None] * off[..., None, :]
    used = share > _NEGLIGIBLE
    C = np.where(used[..., None, None], share[..., None, None] * each, 0.0).sum(axis=-3)
    return C, np.take_along_axis(share, cost.argmin(axis=-1)[..., None], axis=-1)[..., 0]


def _starts(event: Event, sound_m_s: float) -> Array:
    """(..., S, 5): where descents begin, along the directions of a plane and of ECPA."""
    flat = fitted(event, event.times)
    enhanced, _ = ecpa(event.loudest(MOST)[0], sound_m_s, location="all")
    enhanced = np.where(np.isfinite(enhanced).all(axis=-1, keepdims=True), enhanced, flat)
    many = np.repeat(np.stack((flat, enhanced), axis=-2), OFFSETS, axis=-2)
    many[..., 3] = np.concatenate([candidates(event, one[..., 1:3], OFFSETS) for one in (flat, enhanced)], axis=-1)
    d = np.maximum(np.abs(across(many, event.at[..., None, :, :])), 1e-3)
    loud = event.loud[..., None, :]
    level = np.where(loud, event.logs[..., None, :] + np.log(d), 0.0).sum(axis=-1) / np.maximum(loud.sum(axis=-1), 1)
    return np.concatenate((many, level[..., None]), axis=-1)


def apart(away: Array, information: Array) -> Flags:
    """Whether lines ``away`` (..., 4) from another are not just inaccurate estimates of the same."""
    return np.asarray(np.einsum("...i,...ij,...j->...", away, information, away) > _APART)


def _of_lines(information: Array) -> Array:
    """(..., 4, 4): the information about lines if the source level is not known."""
    level = np.maximum(information[..., 4:, 4:], np.finfo(float).tiny)
    return np.asarray(information[..., :4, :4] - information[..., :4, 4:] * information[..., 4:, :4] / level)


def _inverse(information: Array) -> Array:
    """The covariance (..., 4, 4), huge in directions that are not observed at all."""
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), np.finfo(float).tiny))
    both = scale[..., :, None] * scale[..., None, :]
    return np.asarray(np.linalg.inv(information / both + 1e-12 * np.eye(scale.shape[-1])) / both)
