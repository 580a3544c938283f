"""Gating: the likeliest hypothesis (``Story``) on which bearings of a step to use, by Bayes' rule (Box & Tiao 1968).

A bearing is the target's, with probability 1 - ``CLUTTER``, or clutter, uniformly distributed: its sensor is stuck,
biased, babbling, or late by its clock. A hypothesis says which are which. Its posterior odds are the evidence that
the accepted bearings give for the prior, times 1 - ``CLUTTER`` for each of them and ``CLUTTER`` / 2 pi for each
other. The search is stepwise: it begins with all bearings accepted and leaves out, one after the other, the bearing
whose removal makes the hypothesis likeliest.

As the evidence is joint, each bearing is judged by the prior and all other bearings together. Bearings that deviate
together, as when the target turns, support each other; a single deviating bearing is left out.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

CLUTTER: Final = 0.05
"""The probability that a bearing of a sensor without history is clutter."""

Indices = npt.NDArray[np.intp]


def left_out(clutter: Array | float) -> Array:
    """The change of a hypothesis's log odds when a bearing is left out, without the change of its evidence."""
    odds: Array = np.log(clutter) - np.log1p(-np.asarray(clutter)) - math.log(2.0 * math.pi)
    return odds


class Judge(Protocol):
    """The log evidence that some bearings, at least one, give for the prior."""

    def evidence(self, which: Indices) -> float:
        """The evidence of these bearings together."""
        ...

    def without(self, which: Indices) -> Array:
        """The evidence without each of them (k,); minus infinity for those that cannot be left out."""
        ...


class Story(NamedTuple):
    """A hypothesis: the accepted bearings, ascending, and its log odds against all bearings being clutter."""

    believed: Indices
    log_odds: float


def likeliest(clutter: Array, judge: Judge) -> Story:
    """The likeliest hypothesis on K bearings; ``clutter`` (K,) is the probability that each is clutter.

    When leaving out no longer helps, a bearing left out before may fit the remaining ones: it is accepted again, and
    so on as long as the odds improve.
    """
    gain = left_out(clutter)
    story = _fewer(Story(np.arange(len(clutter)), -np.inf), gain, judge)
    while (more := _more(story, gain, judge)).log_odds > story.log_odds:
        story = _fewer(more, gain, judge)
    return story


def _fewer(story: Story, gain: Array, judge: Judge) -> Story:
    believed = story.believed
    while len(believed):
        evidence = judge.evidence(believed)
        change = judge.without(believed) + gain[believed] - evidence
        least = int(change.argmax())
        if change[least] <= 0.0:
            return Story(believed, evidence - float(gain[believed].sum()))
        believed = np.delete(believed, least)
    return Story(believed, 0.0)


def _more(story: Story, gain: Array, judge: Judge) -> Story:
    """The likeliest hypothesis with one more bearing accepted; this one if all are."""
    wider = [np.sort(np.append(story.believed, k)) for k in np.setdiff1d(np.arange(len(gain)), story.believed)]
    stories = [Story(which, judge.evidence(which) - float(gain[which].sum())) for which in wider]
    return max(stories, key=lambda other: other.log_odds, default=story)
