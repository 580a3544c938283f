"""Following a target with any tracker: track initiation from reports alone, also after a loss.

A lost track is detected by Page's cumulative sum test (Page 1954): each reading adds the log likelihood ratio of "from
anywhere" (for bearings: uniformly distributed) to "from the track", and the sum never falls below zero. When it
exceeds ``_LOST_AT``, the track is given up; a correct track lasts at least e^_LOST_AT readings on average. A share
``CLUTTER`` of readings may come from anywhere although the track is correct: no single one can end it.

A kind of sensing may not know the distribution of false readings (``log_clutter``). Then a track is given up only when
its own standard deviation becomes too large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from trackfield.filters.belief import Belief, Believes, dimension, moments
from trackfield.filters.checked import started
from trackfield.filters.gate import CLUTTER
from trackfield.filters.gaussian import extent
from trackfield.filters.measurement import extended, log_ratios
from trackfield.filters.metrics import LOST_M
from trackfield.filters.search import searched
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports, Tracker

S = TypeVar("S")

_LOST_AT = math.log(1e6)
_FAR_M = 1000.0
"""Standard deviation of the position of an unknown target: wide compared with any field's spacing."""
SPEED_SD = 10.0
"""That of its velocity (m/s), each way, if nothing else is known: that of vehicles in town."""


def anywhere(speed_sd: float) -> Array:
    """Covariance (4, 4) of a target of which no more is known than this standard deviation of its velocity (m/s)."""
    return np.diag(np.square([_FAR_M, _FAR_M, speed_sd, speed_sd]))


ANYWHERE = anywhere(SPEED_SD)


class Followed(NamedTuple, Generic[S]):
    """A tracker on a target, or waiting for one.

    ``track``: the tracker's state, None while waiting; ``doubt``: the sum, if ``alone``, that is, without a prior;
    ``known``: the Gaussian of the last estimate, or what the track began with; ``new``: it began with the reports of
    this very step.
    """

    track: S | None
    doubt: float
    alone: bool
    known: Gaussian | None = None
    new: bool = False


@dataclass(frozen=True)
class Following(Generic[S]):
    """A tracker that needs no prior; with a prior it is the plain tracker and is never restarted."""

    tracker: Tracker[S]
    model: Model
    lost_m: float = LOST_M
    """A track that started without a prior is given up when the sd of its position exceeds this."""
    speed_sd: float = SPEED_SD
    """Standard deviation of the target's velocity (m/s), each way, where a track starts from reports alone."""

    def begin(self, prior: Gaussian | None) -> Followed[S]:
        """The state before the first step; without a prior the track starts from the first reports."""
        if prior is None:
            return Followed(None, 0.0, alone=True)
        known = extended(prior, self.model.unknowns)
        return Followed(self.tracker.init(known, self.model), 0.0, alone=False, known=known)

    def belief(self, state: Followed[S]) -> Belief | None:
        """What is known of the target; None while there is no track."""
        if state.track is None:
            return None
        own = self.tracker.belief(state.track) if isinstance(self.tracker, Believes) else None
        return state.known if own is None else own

    def resume(self, belief: Belief) -> Followed[S]:
        """The state after a pause that began with ``belief``, over the state of ``model`` or (x, y, vx, vy) alone.

        It may be restarted, as without a prior.
        """
        known = extended(moments(belief), self.model.unknowns)
        if isinstance(self.tracker, Believes):
            whole = dimension(belief) == self.model.dimension
            track = self.tracker.resume(belief if whole else known, self.model)
        else:
            track = self.tracker.init(known, self.model)
        return Followed(track, 0.0, alone=True, known=known)

    def step(
        self, state: Followed[S], reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[Followed[S], Estimate | None]:
        """The state ``dt`` seconds later and the estimate, None while there is no track."""
        if state.track is None:
            return self._start(reports)
        track, estimate = self.tracker.step(state.track, reports, dt, rng)
        doubt = 0.0
        if state.alone:
            doubt = max(0.0, state.doubt + doubts(self.model, estimate, reports))
            if doubt > _LOST_AT or extent(estimate.covariance) > self.lost_m:
                return self._start(reports)
        return Followed(track, doubt, state.alone, Gaussian(estimate.mean, estimate.covariance)), estimate

    def _start(self, reports: Reports) -> tuple[Followed[S], Estimate | None]:
        fix = self._fix(reports)
        if fix is None:
            return Followed(None, 0.0, alone=True), None
        return Followed(self.tracker.init(fix, self.model), 0.0, alone=True, known=fix, new=True), Estimate(*fix)

    def _fix(self, reports: Reports) -> Gaussian | None:
        """A belief from the readings of one step alone: as their kind finds it, or by the general search."""
        if not len(reports):
            return None
        ((name, kind), *more) = self.model.kinds.items()
        if kind.fix is not None and not more:
            fix = kind.fix(reports.readings[0].values, reports.positions, anywhere(self.speed_sd))
            return None if fix is None else extended(started(name, fix, len(kind.unknowns)), self.model.unknowns)
        return searched(anywhere(self.speed_sd), self.model, reports, self.lost_m)


def doubts(model: Model, estimate: Estimate, reports: Reports) -> float:
    """Log likelihood ratio of readings from anywhere to readings of the estimate; 0 without reports.

    Kinds of sensing that do not know where else their readings may come from say nothing.
    """
    ratios = np.exp(log_ratios(model, Gaussian(estimate.mean, estimate.covariance), reports))
    ratios *= 1.0 - CLUTTER
    ratios += CLUTTER
    return -float(np.log(ratios).sum())
