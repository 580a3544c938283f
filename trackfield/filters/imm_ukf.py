"""Fix + IMM-UKF: a MAP fix from the first readings, then interacting unscented Kalman filters.

The models of motion are four. Two, quiet and manoeuvring, have nearly constant velocity and differ in the acceleration
they expect; in another the target stands. Without it a parked vehicle seems to crawl whenever a few errors point the
same way. What the kinds of sensing do not know of the target besides (x, y, vx, vy) is estimated with it, as random
walks.

The fourth, steady, moves like quiet and is left ten times as rarely: how long a target keeps its velocity is not
geometrically distributed, as between states of a single Markov chain. A vehicle in traffic brakes or turns every few
seconds; one that has gone straight for a minute will mostly go on. With one quiet model a tracker must be ready for
either all the time, too much for the one and too little for the other. Two states of the same motion let the time that
the target has been quiet count (sojourn-time dependent switching: Campo, Mookerjee & Bar-Shalom 1991), and remain a
Markov chain. ``docs/tracking.md`` says what that changes, and what else was tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from immutables import Map

from trackfield.filters import imm
from trackfield.filters.belief import Belief, Modes, moments
from trackfield.filters.fix import agreeing, certain_fix, enough, map_fix
from trackfield.filters.gate import Indices, left_out, likeliest, total
from trackfield.filters.gaussian import Motion, constant_velocity, predict
from trackfield.filters.measurement import log_anywhere, noise_sd, varies, widened
from trackfield.filters.suspicion import Suspicion, clutter, learn
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports, Update
from trackfield.filters.updates import unscented_predictive, unscented_update
from trackfield.models import motion
from trackfield.models.unknowns import Unknown

_QUIET, _MANOEUVRE = 0.1, 1.5
"""sd of the acceleration per axis, m/s^2."""
_STIR = 0.5
"""sd of a standing target's velocity per axis, m/s: the jitter of a parked satellite-navigation receiver."""

# Probabilities per step of going from steady, quiet, manoeuvring, standing to each of them. A steady target manoeuvres
# or stands only after it has been quiet. Standing ends rarely: a departure is detected in two or three steps whatever
# its prior, while each per cent here adds false speed to parked vehicles.
_SWITCHING = np.array(
    [
        [0.995, 0.005, 0.0, 0.0],
        [0.02, 0.92, 0.05, 0.01],
        [0.0, 0.1, 0.88, 0.02],
        [0.0, 0.0, 0.002, 0.998],
    ]
)

_ASTRAY, _WIDER = np.log(1e-2), 10.0
"""Log odds that the track is off the target (``astray``), and the factor by which its sd is then too small."""


class ImmUkfState(NamedTuple):
    """The bank of M=4 models; ``fixed`` after the first readings; the suspicion about each sensor; whether the track
    was considered ``astray`` (off the target) in the last step."""

    model: Model
    bank: imm.Bank
    fixed: bool
    suspicion: Suspicion = Map()
    astray: bool = False


class _Plan(NamedTuple):
    """How to use the readings of a step: the bank to update, how to ``take`` those ``believed``, whether ``astray``."""

    bank: imm.Bank
    take: Callable[[Indices], Update]
    believed: Indices
    astray: bool = False


