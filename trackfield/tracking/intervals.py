"""Fixed-interval smoothing: a whole track at its end, each step given all reports of the track, earlier and later.

For a process that is told of tracks and fuses no reports itself. It keeps what it was told of each step. When a track
has ended, the smoother of Rauch, Tung & Striebel goes back over it (``trackfield/filters/rts.py``), with the motion
that the tracker itself predicts from step to step. So only trackers with a method ``motion`` can be smoothed. Steps of
which nothing was told are predicted, and then smoothed as the others.

A smoothed track has a point at each step at which the live track could have one: from the first step told to where the
tracker gives the track up, since nothing was told for too long. A tracker's track also ends where it is told to have
none, and where what is told does not follow from what was told before: there a new one began.

The beliefs are taken for those of one filter, also where another process took over. If that one did not know of the
last reports of its predecessor, the smoothed covariances of these steps are not exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters import rts
from trackfield.filters.belief import Belief, dimension, moments
from trackfield.filters.gaussian import Motion, extent
from trackfield.filters.measurement import STATE, extended
from trackfield.filters.types import Array, Estimate, Gaussian, Reports
from trackfield.role import TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.points import track_point
from trackfield.tracking.smoothing import Filtered, Foresees, rts_name

MOST: Final = 512
"""What is told of so many steps is kept at most; of a longer track the older half is published before its end."""
APART: Final = 6.0
"""In standard deviations: a position told that is farther from the one predicted is that of a new track."""
WIDER: Final = 2.0
"""So is one whose standard deviation is larger by this factor: with more reports it can only become smaller."""


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What a process was told: the term's ``number``, of which ``step``, by whom, from whose reports.

    Those need not be ``named``.
    """

    number: int
    step: int
    leader: str
    sensors: tuple[str, ...]
    beliefs: Mapping[str, Belief | None]
    named: bool = True

    @property
    def reports(self) -> Reports:
        """The step and the sensors, without what they reported."""
        return Reports(self.step, self.sensors, np.zeros((len(self.sensors), 2)), ())


class Kept(NamedTuple):
    """What was ``told`` of steps that are to be smoothed, in their order; steps before ``since`` are published."""

    told: tuple[Told, ...] = ()
    since: int = 0


class Closed(NamedTuple):
    """What is still kept, and the points that are published."""

    kept: Kept
    points: list[TrackPoint]


class Intervals:
    """Smooths the tracks of a bank's trackers from what is told of them."""

    def __init__(self, bank: Bank) -> None:
        self.bank = bank
        self.names = [name for name, one in bank.trackers.items() if isinstance(one.following.tracker, Foresees)]

    def learn(self, kept: Kept, told: Told) -> Kept:
        """With what was told of a step, whenever it came; the same ``kept`` if it is of no use.

        Of two terms that tell of one step the higher counts, and where a higher term has begun a lower one is over.
        """
        if told.step < kept.since or any(_overrules(one, told) for one in kept.told):
            return kept
        others = (one for one in kept.told if not _overrules(told, one))
        return kept._replace(told=tuple(sorted((*others, told), key=lambda one: one.step)))

    def ended(self, kept: Kept, live: Iterable[TrackPoint], now: int) -> bool:
        """Whether all that is kept is of tracks that have no ``live`` point of the step ``now`` any more."""
        if not kept.told or kept.told[-1].step > now:
            return False
        return {point.tracker for point in live}.isdisjoint(self.names)

    def close(self, kept: Kept, until: int, now: int) -> Closed:
        """The points of all steps to ``until``, published at the step ``now``."""
        told = tuple(one for one in kept.told if one.step <= until)
        found = [point for name in self.names for point in self._smoothed(name, told, until, now)]
        return Closed(Kept(kept.told[len(told) :], until + 1), found)

    def relieve(self, kept: Kept, now: int) -> Closed:
        """If too much is kept: the points of the older half of the steps, published at the step ``now``."""
        if len(kept.told) <= MOST:
            return Closed(kept, [])
        rest = kept.told[len(kept.told) // 2 :]
        _, points = self.close(kept, kept.told[-1].step, now)
        first = rest[0].step
        return Closed(Kept(rest, first), [one for one in points if one.step is not None and one.step < first])

    def _smoothed(self, name: str, told: tuple[Told, ...], until: int, now: int) -> Iterator[TrackPoint]:
        owners = {one.step: one for one in told}
        owner: Told | None = None
        for track in self._tracks(name, told, until):
            for one, (mean, covariance) in zip(track, _smooth(track), strict=True):
                step = one.reports.step
                owner = owners.get(step, owner)
                estimate, at_ns = Estimate(mean, covariance), self.bank.at_ns(step)
                point = track_point(rts_name(name), self.bank.target, at_ns, one.reports, estimate, now - step)
                if step in owners and not owners[step].named:
                    point = replace(point, status="tracking")
                yield point if owner is None else replace(point, term=owner.number, origin=owner.leader)

    def _tracks(self, name: str, told: tuple[Told, ...], until: int) -> list[list[Filtered]]:
        """The tracks of one tracker, each with all its steps."""
        tracks, ahead = list[list[Filtered]](), None
        for one, after in pairwise([*told, None]):
            assert one is not None
            told_of, last = one.beliefs.get(name), until if after is None else after.step
            belief = self._usable(told_of)
            if told_of is None or belief is None:
                ahead = None
                continue
            if ahead is None or _anew(ahead.belief, belief):
                tracks.append([Filtered(one.reports, belief, None)])
            else:
                tracks[-1].append(Filtered(one.reports, belief, ahead.motion))
            coasted = list(self.bank.coasted(name, told_of, one.step, last))
            ahead = coasted.pop() if after and coasted and coasted[-1].reports.step == last else None
            tracks[-1] += coasted
        return tracks

    def _usable(self, belief: Belief | None) -> Gaussian | None:
        """A belief over the whole state; None if there is none, or none of such a state."""
        n = self.bank.model.dimension
        if belief is None or dimension(belief) not in (STATE, n):
            return None
        return extended(moments(belief), self.bank.model.unknowns)


def _overrules(one: Told, other: Told) -> bool:
    """Whether what the ``one`` says leaves no room for the ``other``."""
    if one.number == other.number:
        return one.step == other.step
    return one.number > other.number and one.step <= other.step


def _anew(ahead: Gaussian, told: Gaussian) -> bool:
    """Whether a belief does not follow from the prediction ``ahead``."""
    gap = (told.mean - ahead.mean)[:2]
    spread = (told.covariance + ahead.covariance)[:2, :2]
    far = gap @ np.linalg.pinv(spread) @ gap > APART**2
    return bool(far) or extent(told.covariance) > WIDER * extent(ahead.covariance)


def _smooth(track: list[Filtered]) -> Iterator[tuple[Array, Array]]:
    """The means (n,) and covariances (n, n) of a track's steps, given all of them."""
    beliefs = Gaussian(*(np.stack(parts) for parts in zip(*(one.belief for one in track), strict=True)))
    motions = [one.motion for one in track if one.motion is not None]
    if motions:
        F, Q = (np.stack(parts) for parts in zip(*motions, strict=True))
        beliefs = rts.smooth(beliefs, Motion(F, Q))
    return zip(*beliefs, strict=True)
