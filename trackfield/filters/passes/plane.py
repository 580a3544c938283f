"""A plane through the CPA times, t = T + g . s, by least squares; then the offset from the strengths.

That is the model of ``geometry`` without the delay of sound, which is taken off from the second round on, as it follows
from the line of the round before.
"""

from __future__ import annotations

import numpy as np

from trackfield.filters.passes.geometry import across
from trackfield.filters.passes.strength import located
from trackfield.filters.passes.types import Event
from trackfield.filters.types import Array

_ROUNDS = 3


def plane(event: Event, sound_m_s: float) -> Array:
    """The line (..., 4) of events of at least three sensors that do not stand in a line."""
    delay = np.zeros_like(event.times)
    for _ in range(_ROUNDS):
        line = fitted(event, event.times - delay)
        line[..., 3] = located(event, line[..., 1:3])
        delay = np.abs(across(line, event.at)) / sound_m_s
    return line


def fitted(event: Event, times: Array) -> Array:
    """The line (..., 4) with T and g of the plane through ``times`` (..., K), and b = 0."""
    weights = np.where(event.heard, 1.0 / event.time_sd, 0.0)
    rows = np.concatenate((np.ones((*event.at.shape[:-1], 1)), event.at), axis=-1) * weights[..., None]
    normal = np.swapaxes(rows, -1, -2) @ rows
    right_side = np.swapaxes(rows, -1, -2) @ (weights * times)[..., None]
    found = np.linalg.pinv(normal, hermitian=True) @ right_side
    return np.concatenate((found[..., 0], np.zeros_like(found[..., :1, 0])), axis=-1)
