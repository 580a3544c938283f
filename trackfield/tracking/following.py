"""Following a target with any tracker: track initiation from reports alone, also after a loss.

A lost track is detected by Page's cumulative sum test (Page 1954): each bearing adds the log likelihood ratio of
"uniformly distributed" to "from the track", and the sum never falls below zero. When it exceeds ``_LOST_AT``, the
track is given up; a correct track lasts at least e^_LOST_AT bearings on average. A share ``CLUTTER`` of bearings may
be uniformly distributed although the track is correct: no single one can end it.

For users' own sensors the distribution of false readings is not known. Their tracks are given up only when their own
standard deviation becomes too large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from trackfield.filters.belief import Belief, Believes, moments
from trackfield.filters.fix import agreeing, centroid, certain_fix
from trackfield.filters.gate import CLUTTER
from trackfield.filters.gaussian import extent
from trackfield.filters.metrics import LOST_M
from trackfield.filters.own_fix import own_fix
from trackfield.filters.types import Estimate, Gaussian, Model, Reports, Tracker
from trackfield.models import doa
from trackfield.models.doa import wrap

S = TypeVar("S")

_LOST_AT = math.log(1e6)
ANYWHERE = np.diag(np.square([1000.0, 1000.0, 10.0, 10.0]))
"""Covariance of an unknown target: wide compared with any field's spacing, and with the speeds of vehicles in town."""


class Followed(NamedTuple, Generic[S]):
    """A tracker on a target, or waiting for one.

    ``track``: the tracker's state, None while waiting; ``doubt``: the sum; ``alone``: without a prior; ``known``: the
    Gaussian of the last estimate, or what the track began with; ``new``: it began with the reports of this very step.
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

    def begin(self, prior: Gaussian | None) -> Followed[S]:
        """The state before the first step; without a prior the track starts from the first reports."""
        if prior is None:
            return Followed(None, 0.0, alone=True)
        return Followed(self.tracker.init(prior, self.model), 0.0, alone=False, known=prior)

    def belief(self, state: Followed[S]) -> Belief | None:
        """What is known of the target; None while there is no track."""
        if state.track is None:
            return None
        own = self.tracker.belief(state.track) if isinstance(self.tracker, Believes) else None
        return state.known if own is None else own

    def resume(self, belief: Belief) -> Followed[S]:
        """The state after a pause that began with ``belief``, over the state of ``model``.

        It may be restarted, as without a prior.
        """
        known = moments(belief)
        if isinstance(self.tracker, Believes):
            track = self.tracker.resume(belief, self.model)
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
        if self.model.own is None:
            doubt = max(0.0, state.doubt + doubts(estimate, reports, self.model.sigma_w))
        if state.alone and (doubt > _LOST_AT or extent(estimate.covariance) > self.lost_m):
            return self._start(reports)
        return Followed(track, doubt, state.alone, Gaussian(estimate.mean, estimate.covariance)), estimate

    def _start(self, reports: Reports) -> tuple[Followed[S], Estimate | None]:
        model = self.model
        fix = first_fix(reports, model.sigma_w) if model.own is None else own_fix(ANYWHERE, model, reports, self.lost_m)
        if fix is None:
            return Followed(None, 0.0, alone=True), None
        return Followed(self.tracker.init(fix, self.model), 0.0, alone=True, known=fix, new=True), Estimate(*fix)


def first_fix(reports: Reports, sigma_w: float) -> Gaussian | None:
    """The belief from the bearings of one step alone, or None if their geometry does not give one."""
    if len(reports) < 2:
        return None
    prior = Gaussian(np.append(centroid(reports), [0.0, 0.0]), ANYWHERE)
    return certain_fix(prior, reports.only(agreeing(prior, reports, sigma_w).believed), sigma_w)


def doubts(estimate: Estimate, reports: Reports, sigma_w: float) -> float:
    """Log likelihood ratio of uniformly distributed bearings to bearings of the estimate; 0 without reports."""
    H = doa.jacobian(estimate.mean, reports.positions)
    variance = np.einsum("ki,ij,kj->k", H, estimate.covariance, H) + sigma_w**2
    misses = wrap(reports.bearings - doa.measure(estimate.mean, reports.positions))
    density = np.exp(-0.5 * np.square(misses) / variance) / np.sqrt(2.0 * np.pi * variance)
    return -float(np.log((1.0 - CLUTTER) * 2.0 * np.pi * density + CLUTTER).sum())
