"""The estimate of a path that ECPA begins with: its slope from three CPA times, its place from strengths.

That is section 3.3.1 of Yang et al., whose eq. 33 compares distances without signs. With signs it says: of the sensors
with the earliest and the latest time, x1 and x3, and the one that is farthest from the line between them, x2, the
target is abreast of x2 when it is abreast of

    q = x1 + (t2 - t1) / (t3 - t1) (x3 - x1),

so its velocity is perpendicular to q - x2. The times are less the delay of sound, which the paper leaves out: it
follows from the line of the round before.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trackfield.filters.passes.geometry import across, arrivals, dot, place, right, unit
from trackfield.filters.passes.strength import located
from trackfield.filters.passes.types import Event
from trackfield.filters.types import Array

_ROUNDS: Final = 3  # without delays, and two with


def estimate(event: Event, sound_m_s: float) -> Array:
    """The line (..., 4), through the hull of the sensors, by all strengths; eq. 34 takes the two weakest only."""
    times = event.times
    for _ in range(_ROUNDS):
        e = direction(event, times)
        line = fitted(event, times, e, located(event, e))
        times = event.times - np.abs(across(line, event.at)) / sound_m_s
    return line


def direction(event: Event, times: Array) -> Array:
    """The unit vector (..., 2) of the velocity by eq. 33 from ``times`` (..., K), the delay of sound taken off."""
    first = np.where(event.heard, times, np.inf).argmin(axis=-1)
    last = np.where(event.heard, times, -np.inf).argmax(axis=-1)
    x1, x3 = place(event.at, first), place(event.at, last)
    aside = np.abs(dot(event.at - x1[..., None, :], right(x3 - x1)))
    x2_number = np.where(event.heard, aside, -1.0).argmax(axis=-1)
    t1, t2, t3 = (np.take_along_axis(times, k[..., None], axis=-1) for k in (first, x2_number, last))
    q = x1 + (t2 - t1) / (t3 - t1) * (x3 - x1)
    e = right(unit(q - place(event.at, x2_number)))
    forward = np.sign((e * (x3 - x1)).sum(axis=-1, keepdims=True))
    return np.asarray(e * np.where(forward == 0.0, 1.0, forward))


def fitted(event: Event, times: Array, e: Array, b: Array) -> Array:
    """The line (..., 4) along ``e`` at the offset ``b``: speed and time by least squares; ``times`` without delays."""
    along = np.where(event.heard, dot(event.at, e), 0.0)
    count = event.heard.sum(axis=-1)
    late = np.where(event.heard, times, 0.0).sum(axis=-1) / count
    middle = along.sum(axis=-1) / count
    centred = np.where(event.heard, along - middle[..., None], 0.0)
    slowness = (centred * (times - late[..., None])).sum(axis=-1) / np.square(centred).sum(axis=-1)
    start = late - slowness * middle
    return np.concatenate((start[..., None], slowness[..., None] * e, b[..., None]), axis=-1)


def timed(event: Event, g: Array, b: Array, sound_m_s: float) -> Array:
    """The line (..., 4) of slowness ``g`` (..., 2) at the offset ``b``, its time as fits all reports best."""
    line = np.concatenate((np.zeros_like(b)[..., None], g, b[..., None]), axis=-1)
    late = np.where(event.heard, event.times - arrivals(line, event.at, sound_m_s), 0.0)
    line[..., 0] = late.sum(axis=-1) / event.heard.sum(axis=-1)
    return line
