"""Differences between settings over the same seeds, and which setting is best.

Runs of one seed have common random numbers: the same target, noise and losses, as far as they have the same sensors,
frames and links. The differences of their figures are independent of each other, and vary less than the figures, so
Student's t interval of their mean is used (paired t; Law, Simulation Modeling and Analysis, section 10.2).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import fmean, stdev
from typing import Final

from launcher.study.figures import Better
from launcher.study.intervals import FEWEST, LEVEL

BySeed = Mapping[int, float]
"""A figure of the runs of a setting, by their seeds; runs that do not have it are missing."""
_NOISE: Final = 1e-9
"""Differences below this share of the figures are those of rounding."""


@dataclass(frozen=True)
class Difference:
    """The mean difference of a figure between two settings over so many common ``runs``, and its interval; None where
    there are too few."""

    value: float
    low: float | None
    high: float | None
    runs: int

    @property
    def separated(self) -> bool:
        """Whether the interval says that there is a difference."""
        return self.low is not None and self.high is not None and (self.low > 0 or self.high < 0)


@dataclass(frozen=True)
class Verdict:
    """Of a figure: the setting with the ``best`` mean (None: no run has the figure), the difference of each setting to
    it, and those settings that are ``open``: not separated from the best one, which is then no winner. ``rivals`` are
    those that have the figure."""

    best: int | None
    differences: tuple[Difference | None, ...]
    open: tuple[int, ...]
    rivals: int = 0

    @property
    def winner(self) -> int | None:
        """The best setting, if it is separated from all others that have the figure, and there are any."""
        return self.best if self.rivals > 1 and not self.open else None


def difference(first: BySeed, other: BySeed, level: float = LEVEL) -> Difference | None:
    """``other`` minus ``first``, over the seeds that both have; None if there are none."""
    from scipy.stats import t

    seeds = sorted(first.keys() & other.keys())
    if not seeds:
        return None
    found = [other[seed] - first[seed] for seed in seeds]
    mean, n = fmean(found), len(found)
    if n < FEWEST:
        return Difference(mean, None, None, n)
    half = float(t.ppf((1 + level) / 2, n - 1)) * stdev(found) / sqrt(n)
    half = max(half, _NOISE * max(abs(one[seed]) for one in (first, other) for seed in seeds))
    return Difference(mean, mean - half, mean + half, n)


def verdict(settings: Sequence[BySeed], better: Better, lost: Collection[int] = ()) -> Verdict:
    """Which of the settings is best; those that are ``lost`` cannot be, however good their figures are.

    Of m settings the best one has m - 1 differences, and each interval has a level of 1 - .05 / (m - 1) (Bonferroni):
    that a setting wins which is not better than all others happens in 5 % of figures at most.
    """
    having = [place for place, one in enumerate(settings) if one and place not in lost]
    if not having:
        return Verdict(None, (None,) * len(settings), ())
    sign = 1.0 if better == "less" else -1.0
    best = min(having, key=lambda place: sign * fmean(settings[place].values()))
    level = 1 - (1 - LEVEL) / max(len(having) - 1, 1)
    found = tuple(difference(settings[best], one, level) for one in settings)
    worse = [one is not None and one.separated and sign * one.value > 0 for one in found]
    rivals = sum(map(bool, settings))
    return Verdict(best, found, tuple(place for place in having if place != best and not worse[place]), rivals)


def front(
    settings: Sequence[Mapping[str, BySeed]], figures: Mapping[str, Better], lost: Collection[int] = ()
) -> tuple[int, ...]:
    """The settings on the Pareto front of all these figures, by their means: no other is no worse in all and better in
    one. A setting that lacks a figure which another one has is worse in it; those that are ``lost`` are left out."""
    points = [[_cost(one.get(key, {}), better) for key, better in figures.items()] for one in settings]
    able = [place for place in range(len(points)) if place not in lost]
    return tuple(place for place in able if not any(_dominates(points[other], points[place]) for other in able))


def _dominates(one: Sequence[float], other: Sequence[float]) -> bool:
    return one != other and all(a <= b for a, b in zip(one, other, strict=True))


def _cost(values: BySeed, better: Better) -> float:
    """The mean, smaller if it is better; infinite if there is none."""
    return (1.0 if better == "less" else -1.0) * fmean(values.values()) if values else float("inf")
