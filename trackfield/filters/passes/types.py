"""Inputs and outputs of the solvers: the reports of an event, and the path that they tell of. Metres, seconds.

An *event* is a target that passes a cluster of sensors: each reports its closest point of approach (CPA), by its time
and strength. All arrays may have leading axes, for many events at once. Events of fewer reports than others are padded
by NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.intp]
Codes = npt.NDArray[np.uint8]

REASONS: Final = (
    "",
    "too few reports",
    "the sensors stand in a line",
    "different paths fit the reports about as well",
    "the reports are not those of one pass on a straight line",
    "the reports leave the path too uncertain",
    "the fit did not converge",
    "no three reporting sensors are on one side of the path",
    "no speed fits the times (right side of eq. 18 <= 1)",
    "the computed distance is negative",
    "the computed path does not divide the sensors as assumed",
)
"""Why there is no fix, for people; 0: there is one. Yang et al.'s CPA algorithm fails by the last three."""
FIX: Final = 0
FEW: Final = 1
IN_LINE: Final = 2
AMBIGUOUS: Final = 3
NO_PASS: Final = 4
UNCERTAIN: Final = 5
DIVERGED: Final = 6
NOT_DIVIDED: Final = 7
NO_SPEED: Final = 8
NEGATIVE: Final = 9
DIVIDED_OTHERWISE: Final = 10


LEAST_TIME_SD_S: Final = 5e-5
LEAST_STRENGTH_SD: Final = 0.005 * math.log(10.0) / 20.0
"""No report is more exact than half of what its message can tell apart, 0.1 ms and 0.01 dB, whatever it says."""
_QUIET: Final = 1e9
"""Below the logarithm of any strength."""


class Passes(NamedTuple):
    """The reports of an event, K of them; NaN in ``times_s`` means none."""

    places: Array
    """(..., K, 2) m, where the sensors are assumed to stand."""
    times_s: Array
    """(..., K) when each heard the target loudest, the delay of sound included."""
    strengths: Array
    """(..., K) the amplitude then, linear, in any unit that is the same for all; NaN: not known."""
    time_sd_s: Array
    """(..., K) sd of ``times_s``."""
    strength_sd: Array
    """(..., K) sd of ``strengths``, relative."""
    place_sd_m: float = 0.0
    """sd of ``places`` per axis."""


class Solved(NamedTuple):
    """The path of each event; NaN where ``reason`` is not 0."""

    time_s: Array
    """(...,) when the target is nearest to the centroid of the sensors that reported."""
    mean: Array
    """(..., 4) x, y, vx, vy at that time."""
    covariance: Array
    """(..., 4, 4)"""
    used: Flags
    """(..., K) the reports that the path is made of."""
    reason: Codes
    """(...,) the number in ``REASONS``."""


class Event(NamedTuple):
    """The reports of events about the centroid of their sensors and their mean time, padding filled up."""

    centroid: Array
    """(..., 2) m"""
    epoch_s: Array
    """(...,)"""
    at: Array
    """(..., K, 2) m from the centroid; 0 where there is no report."""
    times: Array
    """(..., K) s from the epoch; 0 where there is no report."""
    logs: Array
    """(..., K) logarithms of the strengths; 0 where there is none."""
    heard: Flags
    """(..., K) where there is a report."""
    loud: Flags
    """(..., K) where there is a strength."""
    time_sd: Array
    """(..., K), at least ``LEAST_TIME_SD_S``; 1 where there is no report."""
    log_sd: Array
    """(..., K) sd of ``logs``, at least ``LEAST_STRENGTH_SD``; 1 where there is none."""
    place_sd: float

    def only(self, which: Flags) -> Event:
        """The reports at ``which`` (..., K), about the same centroid."""
        return self._replace(heard=self.heard & which, loud=self.loud & which)

    def loudest(self, most: int) -> tuple[Event, Numbers]:
        """The events with their ``most`` loudest reports only, if there are more, and the numbers (..., K) of these."""
        loudness = np.where(self.loud, self.logs, np.where(self.heard, -_QUIET, -2.0 * _QUIET))
        kept = np.sort(np.argsort(-loudness, axis=-1, kind="stable")[..., :most], axis=-1)
        only = self._replace(
            at=np.take_along_axis(self.at, kept[..., None], axis=-2),
            times=np.take_along_axis(self.times, kept, axis=-1),
            logs=np.take_along_axis(self.logs, kept, axis=-1),
            heard=np.take_along_axis(self.heard, kept, axis=-1),
            loud=np.take_along_axis(self.loud, kept, axis=-1),
            time_sd=np.take_along_axis(self.time_sd, kept, axis=-1),
            log_sd=np.take_along_axis(self.log_sd, kept, axis=-1),
        )
        return only, kept

    def spread(self) -> Event:
        """The same events with one more axis before the sensors': for several paths of each."""
        axis = self.epoch_s.ndim
        return self.map(lambda part: np.expand_dims(part, axis))

    def map(self, change: Callable[[Any], Any]) -> Event:
        """The events with ``change`` made to each array: one that moves or takes leading axes."""
        return Event(*(change(part) for part in self[:-1]), place_sd=self.place_sd)  # type: ignore[misc]


def event_of(passes: Passes) -> Event:
    """The reports of ``passes`` as kernels take them."""
    heard = np.isfinite(passes.times_s) & np.isfinite(passes.places).all(axis=-1)
    loud = heard & np.isfinite(passes.strengths) & (np.where(heard, passes.strengths, 0.0) > 0.0)
    count = np.maximum(heard.sum(axis=-1), 1)
    places = np.where(heard[..., None], passes.places, 0.0)
    times = np.where(heard, passes.times_s, 0.0)
    centroid = places.sum(axis=-2) / count[..., None]
    epoch = times.sum(axis=-1) / count
    return Event(
        centroid,
        epoch,
        np.where(heard[..., None], places - centroid[..., None, :], 0.0),
        np.where(heard, times - epoch[..., None], 0.0),
        np.log(np.where(loud, passes.strengths, 1.0)),
        heard,
        loud,
        np.where(heard, np.maximum(passes.time_sd_s, LEAST_TIME_SD_S), 1.0),
        np.where(loud, np.maximum(passes.strength_sd, LEAST_STRENGTH_SD), 1.0),
        passes.place_sd_m,
    )
