"""95 % intervals of fitted figures: the jackknife over groups of links."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy import stats

from launcher.calibrate.samples import Bools, Floats, Ints

GROUPS: Final = 40
"""Groups of pairs that are left out one at a time."""
CONFIDENCE: Final = 0.95


class Fitted(NamedTuple):
    """A figure and the ends of its interval."""

    value: float
    low: float
    high: float


def groups_of(pairs: Ints) -> Ints:
    """The group of each link (L,), from the number of its pair (L,): both directions of a pair are in one group."""
    found, inverse = np.unique(pairs, return_inverse=True)
    return np.asarray(inverse % min(GROUPS, len(found)))


def jackknifed(estimate: Callable[[Bools], Sequence[float]], groups: Ints) -> list[Fitted]:
    """The figures that ``estimate`` gives for all links, with intervals; it is told which links (L,) count.

    The delete-a-group jackknife (Wolter 2007, 4.2): it needs no model of the spread, and allows that windows of a link
    depend on each other, but not that pairs do. Student's t.
    """
    count = int(groups.max()) + 1
    whole = np.array(estimate(np.ones(len(groups), bool)))
    left_out: Floats = np.array([estimate(groups != group) for group in range(count)])
    sd = np.sqrt((count - 1) / count * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    half = float(stats.t.ppf((1 + CONFIDENCE) / 2, count - 1)) * sd
    return [Fitted(float(v), float(v - h), float(v + h)) for v, h in zip(whole, half, strict=True)]