@dataclass(frozen=True)
class ImmUkf:
    """Least-squares fix at the start, then unscented Kalman filters under four motion models (IMM).

    Without its ``gate`` it uses every reading. ``robust``: it takes the noise of readings for larger that are far from
    what was expected.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    gate: bool = True
    robust: bool = False

    def init(self, prior: Gaussian, model: Model) -> ImmUkfState:
        """The state of belief ``prior``, shared by all models, which start with equal probabilities."""
        m = len(self._switching)
        bank = imm.Bank(np.full(m, 1.0 / m), np.tile(prior.mean, (m, 1)), np.tile(prior.covariance, (m, 1, 1)))
        return ImmUkfState(model, bank, fixed=False)

    def belief(self, state: ImmUkfState) -> Modes:
        """The beliefs of its four models."""
        return Modes(*state.bank)

    def resume(self, belief: Belief, model: Model) -> ImmUkfState:
        """Four modes are those of its models, any other belief is a prior; no sensor is suspected.

        The first readings are used by a fix again: the pause may have hidden a manoeuvre.
        """
        if isinstance(belief, Modes) and len(belief.weights) == len(self._switching):
            return ImmUkfState(model, imm.Bank(*belief), fixed=False)
        return self.init(moments(belief), model)

    def step(
        self, state: ImmUkfState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[ImmUkfState, Estimate]:
        """Mix, predict, update with the readings; the first readings by a fix, since the prior may be wide."""
        model, bank = state.model, imm.mix(state.bank, self._switching)
        bank = imm.Bank(bank.probability, *predict(Gaussian(bank.mean, bank.covariance), self._motions(dt, model)))
        bank, take, believed, astray = self._plan(state, bank, reports)
        suspicion = learn(state.suspicion, reports.sensors, believed)
        if len(believed) == 0:
            after = ImmUkfState(model, bank, state.fixed, suspicion)
            return after, Estimate(*imm.combined(bank))
        posterior, log_evidence = take(believed)
        bank = imm.Bank(imm.reweigh(bank.probability, log_evidence), *posterior)
        return ImmUkfState(model, bank, True, suspicion, astray), Estimate(*imm.combined(bank))

    def motion(self, before: ImmUkfState, after: ImmUkfState, dt: float) -> Motion:
        """The predicted motion between two states ``dt`` seconds apart, over all models."""
        F, Q = imm.expected(before.bank, self._switching, self._motions(dt, after.model))
        if after.astray:
            ahead = predict(imm.combined(before.bank), Motion(F, Q)).covariance
            Q = Q + (_WIDER**2 - 1.0) * ahead
        return Motion(F, Q)

    @property
    def _switching(self) -> Array:
        """Probabilities (M, M) per step of going from each model to each."""
        return _SWITCHING

    def _motions(self, dt: float, model: Model) -> Motion:
        """How the target moves in ``dt`` seconds by each of the models, (M, 4 + u, 4 + u)."""
        return _motions(dt, model.unknowns)

    def _plan(self, state: ImmUkfState, bank: imm.Bank, reports: Reports) -> _Plan:
        model, readings = state.model, _Readings(bank, reports, state.model, self.robust)
        take = readings.update if state.fixed else readings.fix
        if not self.gate or not len(reports):
            return _Plan(bank, take, np.arange(len(reports)))
        chances = clutter(state.suspicion, reports.sensors)
        if not state.fixed:
            return _Plan(bank, take, agreeing(imm.combined(bank), reports, model, chances).believed)
        gain = left_out(chances, log_anywhere(model, reports))
        story = likeliest(gain, readings)
        unlikely = story.log_odds < _usual(gain, bank, reports, model) + _ASTRAY
        if unlikely and not readings.settled(story.believed):
            wide = bank._replace(covariance=_WIDER**2 * bank.covariance)
            anywhere = imm.combined(wide)
            other = agreeing(anywhere, reports, model, chances)
            likelier = other.log_odds + _ASTRAY > story.log_odds
            # inflating the covariance without a fix would only widen the track, step after step
            if likelier and certain_fix(anywhere, reports.only(other.believed), model) is not None:
                return _Plan(wide, replace(readings, bank=wide, known={}).fix, other.believed, astray=True)
        return _Plan(bank, take, story.believed)


def _usual(gain: Array, bank: imm.Bank, reports: Reports, model: Model) -> float:
    """Average log odds of readings of the nominal accuracy, for a certain track.

    If a hypothesis comes near this value, the hypothesis that the track is astray cannot be likelier.
    """
    sd = noise_sd(model, reports, imm.combined(bank).mean if varies(model) else None)
    return float((-np.log(sd) - 0.5 * np.log(2.0 * np.pi * np.e)).sum()) - total(gain)


@lru_cache(maxsize=64)
def _motions(dt: float, unknowns: tuple[Unknown, ...]) -> Motion:
    standing = Motion(np.array(motion.standing_transition()), np.array(motion.standing_noise(dt, _STIR)))
    quiet = constant_velocity(dt, _QUIET)
    models = (quiet, quiet, constant_velocity(dt, _MANOEUVRE), standing)
    stacks = (np.stack(each) for each in zip(*(widened(one, unknowns, dt) for one in models), strict=True))
    return Motion(*stacks)


@dataclass(frozen=True)
class _Readings:
    """The readings of a step for the whole bank, and their evidence: the models', weighted by their probabilities.

    ``known`` are the updates that were asked for before, by the bytes of the indices.
    """

    bank: imm.Bank
    reports: Reports
    model: Model
    robust: bool
    known: dict[bytes, Update] = field(default_factory=dict)

    @property
    def belief(self) -> Gaussian:
        return Gaussian(self.bank.mean, self.bank.covariance)

    def fix(self, which: Indices) -> Update:
        """The beliefs of all models by a fix from these readings."""
        these = self._only(which)
        fixes = [map_fix(Gaussian(m, P), these, self.model) for m, P in zip(*self.belief, strict=True)]
        mean, covariance = (np.stack(parts) for parts in zip(*(fix.posterior for fix in fixes), strict=True))
        return Update(Gaussian(mean, covariance), np.stack([fix.log_evidence for fix in fixes]))

    def update(self, which: Indices) -> Update:
        """The same by their unscented filters."""
        key = which.tobytes()
        if key not in self.known:
            self.known[key] = unscented_update(self.belief, self._only(which), self.model, robust=self.robust)
        return self.known[key]

    def settled(self, which: Indices) -> bool:
        """Whether the track hardly moves for these readings, and they outnumber the others by far.

        Half the distance squared by which they move it, in units of its covariance, is what the track costs them in log
        odds, and what they could gain at most elsewhere. By far is by more than two positions take.
        """
        others = len(self.reports) - len(which)
        if len(which) - others <= 2 * enough(self.model, self._only(which)):
            return False
        mean, covariance = imm.combined(self.bank)
        posterior, log_evidence = self.update(which)
        after = imm.combined(imm.Bank(imm.reweigh(self.bank.probability, log_evidence), *posterior))
        way = after.mean - mean
        return bool(way @ np.linalg.pinv(covariance, hermitian=True) @ way < -2.0 * _ASTRAY)

    def evidence(self, which: Indices) -> float:
        """See ``Judge``."""
        return float(np.logaddexp.reduce(self._joint(which)))

    def without(self, which: Indices) -> Array:
        """See ``Judge``. Of readings of several numbers all are left out together."""
        these = self._only(which)
        if any(self.model.kinds[one.kind].m > 1 for one in these.readings):
            return np.array([self.evidence(np.delete(which, k)) if len(which) > 1 else 0.0 for k in range(len(which))])
        expected = unscented_predictive(self.belief, these, self.model, robust=self.robust)
        evidence: Array = np.logaddexp.reduce(self._joint(which)[:, None] - expected, axis=0)
        return evidence

    def _only(self, which: Indices) -> Reports:
        return self.reports if len(which) == len(self.reports) else self.reports.only(which)

    def _joint(self, which: Indices) -> Array:
        """Log of each model's probability and evidence (M,)."""
        with np.errstate(divide="ignore"):
            joint: Array = np.log(self.bank.probability) + self.update(which).log_evidence
        return joint
