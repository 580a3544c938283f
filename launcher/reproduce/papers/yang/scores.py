"""Figures of fixes over runs: means and root mean squares of errors, the share that is right. NaN: a run without a fix.

An error is of the location (m), the speed (m/s) or the heading (rad), without its sign.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, positive, share
from trackfield.filters.types import Array

KINDS: Final = ("location", "speed", "heading")
UNITS: Final = {"location": "m", "speed": "m/s", "heading": "deg"}
RIGHT_M: Final = 5.0
RIGHT_RAD: Final = float(np.radians(15.0))
"""A fix is right if its line is nearer, and its direction off by less."""


def shown(kind: str, errors: Array) -> Array:
    """Errors in the unit in which they are told: headings in degrees."""
    return np.degrees(errors) if kind == "heading" else errors


def mean_error(errors: Array) -> Interval:
    """The mean of errors (R, ...) over all with a fix; the interval is over the runs."""
    there, values = ~np.isnan(errors), np.nan_to_num(errors)
    if not there.any():
        return Interval(np.nan, None, None)
    count, total = (one.reshape(len(errors), -1).sum(axis=1) for one in (there, values))
    return positive(lambda weights: _over(weights @ total, weights @ count), len(errors))


def rms_error(errors: Array) -> Interval:
    """The root mean square of errors (R,) over the runs with a fix."""
    there, squares = ~np.isnan(errors), np.square(np.nan_to_num(errors))
    if not there.any():
        return Interval(np.nan, None, None)
    return positive(lambda weights: np.sqrt(_over(weights @ squares, weights @ there)), len(errors))


def over_bound(errors: Array, sd: Array) -> Interval:
    """The root mean square of errors over that of the bound's sds (R,), in the runs with a fix."""
    there = ~np.isnan(errors)
    ours, least = np.square(np.nan_to_num(errors)), np.where(there, np.square(sd), 0.0)
    return positive(lambda weights: np.sqrt(_over(weights @ ours, weights @ least)), len(errors))


def mean_ratio(errors: Array, others: Array) -> Interval:
    """The first's mean over that of the others, in the runs in which both have a fix."""
    both = ~(np.isnan(errors) | np.isnan(others))
    ours, theirs = np.where(both, errors, 0.0), np.where(both, others, 0.0)
    return positive(lambda weights: _over(weights @ ours, weights @ theirs), len(errors))


def _over(above: Array, below: Array) -> Array:
    """Their ratio; NaN where nothing is left to take the mean of."""
    return np.asarray(np.divide(above, below, out=np.full(below.shape, np.nan), where=below > 0))


def right(location: Array, heading: Array) -> Array:
    """Whether each fix (R,) is right; a run without one is not."""
    return np.asarray((location < RIGHT_M) & (heading < RIGHT_RAD))


def share_of(hits: Array) -> Interval:
    """The share of the runs (R,) in which it is so."""
    return share(int(np.sum(hits)), len(hits))
