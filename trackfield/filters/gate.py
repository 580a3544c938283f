"""Gating: the likeliest hypothesis (``Story``) on which readings of a step to use, by Bayes' rule (Box & Tiao 1968).

A reading is the target's, with probability 1 - ``CLUTTER``, or clutter, distributed as its kind of sensing says (for
bearings uniformly): its sensor is stuck, biased, babbling, or late by its clock. A hypothesis says which are which. Its
posterior odds are the evidence that the accepted readings give for the prior, times 1 - ``CLUTTER`` for each of them
and ``CLUTTER`` times the density of clutter (for bearings 1 / 2 pi) for each other. The search is stepwise: it begins
with all readings accepted and leaves out, one after the other, the reading whose removal makes the hypothesis
likeliest. Readings of a kind that does not know the density of its clutter are always accepted.

As the evidence is joint, each reading is judged by the prior and all other readings together. Readings that deviate
together, as when the target turns, support each other; a single deviating reading is left out.
"""

from __future__ import annotations

from typing import Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

CLUTTER: Final = 0.05
"""The probability that a reading of a sensor without history is clutter."""

Indices = npt.NDArray[np.intp]


def left_out(clutter: Array | float, log_density: Array | float) -> Array:
    """The change of a hypothesis's log odds when a reading is left out, without the change of its evidence.

    ``clutter`` (K,) is the probability that it is clutter, ``log_density`` (K,) that of clutter there; NaN: not known,
    and then the change is minus infinity.
    """
    odds: Array = np.log(clutter) - np.log1p(-np.asarray(clutter)) + log_density
    return np.where(np.isnan(odds), -np.inf, odds)


class Judge(Protocol):
    """The log evidence that some readings, at least one, give for the prior."""

    def evidence(self, which: Indices) -> float:
        """The evidence of these readings together."""
        ...

    def without(self, which: Indices) -> Array:
        """The evidence without each of them (k,); minus infinity for those that cannot be left out."""
        ...


class Story(NamedTuple):
    """A hypothesis: the accepted readings, ascending, and its log odds against all readings being clutter."""

    believed: Indices
    log_odds: float


def likeliest(gain: Array, judge: Judge) -> Story:
    """The likeliest hypothesis on K readings; ``gain`` (K,) is what leaving out each changes (``left_out``).

    When leaving out no longer helps, a reading left out before may fit the remaining ones: it is accepted again, and
    so on as long as the odds improve. Readings with a gain of minus infinity count as 0 in the odds.
    """
    story = _fewer(Story(np.arange(len(gain)), -np.inf), gain, judge)
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
            return Story(believed, evidence - total(gain[believed]))
        believed = np.delete(believed, least)
    return Story(believed, 0.0)


def _more(story: Story, gain: Array, judge: Judge) -> Story:
    """The likeliest hypothesis with one more reading accepted; this one if all are."""
    wider = [np.sort(np.append(story.believed, k)) for k in np.setdiff1d(np.arange(len(gain)), story.believed)]
    stories = [Story(which, judge.evidence(which) - total(gain[which])) for which in wider]
    return max(stories, key=lambda other: other.log_odds, default=story)


def total(gain: Array) -> float:
    """The sum of gains (k,), those of readings that cannot be left out taken as 0."""
    return float(np.where(np.isneginf(gain), 0.0, gain).sum())
