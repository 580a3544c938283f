"""Which fits to believe: whether reports are of one pass, whether one of them is bad, whether they determine a path."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri

from trackfield.filters.passes.geometry import right, unit
from trackfield.filters.passes.ml import Best, apart, likeliest
from trackfield.filters.passes.types import (
    AMBIGUOUS,
    DIVERGED,
    FEW,
    FIX,
    IN_LINE,
    NO_PASS,
    UNCERTAIN,
    Codes,
    Event,
    Flags,
)
from trackfield.filters.types import Array

_FREEDOM: Final = 5
"""Five reports are ten numbers, of which a path and the source level take five."""
_NARROW: Final = 0.1
_REST: Final = 0.05
"""Without the report that is taken for bad, the others must fit better than the worst one in twenty sets of a pass.

There are as many reports to leave out as there are reports: by the gate alone, twice as many sets of random times pass.
"""
_AS_GOOD: Final = 4.0
"""A report is not known to be the bad one if without another chi^2 is less than this above."""


class Judged(NamedTuple):
    """The path of each event, the reports ``used`` (..., K), and why there is none, ``reason`` (...,)."""

    best: Best
    used: Flags
    reason: Codes


def refused(event: Event, least: int) -> Codes:
    """Whether there are reports enough, and not in a line: reasons (...,)."""
    reason = np.full(event.epoch_s.shape, FIX, np.uint8)
    heard, count = event.heard[..., None], event.heard.sum(axis=-1)
    middle = np.where(heard, event.at, 0.0).sum(axis=-2) / np.maximum(count, 1)[..., None]
    away = np.where(heard, event.at - middle[..., None, :], 0.0)
    squares = np.linalg.eigvalsh(np.swapaxes(away, -1, -2) @ away)  # also of a single report
    reason[squares[..., 0] < _NARROW**2 * squares[..., 1]] = IN_LINE
    reason[count < least] = FEW
    return reason


def judged(event: Event, sound_m_s: float, gate: float, least: int) -> Judged:
    """The likeliest path of each event, (N, ...) arrays; without the one report that is bad, if one is."""
    reason = refused(event, least)
    best, used = likeliest(event, sound_m_s), event.heard.copy()
    rare = float(chdtrc(_FREEDOM, gate))
    limit = likely(best, rare)
    suspect = (reason == FIX) & (best.chi2 > limit) & (event.heard.sum(axis=-1) > least)
    if suspect.any():
        rest = event.map(lambda part: part[suspect])
        found, kept = _without_one(rest, sound_m_s)
        place = np.where(suspect, np.cumsum(suspect) - 1 + len(reason), np.arange(len(reason)))
        best = Best(*(np.concatenate(both)[place] for both in zip(best, found, strict=True)))
        used[suspect], limit[suspect] = kept, likely(found, _REST)
        again = refused(event.only(used), least)
        reason = np.where(reason == FIX, again, reason)
    for why, holds in (
        (DIVERGED, ~best.converged),
        (NO_PASS, (best.chi2 > limit) | supersonic(best, sound_m_s)),
        (UNCERTAIN, ~_certain(best, event)),
        (AMBIGUOUS, best.ambiguous),
    ):
        reason = np.where((reason == FIX) & holds, np.uint8(why), reason)
    return Judged(best, used, reason)


def likely(best: Best, rare: float) -> Array:
    """The chi^2 (...,) that the path exceeds in the share ``rare`` of passes."""
    return np.asarray(chdtri(np.maximum(best.freedom, 1), rare))


def supersonic(best: Best, sound_m_s: float) -> Flags:
    """Whether the target is faster than sound (...,): then it would not be loudest when it is nearest."""
    return np.asarray(np.linalg.norm(best.line[..., 1:3], axis=-1) * sound_m_s <= 1.0)


def _without_one(event: Event, sound_m_s: float) -> tuple[Best, Flags]:
    """The best path of (N,) events less one report each, ambiguous if it may be another; and those kept, (N, K)."""
    count = event.heard.shape[-1]
    kept = event.heard[:, None, :] & ~np.eye(count, dtype=bool)
    many = event.map(lambda part: np.repeat(part[:, None], count, axis=1))
    each = likeliest(many.only(kept), sound_m_s)
    possible = event.heard & np.isfinite(each.chi2) & ~supersonic(each, sound_m_s)
    chi2 = np.where(possible, each.chi2, np.inf)
    least = chi2.argmin(axis=-1)
    rows = np.arange(len(least))
    best = each.map(lambda part: part[rows, least])
    others = chi2 < chi2.min(axis=-1, keepdims=True) + _AS_GOOD
    elsewhere = apart(each.line - best.line[:, None], best.information[:, None])
    unsure = (others & elsewhere).any(axis=-1)
    return best._replace(ambiguous=best.ambiguous | unsure), kept[rows, least]


def _certain(best: Best, event: Event) -> Flags:
    """Whether the path is known (...,).

    The sd across it must be below the (rms) distance of the sensors from their centroid, and that of the velocity
    below a fourth of it: a path that is taken for its reverse is more than four sds off.
    """
    size = np.square(event.at).sum(axis=(-2, -1)) / np.maximum(event.heard.sum(axis=-1), 1)
    v2 = 1.0 / np.square(best.line[..., 1:3]).sum(axis=-1)
    n = right(unit(best.line[..., 1:3]))
    aside = np.einsum("...i,...ij,...j->...", n, best.covariance[..., :2, :2], n)
    return np.asarray((aside < size) & (np.trace(best.covariance[..., 2:, 2:], axis1=-2, axis2=-1) < v2 / 16.0))
