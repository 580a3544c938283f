"""Which bearings to believe: the likeliest story of a step, by Bayes' rule (Box & Tiao 1968).

A bearing is the target's, with probability 1 - ``CLUTTER``, or it comes from anywhere: its sensor is stuck,
biased, babbling, or late by its clock. A story says which are which. Its posterior odds are the evidence that
the believed bearings give for the prior, times 1 - ``CLUTTER`` for each of them and ``CLUTTER`` / 2 pi for each
other. The search is stepwise: it begins with all believed and leaves out, one after the other, the bearing
without which the story is likelier by most.

As the evidence is joint, each bearing is judged by the prior and all other bearings together. Bearings that
are off together, as when the target turns, support each other; one that is off alone is left out.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

CLUTTER: Final = 0.05
"""The probability that a bearing of a sensor of which nothing is known does not come from the target."""

Indices = npt.NDArray[np.intp]


def left_out(clutter: Array | float) -> Array:
    """What leaving out a bearing adds to the log odds of a story, beside the change of its evidence."""
    odds: Array = np.log(clutter) - np.log1p(-np.asarray(clutter)) - math.log(2.0 * math.pi)
    return odds


class Judge(Protocol):
    """What some bearings, at least one, tell: the log evidence that they give for the prior."""

    def evidence(self, which: Indices) -> float:
        """Of these bearings together."""
        ...

    def without(self, which: Indices) -> Array:
        """What it would be without each of them (k,); minus infinity for those that cannot be at fault."""
        ...


class Story(NamedTuple):
    """The bearings believed, ascending, and the story's log odds against the one in which all are clutter."""

    believed: Indices
    log_odds: float


def likeliest(clutter: Array, judge: Judge) -> Story:
    """The likeliest story of K bearings, ``clutter`` (K,) the probability of each to be that.

    When leaving out helps no more, a bearing left out before may fit those that are left: it comes back, and so
    on for as long as the odds improve.
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
    """The likeliest story that believes one bearing more; this one if all are believed."""
    wider = [np.sort(np.append(story.believed, k)) for k in np.setdiff1d(np.arange(len(gain)), story.believed)]
    stories = [Story(which, judge.evidence(which) - float(gain[which].sum())) for which in wider]
    return max(stories, key=lambda other: other.log_odds, default=story)
