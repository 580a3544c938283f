"""Direction of arrival: the bearings at which several sensors hear a target, and their derivatives.

For the filters, so arrays only; a single bearing without numpy is ``sound.bearing``.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from trackfield.models.sound import bearing

Array = npt.NDArray[np.float64]

_AT_SENSOR = 1e-6  # m^2: at a sensor's own place the derivative is undefined; this keeps it finite


def measure(state: Array, sensors: Array) -> Array:
    """h(x): bearings (..., K) in radians of states (..., 4) from ``sensors`` (..., K, 2) in metres."""
    return bearing(*_apart(state, sensors), xp=np)


def jacobian(state: Array, sensors: Array) -> Array:
    """H = dh/dx: (..., K, 4) for states (..., 4) and ``sensors`` (..., K, 2); zero for the velocities."""
    dx, dy = _apart(state, sensors)
    square = np.maximum(dx * dx + dy * dy, _AT_SENSOR)
    slopes = np.zeros((*dx.shape, 4), order="F" if dx.ndim < 3 else "C")
    np.divide(dy, square, out=slopes[..., 0])
    np.divide(dx, -square, out=slopes[..., 1])
    return slopes


def wrap(angle: Array) -> Array:
    """The same directions in [-pi, pi]: as ``sound.wrap``, in an eighth of its time as nothing is divided."""
    turns = angle * (1.0 / math.tau)
    turns = np.rint(turns, out=turns) if turns.ndim else np.rint(turns)
    turns *= math.tau
    wrapped: Array = angle - turns
    return wrapped


def _apart(state: Array, sensors: Array) -> tuple[Array, Array]:
    """The positions of states relative to sensors: (..., K) m east and north.

    States lie next to each other in memory, not sensors: there are many of the former, and long loops are fast.
    """
    one = state.ndim == 1  # which takes less time without an order
    apart = state[:2] - sensors if one else np.subtract(state[..., None, :2], sensors, order="F")
    return apart[..., 0], apart[..., 1]
