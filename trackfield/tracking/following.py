"""Following a target with any tracker: track initiation from reports alone, also after a loss.

A lost track is detected by Page's cumulative sum test (Page 1954): each reading adds the log likelihood ratio of "from
anywhere" (for bearings: uniformly distributed) to "from the track", and the sum never falls below zero. When it
exceeds ``_LOST_AT``, the track is given up; a correct track lasts at least e^_LOST_AT readings on average. A share
``CLUTTER`` of readings may come from anywhere although the track is correct: no single one can end it.

A kind of sensing may not know the distribution of false readings (``log_clutter``). Then a track is given up only when
its own standard deviation becomes too large.

One step of reports of passes says too little of the target. In a field of such sensors a track starts from those of an
event, solved by maximum likelihood (``trackfield/filters/solving``); trackers that solve for themselves start so, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from trackfield.filters.belief import Belief, Believes, dimension, moments
from trackfield.filters.checked import started
from trackfield.filters.gate import CLUTTER
from trackfield.filters.gaussian import extent
from trackfield.filters.measurement import extended, log_ratios
from trackfield.filters.metrics import LOST_M
from trackfield.filters.passes.types import REASONS, UNCERTAIN
from trackfield.filters.search import searched
from trackfield.filters.solving.solver import Closed, Ml, Solving
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


@runtime_checkable
class Starts(Protocol):
    """A tracker that starts by itself: its ``step`` takes reports also while it knows nothing of the target.

    It then returns None for the estimate.
    """

    def begin(self, model: Model) -> Any:
        """The state before the first report."""
        ...

    def closed(self, state: Any) -> Closed | None:
        """The event that ended in the step that led to this state, if one did."""
        ...


class Followed(NamedTuple, Generic[S]):
    """A tracker on a target, or waiting for one.

    ``track``: the tracker's state, None while waiting, unless it starts by itself; ``doubt``: the sum, if ``alone``,
    that is, without a prior; ``known``: the Gaussian of the last estimate, or what the track began with, None without
    one; ``new``: it began with the reports of this very step. ``gathered``: the reports of several steps, which a track
    may start from if those of one do not suffice, and a fix of them that none has started from.
    """

    track: S | None
    doubt: float
    alone: bool
    known: Gaussian | None = None
    new: bool = False
    gathered: Solving | None = None


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
            track = self.tracker.begin(self.model) if isinstance(self.tracker, Starts) else None
            return Followed(track, 0.0, alone=True)
        known = extended(prior, self.model.unknowns)
        return Followed(self.tracker.init(known, self.model), 0.0, alone=False, known=known)

    def belief(self, state: Followed[S]) -> Belief | None:
        """What is known of the target; None while there is no track."""
        if state.track is None or state.known is None:
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
        if state.track is not None and isinstance(self.tracker, Starts):
            return self._own(state, reports, dt, rng)
        gathered = self._gathered(state, reports, dt, rng)
        if state.track is None:
            return self._start(reports, gathered)
        track, estimate = self.tracker.step(state.track, reports, dt, rng)
        doubt = 0.0
        if state.alone:
            doubt = max(0.0, state.doubt + doubts(self.model, estimate, reports))
            if doubt > _LOST_AT or extent(estimate.covariance) > self.lost_m:
                return self._start(reports, gathered)
        known = Gaussian(estimate.mean, estimate.covariance)
        return Followed(track, doubt, state.alone, known, gathered=gathered), estimate

    def closed(self, state: Followed[S]) -> Closed | None:
        """The event of reports that ended in the step that led to this state, if the track is made, or starts, so.

        A fix that is too uncertain for a track is none.
        """
        if isinstance(self.tracker, Starts):
            found = self.tracker.closed(state.track)
        else:
            found = state.gathered.closed if state.gathered and (state.new or state.track is None) else None
        if found is None or found.refused or state.known is not None:
            return found
        return found._replace(refused=REASONS[UNCERTAIN], used=(False,) * len(found.used))

    def _own(
        self, state: Followed[S], reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[Followed[S], Estimate | None]:
        """The step of a tracker that starts by itself; it has no track while it is too uncertain of where."""
        assert state.track is not None
        track, estimate = self.tracker.step(state.track, reports, dt, rng)
        if estimate is None or (state.alone and extent(estimate.covariance) > self.lost_m):
            return Followed(track, 0.0, state.alone), None
        known = Gaussian(estimate.mean, estimate.covariance)
        return Followed(track, 0.0, state.alone, known, new=state.known is None), estimate

    def _gathered(self, state: Followed[S], reports: Reports, dt: float, rng: np.random.Generator) -> Solving | None:
        """The reports of several steps, for a start now or after a loss; None if there is no need of them."""
        if self._solver is None or not state.alone:
            return None
        return self._solver.step(state.gathered or self._solver.begin(self.model), reports, dt, rng)[0]

    def _start(self, reports: Reports, gathered: Solving | None) -> tuple[Followed[S], Estimate | None]:
        if gathered is None:
            fix = self._fix(reports)
        else:
            certain = gathered.fix is not None and extent(gathered.fix.belief.covariance) <= self.lost_m
            fix = extended(gathered.fix.belief, self.model.unknowns) if gathered.fix and certain else None
        if fix is None:
            return Followed(None, 0.0, alone=True, gathered=gathered), None
        track = self.tracker.init(fix, self.model)
        used = None if gathered is None else gathered._replace(fix=None)  # no track starts from it again
        return Followed(track, 0.0, alone=True, known=fix, new=True, gathered=used), Estimate(*fix)

    @cached_property
    def _solver(self) -> Ml | None:
        """What finds the start of a track in the reports of several steps, if these are of passes."""
        return Ml() if all(kind.passes is not None for kind in self.model.kinds.values()) else None

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
