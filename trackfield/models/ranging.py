"""Distances from sensors to a target, and their derivatives; for the filters, so arrays only.

``at`` (..., K, 2) may have the leading axes of ``x`` (..., n), or axes that broadcast with them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_NEAR_M = 1e-6  # at a sensor's own place the direction is undefined; this keeps it finite
_SLOWEST = 1.0 - 0.9**2


def distances(x: Array, at: Array) -> Array:
    """(..., K) m from sensors to the positions x[..., :2]."""
    apart = x[..., None, :2] - at
    away: Array = np.sqrt(np.vecdot(apart, apart))
    return away


def distances_and_slopes(x: Array, at: Array) -> tuple[Array, Array]:
    """The distances (..., K), and their derivatives (..., K, n) with respect to x."""
    apart = x[..., None, :2] - at
    away: Array = np.sqrt(np.vecdot(apart, apart))
    slopes = np.zeros((*away.shape, x.shape[-1]))
    slopes[..., :2] = apart / np.maximum(away, _NEAR_M)[..., None]
    return away, slopes


def delays(x: Array, at: Array, speed_m_s: float) -> Array:
    """(..., K) s, how long ago what arrives at sensors now left a target that moves at constant velocity.

    The time tau with |p - v tau| = c tau, where p is the position relative to the sensor; |v| < c. A faster state,
    which no target has, counts as if it had nine tenths of c in that.
    """
    apart, velocity = x[..., None, :2] - at, x[..., None, 2:4]
    closing = np.vecdot(apart, velocity)
    room = np.maximum(speed_m_s**2 - np.vecdot(velocity, velocity), _SLOWEST * speed_m_s**2)
    late: Array = (np.sqrt(closing**2 + room * np.vecdot(apart, apart)) - closing) / room
    return late


def delays_and_slopes(x: Array, at: Array, speed_m_s: float) -> tuple[Array, Array]:
    """The delays (..., K), and their derivatives (..., K, n), from the derivative of |p - v tau|^2 = (c tau)^2."""
    late = delays(x, at, speed_m_s)
    then = x[..., None, :2] - at - x[..., None, 2:4] * late[..., None]
    scale = np.maximum(np.vecdot(then, x[..., None, 2:4]) + speed_m_s**2 * late, _NEAR_M)
    slopes = np.zeros((*late.shape, x.shape[-1]))
    slopes[..., :2] = then / scale[..., None]
    slopes[..., 2:4] = -late[..., None] * slopes[..., :2]
    return late, slopes
