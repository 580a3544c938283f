"""95 % intervals of fitted figures: the jackknife over groups of links, or over blocks of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, log
from typing import Final, NamedTuple

import numpy as np
from scipy import stats

from launcher.calibrate.samples import Bools, Floats, Ints

GROUPS: Final = 40
"""Groups of pairs that are left out one at a time, and at most so many blocks of time."""
LEAST_BLOCKS: Final = 8
"""Of fewer blocks an interval would be as wide as to say nothing."""
CONFIDENCE: Final = 0.95
MOST_LN: Final = log(1e9)


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

    The delete-a-group jackknife (Wolter 2007, 4.2): it needs no model of the spread, and allows that what is in one
    group (windows of a link, reports of a block) depends on each other, but not that groups do. Student's t.
    """
    count = int(groups.max()) + 1
    whole = np.array(estimate(np.ones(len(groups), bool)))
    left_out: Floats = np.array([estimate(groups != group) for group in range(count)])
    sd = np.sqrt((count - 1) / count * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    half = float(stats.t.ppf((1 + CONFIDENCE) / 2, count - 1)) * sd
    return [Fitted(float(v), float(v - h), float(v + h)) for v, h in zip(whole, half, strict=True)]


class Blocks(NamedTuple):
    """The block of each report (R,), and how long blocks are in the mean (s)."""

    of: Ints
    length_s: float


def blocks_of(recording: Ints, t_s: Floats, longest_s: float) -> Blocks:
    """Parts of recordings (R,) by time (R,), each ``longest_s`` long or longer, as far as there are enough of them.

    What is farther apart in time than ``longest_s`` has nothing in common; blocks of that length nearly so.
    """
    spans = [float(np.ptp(t_s[recording == one])) for one in range(int(recording.max()) + 1)]
    each_s = min(max(longest_s, sum(spans) / GROUPS), sum(spans) / LEAST_BLOCKS) or 1.0
    of, next_one = np.empty(len(t_s), np.int64), 0
    for one, span in enumerate(spans):
        parts = max(round(span / each_s), 1)
        mine = recording == one
        into = (t_s[mine] - t_s[mine].min()) / (span or 1.0) * parts
        of[mine] = next_one + np.minimum(into.astype(np.int64), parts - 1)
        next_one += parts
    return Blocks(of, sum(spans) / next_one)


def raised(one: Fitted) -> Fitted:
    """e to the power of a figure, and of the ends of its interval."""
    return Fitted(*(exp(min(end, MOST_LN)) for end in one))
