"""Confidence intervals of figures over runs, and the conclusions that they allow."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from scipy import stats

from trackfield.filters.types import Array

CONFIDENCE: Final = 0.95

Weighted = Callable[[Array], Array]
"""A statistic over R runs: of weights (B, R), a row for each sample of the runs, its values (B,), all above 0."""


class Interval(NamedTuple):
    """A figure and the ends of its interval; ``low`` and ``high`` are None where there are too few runs for one."""

    value: float
    low: float | None
    high: float | None

    def at_most(self, limit: float) -> bool | None:
        """Whether the figure is at most the limit; None if the interval has the limit in it."""
        if self.low is None or self.high is None:
            return None
        if self.high <= limit:
            return True
        return False if self.low > limit else None

    def above(self, limit: float) -> bool | None:
        """The opposite of ``at_most``."""
        answer = self.at_most(limit)
        return None if answer is None else not answer

    def over(self, published: float) -> Interval:
        """The ratio to a figure that is known exactly."""
        low, high = (None if end is None else end / published for end in self[1:])
        return Interval(self.value / published, low, high)


def all_of(answers: Iterable[bool | None]) -> bool | None:
    """Whether all are true; None if that is open."""
    given = list(answers)
    return False if False in given else None if None in given else True


def any_of(answers: Iterable[bool | None]) -> bool | None:
    """Whether one is true; None if that is open."""
    given = list(answers)
    return True if True in given else None if None in given else False


def positive(statistic: Weighted, runs: int) -> Interval:
    """The interval of an error, a variance or a ratio: jackknife over the runs, Student's t on the logarithm.

    A statistic of several trackers or cases leaves out the same run of all: it is paired by seed.
    """
    (value,) = statistic(np.ones((1, runs))).tolist()
    if runs < 2:
        return Interval(value, None, None)
    without = statistic(1.0 - np.eye(runs))
    if not (value > 0 and np.all(np.isfinite(without)) and np.all(without > 0)):
        return Interval(value, None, None)
    logs = np.log(without)
    error = np.sqrt((runs - 1) / runs * np.square(logs - logs.mean()).sum())
    factor = float(np.exp(stats.t.ppf((1 + CONFIDENCE) / 2, runs - 1) * error))
    return Interval(value, value / factor, value * factor)


def share(hits: int, of: int) -> Interval:
    """The share of ``hits`` in ``of`` runs, with the exact interval of Clopper and Pearson."""
    found = stats.binomtest(hits, of).proportion_ci(CONFIDENCE, method="exact")
    return Interval(hits / of, float(found.low), float(found.high))


def share_of_steps(shares: Array) -> Interval:
    """The mean of shares (R,) of the steps of a run: Student's t over runs.

    If all runs are alike, their spread is unknown: the interval is that of ``share``, which is wider.
    """
    value, runs = float(shares.mean()), len(shares)
    if np.ptp(shares) == 0:
        ends = share(round(value * runs), runs)
        return Interval(value, ends.low, ends.high)
    half = float(stats.t.ppf((1 + CONFIDENCE) / 2, runs - 1) * stats.sem(shares))
    return Interval(value, max(value - half, 0.0), min(value + half, 1.0))


def median(values: Array) -> Interval:
    """The median of values (R,), with an interval from their order, for any distribution; it takes six values."""
    rank, ordered = _rank(len(values)), np.sort(values).tolist()
    low, high = (ordered[rank - 1], ordered[-rank]) if rank else (None, None)
    return Interval(float(np.median(values)), low, high)


@cache
def _rank(runs: int) -> int:
    """The rank, from either end and from 1, of the ends of the median's interval; 0 if there are too few values."""
    return int(stats.binom.ppf((1 - CONFIDENCE) / 2, runs, 0.5))
