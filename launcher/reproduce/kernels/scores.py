"""Figures over runs of bare filters, with their intervals. Errors are estimate minus truth."""

from __future__ import annotations

from typing import Final

import numpy as np

from launcher.reproduce.intervals import CONFIDENCE, Interval, Weighted, positive, share
from launcher.reproduce.scores import over_steps, pooled
from trackfield.filters.types import Array

SAMPLES: Final = 400
"""Of the bootstrap."""


def rmse(errors: Array) -> Interval:
    """Of the position, pooled over all runs and steps of errors (R, T, 2 or more), in their unit."""
    return positive(pooled(errors), len(errors))


def mean_rmse(errors: Array) -> Interval:
    """The mean over the steps of RMSE(t), the root mean square over runs of the distance at step t."""
    return positive(_mean_rmse(errors), len(errors))


def ratio(errors: Array, others: Array) -> Interval:
    """The first's ``mean_rmse`` over the second's, in the same runs."""
    return positive(_over(_mean_rmse(errors), _mean_rmse(others)), len(errors))


def mean(values: Array) -> Interval:
    """Of values (R, ...) above 0, over all runs and steps."""
    each = values.reshape(len(values), -1).mean(axis=1)
    return positive(lambda weights: weights @ each / weights.sum(axis=-1), len(values))


def percentile(errors: Array, percent: float) -> Interval:
    """Of the distances over all runs and steps of errors (R, T, 2 or more).

    The jackknife fails for percentiles: the interval is the bootstrap's over runs (Efron & Tibshirani 1993, sec. 13.3),
    of samples that are always the same.
    """
    away = np.linalg.norm(errors[..., :2], axis=-1)
    value = float(np.percentile(away, percent))
    if len(away) < 2:
        return Interval(value, None, None)
    chosen = np.random.default_rng(len(away)).integers(len(away), size=(SAMPLES, len(away)))
    samples = [np.percentile(away[some], percent) for some in chosen]
    low, high = np.percentile(samples, [50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)]).tolist()
    return Interval(value, low, high)


def lost(errors: Array, beyond_m: float, within: int) -> Array:
    """Whether each run (R,) is lost: its error is above ``beyond_m`` in any of the last ``within`` steps."""
    away = np.linalg.norm(errors[:, -within:, :2], axis=-1)
    return np.asarray((away > beyond_m).any(axis=1))


def share_lost(errors: Array, beyond_m: float, within: int) -> Interval:
    """The share of the runs that are lost."""
    hits = lost(errors, beyond_m, within)
    return share(int(hits.sum()), len(hits))


def _mean_rmse(errors: Array) -> Weighted:
    return over_steps(np.linalg.norm(errors[..., :2], axis=-1), np.mean)


def _over(one: Weighted, other: Weighted) -> Weighted:
    return lambda weights: one(weights) / other(weights)
