"""When, and how near, a target that moves at constant velocity passes sensors, and the derivatives; arrays only.

Yang et al., section 3: with u the target's position relative to a sensor and v its velocity, the closest point of
approach (CPA) is at t = -u.v/|v|^2 from the state's instant, at the distance d = |u + v t|; the sound of it arrives d/c
later. ``at`` (..., K, 2) may have the leading axes of ``x`` (..., n), or axes that broadcast with them.

A target that is slower than ``SLOWEST_M_S`` does not pass within the memory of a report: in t its speed counts as that
much. So times stay finite, and as the speed goes to 0 the distance goes to |u|, where the target stands.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.models.noise import SLOWEST_M_S

Array = npt.NDArray[np.float64]

_NEAR_M: Final = 1e-6  # on the target's line the direction to it is undefined; this keeps it finite


class _Passes(NamedTuple):
    """Of K sensors each: ``until`` (..., K) s from now to the CPA, and the target's place there, from the sensor.

    ``apart`` (..., K, 2) is the place now, ``there`` that at the CPA (m), ``away`` (..., K) its distance. ``velocity``
    (..., 1, 2) m/s, ``square`` (..., 1) that of the speed, not below the lowest; ``fast`` (..., 1): it is above that.
    """

    apart: Array
    velocity: Array
    square: Array
    fast: npt.NDArray[np.bool_]
    until: Array
    there: Array
    away: Array


def times(x: Array, at: Array, sound_m_s: float) -> Array:
    """(..., K) s from the instant of states ``x`` (..., n) to when each sensor hears the CPA; c infinite: to the CPA.

    Negative: before.
    """
    passes = _passes(x, at)
    return passes.until + passes.away / sound_m_s


def distances(x: Array, at: Array) -> Array:
    """(..., K) m from each sensor to the CPA: |u x v| / |v|."""
    return _passes(x, at).away


def times_and_slopes(x: Array, at: Array, sound_m_s: float) -> tuple[Array, Array]:
    """The times (..., K), and their derivatives (..., K, n) with respect to x."""
    passes = _passes(x, at)
    until, away = _slopes_until(passes, x.shape[-1]), _slopes_away(passes, x.shape[-1])
    return passes.until + passes.away / sound_m_s, until + away / sound_m_s


def distances_and_slopes(x: Array, at: Array) -> tuple[Array, Array]:
    """The distances (..., K), and their derivatives (..., K, n) with respect to x."""
    passes = _passes(x, at)
    return passes.away, _slopes_away(passes, x.shape[-1])


def _passes(x: Array, at: Array) -> _Passes:
    apart, velocity = x[..., None, :2] - at, x[..., None, 2:4]
    own: Array = np.vecdot(velocity, velocity)
    square = np.maximum(own, SLOWEST_M_S**2)
    until: Array = -np.vecdot(apart, velocity) / square
    there = apart + velocity * until[..., None]
    return _Passes(apart, velocity, square, own > SLOWEST_M_S**2, until, there, np.sqrt(np.vecdot(there, there)))


def _slopes_until(passes: _Passes, n: int) -> Array:
    """d until/dx (..., K, n): -v/|v|^2 and -(u + 2 v t)/|v|^2; -u/|v|^2 where the speed counts as the lowest."""
    slopes = np.zeros((*passes.until.shape, n))
    square, changing = passes.square[..., None], np.where(passes.fast, 2.0, 0.0)[..., None]
    slopes[..., :2] = -passes.velocity / square
    slopes[..., 2:4] = -(passes.apart + changing * passes.until[..., None] * passes.velocity) / square
    return slopes


def _slopes_away(passes: _Passes, n: int) -> Array:
    """d away/dx (..., K, n): e and t e, with e the direction to the CPA, which is at right angles to v.

    Below the lowest speed it is not: then the place on the line changes the distance as well.
    """
    towards = passes.there / np.maximum(passes.away, _NEAR_M)[..., None]
    slopes = np.zeros((*passes.away.shape, n))
    slopes[..., :2] = towards
    slopes[..., 2:4] = passes.until[..., None] * towards
    if not passes.fast.all():
        along = np.where(passes.fast, 0.0, np.vecdot(towards, passes.velocity))
        slopes += along[..., None] * _slopes_until(passes, n)
    return slopes
