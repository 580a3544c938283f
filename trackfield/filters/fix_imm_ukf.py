"""Fix + IMM-UKF: a MAP fix from the first bearings, then interacting unscented Kalman filters.

Two models, a quiet and a manoeuvring one, have nearly constant velocity and differ in the acceleration they expect; in
the third the target stands. Without it a parked vehicle seems to crawl whenever a few errors point the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from immutables import Map

from trackfield.filters import imm, ukf
from trackfield.filters.belief import Belief, Modes, moments
from trackfield.filters.fix import agreeing, certain_fix, map_fix
from trackfield.filters.gate import Indices, left_out, likeliest
from trackfield.filters.gaussian import Motion, constant_velocity, predict
from trackfield.filters.suspicion import Suspicion, clutter, learn
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports, Update
from trackfield.models import doa, motion
from trackfield.models.doa import wrap

_QUIET, _MANOEUVRE = 0.1, 1.5
"""sd of the acceleration per axis, m/s^2."""
_STIR = 0.5
"""sd of a standing target's velocity per axis, m/s: the jitter of a parked satellite-navigation receiver."""

# Probabilities per step of going from quiet, manoeuvring, standing to each of them. Standing ends rarely: a departure
# is detected in two or three steps whatever its prior, while each per cent here adds false speed to parked vehicles.
_SWITCHING = np.array([[0.97, 0.02, 0.01], [0.1, 0.88, 0.02], [0.0, 0.002, 0.998]])

_ASTRAY, _WIDER = np.log(1e-2), 10.0
"""Log odds that the track is off the target (``astray``), and the factor by which its sd is then too small."""


class FixImmUkfState(NamedTuple):
    """The bank of M=3 models; ``fixed`` after the first bearings; the suspicion about each sensor; whether the track
    was considered ``astray`` (off the target) in the last step."""

    model: Model
    bank: imm.Bank
    fixed: bool
    suspicion: Suspicion = Map()
    astray: bool = False


Take = Callable[[Gaussian, Reports, float], Update]


class _Plan(NamedTuple):
    """How to use the bearings of a step: the bank to update, the bearings to ``take``, and whether ``astray``."""

    bank: imm.Bank
    take: Take
    believed: Indices
    astray: bool = False


