"""Fix + IMM-UKF: a MAP fix from the first bearings, then interacting unscented Kalman filters.

Two models share nearly constant velocity and differ in the acceleration they expect, a quiet and a
manoeuvring one; in the third the target stands, without which a parked vehicle seems to crawl whenever a few
errors point the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from trackfield.filters import imm, ukf
from trackfield.filters.fix import map_fix
from trackfield.filters.gaussian import Motion, constant_velocity, predict
from trackfield.filters.types import Estimate, Gaussian, Model, Reports, Update
from trackfield.models import doa, motion
from trackfield.models.sound import wrap

_QUIET, _MANOEUVRE = 0.1, 1.5
"""sd of the acceleration per axis, m/s^2."""
_STIR = 0.5
"""sd of a standing target's velocity per axis, m/s: the jitter of a parked satellite receiver."""

# Probabilities per step of going from quiet, manoeuvring, standing to each of them. To stand ends rarely: a
# departure proves itself in two or three steps whatever its prior, while each per cent here is false speed of
# parked vehicles.
_SWITCHING = np.array([[0.97, 0.02, 0.01], [0.1, 0.88, 0.02], [0.0, 0.002, 0.998]])


class FixImmUkfState(NamedTuple):
    """The bank of M=3 models; ``fixed`` once bearings have been taken in."""

    model: Model
    bank: imm.Bank
    fixed: bool


@dataclass(frozen=True)
class FixImmUkf:
    """The tracker."""

    def init(self, prior: Gaussian, model: Model) -> FixImmUkfState:
        """The state of belief ``prior``, shared by all models, which start as equals."""
        m = len(_SWITCHING)
        bank = imm.Bank(np.full(m, 1.0 / m), np.tile(prior.mean, (m, 1)), np.tile(prior.covariance, (m, 1, 1)))
        return FixImmUkfState(model, bank, fixed=False)

    def step(
        self, state: FixImmUkfState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[FixImmUkfState, Estimate]:
        """Mix, predict, take in the bearings; the first bearings by a fix, since the prior may be wide."""
        model = state.model
        bank = imm.mix(state.bank, _SWITCHING)
        belief = predict(Gaussian(bank.mean, bank.covariance), _motions(dt))
        if len(reports) == 0:
            bank = imm.Bank(bank.probability, *belief)
            return FixImmUkfState(model, bank, state.fixed), Estimate(*imm.combined(bank))
        take = _track if state.fixed else _fix
        posterior, log_evidence = take(belief, reports, model.sigma_w)
        bank = imm.Bank(imm.reweigh(bank.probability, log_evidence), *posterior)
        return FixImmUkfState(model, bank, fixed=True), Estimate(*imm.combined(bank))


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
