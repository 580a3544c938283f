"""Direction of arrival: the bearings under which several sensors hear a target, and their slopes.

For the filters; a single bearing without numpy is ``sound.bearing``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trackfield.models.sound import bearing

Array = npt.NDArray[np.float64]

_AT_SENSOR = 1e-6  # m^2: on top of a sensor the slope has no value; this one is finite


def measure(state: Array, sensors: Array) -> Array:
    """h(x): bearings (..., K) in radians of states (..., 4) from ``sensors`` (..., K, 2) in metres."""
    dx = state[..., None, 0] - sensors[..., 0]
    dy = state[..., None, 1] - sensors[..., 1]
    return bearing(dx, dy, xp=np)


def jacobian(state: Array, sensors: Array) -> Array:
    """H = dh/dx: (..., K, 4) for states (..., 4) and ``sensors`` (..., K, 2); zero for the velocities."""
    dx = state[..., None, 0] - sensors[..., 0]
    dy = state[..., None, 1] - sensors[..., 1]
    square = np.maximum(dx * dx + dy * dy, _AT_SENSOR)
    slopes = np.zeros((*dx.shape, 4))
    slopes[..., 0] = dy / square
    slopes[..., 1] = -dx / square
    return slopes