@dataclass(frozen=True)
class FixImmUkf:
    """Least-squares fix at the start, then unscented Kalman filters under three motion models (IMM).

    Without its ``gate`` it uses every bearing.
    """

    needs: ClassVar[tuple[str, ...]] = ("bearings", "one kind")

    gate: bool = True

    def init(self, prior: Gaussian, model: Model) -> FixImmUkfState:
        """The state of belief ``prior``, shared by all models, which start with equal probabilities."""
        m = len(_SWITCHING)
        bank = imm.Bank(np.full(m, 1.0 / m), np.tile(prior.mean, (m, 1)), np.tile(prior.covariance, (m, 1, 1)))
        return FixImmUkfState(model, bank, fixed=False)

    def belief(self, state: FixImmUkfState) -> Modes:
        """The beliefs of its three models."""
        return Modes(*state.bank)

    def resume(self, belief: Belief, model: Model) -> FixImmUkfState:
        """Three modes are those of its models, any other belief is a prior; no sensor is suspected.

        The first bearings are used by a fix again: the pause may have hidden a manoeuvre.
        """
        if isinstance(belief, Modes) and len(belief.weights) == len(_SWITCHING):
            return FixImmUkfState(model, imm.Bank(*belief), fixed=False)
        return self.init(moments(belief), model)

    def step(
        self, state: FixImmUkfState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[FixImmUkfState, Estimate]:
        """Mix, predict, update with the bearings; the first bearings by a fix, since the prior may be wide."""
        bank = imm.mix(state.bank, _SWITCHING)
        bank = imm.Bank(bank.probability, *predict(Gaussian(bank.mean, bank.covariance), _motions(dt)))
        bank, take, believed, astray = self._plan(state, bank, reports)
        suspicion = learn(state.suspicion, reports.sensors, believed)
        if len(believed) == 0:
            after = FixImmUkfState(state.model, bank, state.fixed, suspicion)
            return after, Estimate(*imm.combined(bank))
        belief = Gaussian(bank.mean, bank.covariance)
        posterior, log_evidence = take(belief, reports.only(believed), state.model.sigma_w)
        bank = imm.Bank(imm.reweigh(bank.probability, log_evidence), *posterior)
        return FixImmUkfState(state.model, bank, True, suspicion, astray), Estimate(*imm.combined(bank))

    def motion(self, before: FixImmUkfState, after: FixImmUkfState, dt: float) -> Motion:
        """The predicted motion between two states ``dt`` seconds apart, over all models."""
        F, Q = imm.expected(before.bank, _SWITCHING, _motions(dt))
        if after.astray:
            ahead = predict(imm.combined(before.bank), Motion(F, Q)).covariance
            Q = Q + (_WIDER**2 - 1.0) * ahead
        return Motion(F, Q)

    def _plan(self, state: FixImmUkfState, bank: imm.Bank, reports: Reports) -> _Plan:
        take = _track if state.fixed else _fix
        if not self.gate:
            return _Plan(bank, take, np.arange(len(reports)))
        sigma_w, chances = state.model.sigma_w, clutter(state.suspicion, reports.sensors)
        if not state.fixed:
            return _Plan(bank, take, agreeing(imm.combined(bank), reports, sigma_w, chances).believed)
        story = likeliest(chances, _Bearings(bank, reports, sigma_w))
        if story.log_odds < _usual(chances, sigma_w) + _ASTRAY:
            wide = bank._replace(covariance=_WIDER**2 * bank.covariance)
            anywhere = imm.combined(wide)
            other = agreeing(anywhere, reports, sigma_w, chances)
            likelier = other.log_odds + _ASTRAY > story.log_odds
            # inflating the covariance without a fix would only widen the track, step after step
            if likelier and certain_fix(anywhere, reports.only(other.believed), sigma_w) is not None:
                return _Plan(wide, _fix, other.believed, astray=True)
        return _Plan(bank, take, story.believed)


def _usual(chances: Array, sigma_w: float) -> float:
    """Average log odds of bearings of the nominal accuracy, for a certain track.

    If a hypothesis comes near this value, the hypothesis that the track is astray cannot be likelier.
    """
    gain = -np.log(sigma_w) - 0.5 * np.log(2.0 * np.pi * np.e)
    return float((gain - left_out(chances)).sum())


def _motions(dt: float) -> Motion:
    standing = Motion(np.array(motion.standing_transition()), np.array(motion.standing_noise(dt, _STIR)))
    models = (constant_velocity(dt, _QUIET), constant_velocity(dt, _MANOEUVRE), standing)
    return Motion(*(np.stack(matrices) for matrices in zip(*models, strict=True)))


def _fix(belief: Gaussian, reports: Reports, sigma_w: float) -> Update:
    fixes = [map_fix(Gaussian(m, P), reports, sigma_w) for m, P in zip(*belief, strict=True)]
    mean, covariance = (np.stack(parts) for parts in zip(*(fix.posterior for fix in fixes), strict=True))
    return Update(Gaussian(mean, covariance), np.stack([fix.log_evidence for fix in fixes]))


def _track(belief: Gaussian, reports: Reports, sigma_w: float) -> Update:
    return ukf.update(belief, reports.bearings, sigma_w, lambda x: doa.measure(x, reports.positions), wrap)


@dataclass(frozen=True)
class _Bearings:
    """Evidence of bearings for the whole bank: the models' evidences weighted by their probabilities."""

    bank: imm.Bank
    reports: Reports
    sigma_w: float

    def evidence(self, which: Indices) -> float:
        return float(np.logaddexp.reduce(self._joint(self.reports.only(which))))

    def without(self, which: Indices) -> Array:
        these, belief = self.reports.only(which), Gaussian(self.bank.mean, self.bank.covariance)
        expected = ukf.predictive(belief, these.bearings, self.sigma_w, lambda x: doa.measure(x, these.positions), wrap)
        evidence: Array = np.logaddexp.reduce(self._joint(these)[:, None] - expected, axis=0)
        return evidence

    def _joint(self, these: Reports) -> Array:
        """Log of each model's probability and evidence (M,)."""
        evidence = _track(Gaussian(self.bank.mean, self.bank.covariance), these, self.sigma_w).log_evidence
        with np.errstate(divide="ignore"):
            joint: Array = np.log(self.bank.probability) + evidence
        return joint
