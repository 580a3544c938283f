"""95 % confidence intervals over runs with different seeds, which are independent of each other.

A mean has Student's t interval, as is usual for replications of a simulation (Law, Simulation Modeling and Analysis,
chapter 9); no figure of a run can be below 0, and neither is its interval. A share has the interval of Wilson (1927),
which holds for few runs and for shares near 0 and 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import fmean, stdev
from typing import Final

LEVEL: Final = 0.95
FEWEST: Final = 3
"""Fewer runs have no interval."""


@dataclass(frozen=True)
class Estimate:
    """A mean or a share of so many ``runs``, with its interval; that is None where there are too few of them."""

    value: float
    low: float | None
    high: float | None
    runs: int


def mean_of(values: Sequence[float]) -> Estimate | None:
    """The mean of figures that are at least 0; None if there are none."""
    from scipy.stats import t

    n = len(values)
    if not n:
        return None
    mean = fmean(values)
    if n < FEWEST:
        return Estimate(mean, None, None, n)
    half = float(t.ppf((1 + LEVEL) / 2, n - 1)) * stdev(values) / sqrt(n)
    return Estimate(mean, max(mean - half, 0.0), mean + half, n)


def share_of(count: int, runs: int) -> Estimate:
    """The share of the runs, one or more, that ``count`` is (0 to 1)."""
    from scipy.stats import binomtest

    if runs < FEWEST:
        return Estimate(count / runs, None, None, runs)
    low, high = binomtest(count, runs).proportion_ci(LEVEL, method="wilson")
    return Estimate(count / runs, float(low), float(high), runs)
