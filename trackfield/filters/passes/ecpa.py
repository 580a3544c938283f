"""The enhanced CPA algorithm (ECPA) of Yang et al., section 3.3.

It differs from the original in four ways (``Differences``): it estimates how the path divides the sensors; it chooses
those sensors from which the angle is computed best; of the four angles that these give, it takes the one that is
nearest to the estimate; and it locates the path by strengths, not by times.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.passes.cpa import SIGNS, Far, angles, distance, mach_number
from trackfield.filters.passes.geometry import across, place, right
from trackfield.filters.passes.slope import estimate, timed
from trackfield.filters.passes.strength import extent, located
from trackfield.filters.passes.types import DIVIDED_OTHERWISE, FIX, NEGATIVE, Codes, Event, Flags, Numbers
from trackfield.filters.types import Array

PLACE_ERROR_M: Final = 2.0
TIME_ERROR_S: Final = 0.1
WHITE_RAD: Final = np.radians(10.0)
"""Figure 4: an angle is computed well where such errors of place and time turn it by less than this."""


class Differences(NamedTuple):
    """In what ECPA differs from CPA. Without ``divides`` it must be told how the path divides the sensors."""

    divides: bool = True
    selects: bool = True
    refers: bool = True
    by_strength: bool = True


ALL_DIFFERENCES: Final = Differences()


class _Chosen(NamedTuple):
    """Numbers of sensors (...,): the lone one, the pair and the last of three far ones."""

    lone: Numbers
    third: Numbers
    other: Numbers
    last: Numbers
    side: Array
    """(...,) of the far ones, 1: right of the path."""
    enough: Flags
    """(...,) whether there are such."""


def ecpa(
    event: Event,
    sound_m_s: float,
    *,
    location: str = "pair",
    differences: Differences = ALL_DIFFERENCES,
    sides: Array | None = None,
) -> tuple[Array, Codes]:
    """The lines (..., 4) by ECPA, and why there are none (...,), which needs a difference left out.

    ``location`` is "pair" (eq. 35, with the nearest sensor across the path) or "all" (the strengths of all sensors).
    ``sides`` (..., K) are as true, 1: right of the path; needed without ``divides``. The estimate holds where the angle
    is not computed well, and the speed of the estimate where eq. 18 gives none.
    """
    guess = estimate(event, sound_m_s)
    if sides is None or differences.divides:
        sides = np.sign(across(guess, event.at)) * event.heard
    n = right(guess[..., 1:3])
    to_right = np.arctan2(n[..., 1], n[..., 0])
    chosen = _choose(event, sides, to_right, differences.selects)
    phi_guess = to_right + np.where(chosen.side > 0.0, 0.0, np.pi)  # from the lone sensor to the path
    four = _Four.of(event, chosen, sound_m_s)
    found, sign = _nearest(four, phi_guess, chosen.side, sound_m_s) if differences.refers else _accepted(four)
    known = chosen.enough & np.isfinite(found)
    phi, sign = np.where(known, found, phi_guess), np.where(known, sign, chosen.side)
    slowness = 1.0 / (sound_m_s * four.mach)
    slowness = np.where(chosen.enough & np.isfinite(slowness), slowness, np.linalg.norm(guess[..., 1:3], axis=-1))
    e = -right(sign[..., None] * np.stack((np.cos(phi), np.sin(phi)), axis=-1))
    reason = np.zeros(phi.shape, np.uint8)
    if not differences.refers:
        reason[~known] = DIVIDED_OTHERWISE
    if not differences.by_strength:
        r = distance(four.far, (sign * four.mach)[..., None], phi[..., None])[..., 0]
        b = (four.lone * right(e)).sum(axis=-1) + sign * r
        reason[(reason == FIX) & ~(r > 0.0)] = NEGATIVE
    elif location == "all":
        b = located(event, e)
    else:
        b = located_by_pair(event, e, sides, chosen.lone)
    return timed(event, slowness[..., None] * e, b, sound_m_s), reason


class Candidates(NamedTuple):
    """The ``lines`` (..., 4, 4) by the four angles that the chosen sensors give; NaN where they give none.

    Numbers of the ``lone`` sensor (...,), and of three ``far`` ones (..., 3), the last two of which give the angles.
    """

    lone: Numbers
    far: Numbers
    lines: Array


def candidates(event: Event, sound_m_s: float) -> Candidates:
    """What ECPA chooses from; each line is located and timed as the one that it takes."""
    guess = estimate(event, sound_m_s)
    sides = np.sign(across(guess, event.at)) * event.heard
    n = right(guess[..., 1:3])
    chosen = _choose(event, sides, np.arctan2(n[..., 1], n[..., 0]), selects=True)
    phi, mach = _Four.of(event, chosen, sound_m_s).four
    e = -right(np.sign(mach)[..., None] * np.stack((np.cos(phi), np.sin(phi)), axis=-1))
    each = event.map(lambda part: np.repeat(np.expand_dims(part, phi.ndim - 1), phi.shape[-1], axis=phi.ndim - 1))
    beside, lone = (np.repeat(part[..., None, :], phi.shape[-1], axis=-2) for part in (sides, chosen.lone[..., None]))
    b = located_by_pair(each, e, beside, lone[..., 0])
    lines = timed(each, e / (sound_m_s * np.abs(mach))[..., None], b, sound_m_s)
    lines = np.where(chosen.enough[..., None, None], lines, np.nan)
    return Candidates(chosen.lone, np.stack((chosen.last, chosen.other, chosen.third), axis=-1), lines)


class _Four(NamedTuple):
    """The place of the ``lone`` sensor (..., 2), the three ``far`` ones, the last two the pair, and |M| (...,)."""

    lone: Array
    far: Far
    mach: Array

    @staticmethod
    def of(event: Event, chosen: _Chosen, sound_m_s: float) -> _Four:
        """Those that are ``chosen``."""
        numbers = np.stack((chosen.lone, chosen.last, chosen.other, chosen.third), axis=-1)
        at = np.take_along_axis(event.at, numbers[..., None], axis=-2)
        times = np.take_along_axis(event.times, numbers, axis=-1)
        far = Far(at[..., 1:, :] - at[..., :1, :], sound_m_s * (times[..., 1:] - times[..., :1]))
        return _Four(at[..., 0, :], far, mach_number(far))

    @property
    def four(self) -> tuple[Array, Array]:
        """The four angles phi (..., 4) that the pair gives, and their Mach numbers."""
        places, delays = self.far
        mach = self.mach[..., None] * SIGNS
        found = angles(places[..., 1, :] - places[..., 2, :], delays[..., 1] - delays[..., 2], mach)
        return found.reshape(*found.shape[:-2], 4), np.repeat(mach, 2, axis=-1)


def _nearest(four: _Four, guess: Array, side: Array, sound_m_s: float) -> tuple[Array, Array]:
    """The angle (...,) nearest to the ``guess``, and the sign of its Mach number: ``side``, where the far sensors are.

    NaN if there is none, or it is not computed well (figure 4).
    """
    found, _ = four.four
    off = np.abs((found - guess[..., None] + np.pi) % (2.0 * np.pi) - np.pi)
    nearest = np.where(np.isfinite(off), off, np.inf).argmin(axis=-1)[..., None]
    pair = four.far.places[..., 1, :] - four.far.places[..., 2, :]
    white = turned(pair, guess, sound_m_s * four.mach) < WHITE_RAD
    return np.where(white, np.take_along_axis(found, nearest, axis=-1)[..., 0], np.nan), side


def _accepted(four: _Four) -> tuple[Array, Array]:
    """The first angle (...,) that CPA accepts, and the sign of its Mach number; NaN if there is none.

    Accepted are those with r > 0 and the far sensors across the path.
    """
    found, mach = four.four
    r = distance(four.far, mach, found)
    n = np.stack((np.cos(found), np.sin(found)), axis=-1)
    beyond = (np.einsum("...ki,...ai->...ak", four.far.places, n) > r[..., None]).all(axis=-1)
    accepted = (r > 0.0) & beyond
    first = accepted.argmax(axis=-1)[..., None]
    phi, sign = (np.take_along_axis(part, first, axis=-1)[..., 0] for part in (found, np.sign(mach)))
    return np.where(accepted.any(axis=-1), phi, np.nan), sign


def turned(difference: Array, phi: Array, speed: Array) -> Array:
    """How much (rad) eq. 25 turns phi (...,) computed from a pair of far sensors ``difference`` (..., 2) apart."""
    r = np.linalg.norm(difference, axis=-1)
    away = np.arctan2(difference[..., 1], difference[..., 0]) - phi
    error = np.abs(PLACE_ERROR_M * np.sin(away)) + np.abs(speed * TIME_ERROR_S)
    return np.asarray(error / (r * np.abs(np.cos(away))))


def located_by_pair(event: Event, e: Array, sides: Array, lone: Numbers) -> Array:
    """The offset (...,) by eq. 35: from the lone sensor n0 and the nearest across the path, by their strengths' ratio.

    It is kept within the hull, as section 6.1 says. NaN where the lone sensor or all across the path have no strength.
    """
    at0 = place(event.at, lone)
    away = np.linalg.norm(event.at - at0[..., None, :], axis=-1)
    across_path = (
        event.loud & (sides != _of(sides, lone)[..., None]) & np.take_along_axis(event.loud, lone[..., None], axis=-1)
    )
    nk = np.where(across_path, away, np.inf).argmin(axis=-1)
    s0, sk = np.exp(_of(event.logs, lone)), np.exp(_of(event.logs, nk))
    share = sk / (sk + s0)
    point = at0 + share[..., None] * (place(event.at, nk) - at0)
    low, high = extent(event, e)
    return np.where(across_path.any(axis=-1), np.clip((point * right(e)).sum(axis=-1), low, high), np.nan)


def _choose(event: Event, sides: Array, to_right: Array, selects: bool) -> _Chosen:
    """The pair of far sensors with the least |tan(alpha - phi)| / r (eq. 28), and a third that spans most with them.

    That is the same in either order of the pair. The lone sensor is the loudest on the other side. Without ``selects``
    they are the first that there are.
    """
    count = event.at.shape[-2]
    threes = np.array([(*pair, k) for pair in combinations(range(count), 2) for k in range(count) if k not in pair])
    beside = np.where(event.heard, sides, 0.0)
    on = beside[..., threes]
    left, to_the_right = ((beside * side > 0.0).any(axis=-1, keepdims=True) for side in (-1.0, 1.0))
    opposed = np.where(on[..., 0] > 0.0, left, to_the_right)
    valid = np.asarray((on[..., 0] != 0.0) & (on == on[..., :1]).all(axis=-1) & opposed)
    if selects:
        at = event.at[..., threes, :]
        pair, last = at[..., 1, :] - at[..., 0, :], at[..., 2, :] - at[..., 0, :]
        alpha = np.arctan2(pair[..., 1], pair[..., 0])
        score = np.abs(np.tan(alpha - to_right[..., None])) / np.linalg.norm(pair, axis=-1)
        score = np.where(valid & np.isfinite(score), score, np.inf)
        area = np.abs(pair[..., 0] * last[..., 1] - pair[..., 1] * last[..., 0])
        best = np.where(score == score.min(axis=-1, keepdims=True), area, -1.0).argmax(axis=-1)
    else:
        best = valid.argmax(axis=-1)
    enough: Flags = np.asarray(valid.any(axis=-1))
    side = np.where(enough, _of(on[..., 0], best), 1.0)
    third, other, last_one = np.moveaxis(threes[best], -1, 0)
    lone = np.where(beside == -side[..., None], event.logs if selects else 0.0, -np.inf).argmax(axis=-1)
    return _Chosen(lone, third, other, last_one, side, enough)


def _of(values: Array, number: Numbers) -> Array:
    """The value (...,) of one of each event."""
    return np.take_along_axis(values, number[..., None], axis=-1)[..., 0]
