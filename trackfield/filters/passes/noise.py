"""The covariance of a path by a solver that knows none: how it moves if each number is one sd off, either way.

For a solver that is linear in what it is given, that is exact; where a solver decides, it has the differences between
its decisions in it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trackfield.filters.passes.geometry import state
from trackfield.filters.passes.types import FIX, Codes, Event
from trackfield.filters.types import Array

Lines = Callable[[Event], tuple[Array, Codes]]
"""A solver: the lines (..., 4) of events, and why there are none (...,)."""


def covariance(event: Event, line: Array, solver: Lines) -> Array:
    """The covariance (..., 4, 4) of the state at the time of ``line`` (..., 4).

    A number that leads the solver to no path in one direction counts by the other. If both do the covariance is NaN.
    """
    mean = state(line)
    up, down = (_moved(event, line, solver, sign) for sign in (1.0, -1.0))
    up_off, down_off = up - mean, mean - down
    half = (up_off + down_off) / 2.0
    half = np.where(np.isfinite(half), half, np.where(np.isfinite(up_off), up_off, down_off))
    return np.asarray(np.einsum("j...a,j...b->...ab", half, half))


def _moved(event: Event, line: Array, solver: Lines, sign: float) -> Array:
    """The states (J, ..., 4) at the time of ``line`` if each of J numbers is off by ``sign`` sds; NaN: no path."""
    count = event.at.shape[-2]
    parts = []
    for k in range(count):
        one = np.zeros(count)
        one[k] = sign
        parts.append(event._replace(times=event.times + np.where(event.heard, one * event.time_sd, 0.0)))
        parts.append(event._replace(logs=event.logs + np.where(event.loud, one * event.log_sd, 0.0)))
        if event.place_sd > 0.0:
            aside = np.where(event.heard, one * event.place_sd, 0.0)[..., None]
            parts.extend(event._replace(at=event.at + aside * axis) for axis in np.eye(2))
    many = event.map(lambda part: np.repeat(part[None], len(parts), axis=0))._replace(
        times=np.stack([part.times for part in parts]),
        logs=np.stack([part.logs for part in parts]),
        at=np.stack([part.at for part in parts]),
    )
    lines, reason = solver(many)
    lines = np.where((reason == FIX)[..., None], lines, np.nan)
    moved = state(lines)
    moved[..., :2] += moved[..., 2:] * (line[..., 0] - lines[..., 0])[..., None]
    return moved
