"""Trackers of one Gaussian belief and one motion model, nearly constant velocity: EKF, UKF, and none at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from trackfield.filters import ekf, ukf
from trackfield.filters.gaussian import Motion, constant_velocity, predict
from trackfield.filters.measurement import expected, jacobians, measured, noise_sd, residual
from trackfield.filters.types import Estimate, Gaussian, Model, Reports


class SingleState(NamedTuple):
    """The ``belief`` over (x, y, vx, vy) after the last step."""

    model: Model
    belief: Gaussian


@dataclass(frozen=True)
class PredictOnly:
    """Predicts from the prior and takes no reports: shows what reports are worth."""

    def init(self, prior: Gaussian, model: Model) -> SingleState:
        """The state of belief ``prior``."""
        return SingleState(model, prior)

    def step(
        self, state: SingleState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[SingleState, Estimate]:
        """Predict with ``Model.sigma_v``, then take in the readings, if there are any; nothing is drawn."""
        belief = predict(state.belief, constant_velocity(dt, state.model.sigma_v))
        if len(reports):
            belief = self._take(belief, reports, state.model)
        return SingleState(state.model, belief), Estimate(*belief)

    def motion(self, before: SingleState, after: SingleState, dt: float) -> Motion:
        """How the target was expected to move between two states, ``dt`` seconds apart."""
        return constant_velocity(dt, after.model.sigma_v)

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return belief


class Ekf(PredictOnly):
    """Extended Kalman filter with one motion model.

    All readings of a step are one update, with slopes at the predicted place.
    """

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return ekf.posterior(
            belief,
            measured(reports),
            noise_sd(model, reports),
            lambda x: expected(model, x, reports),
            lambda x: jacobians(model, x, reports),
            lambda difference: residual(model, difference),
        )


class Ukf(PredictOnly):
    """Unscented Kalman filter with one motion model.

    All readings of a step are one update.
    """

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return ukf.posterior(
            belief,
            measured(reports),
            noise_sd(model, reports),
            lambda x: expected(model, x, reports),
            lambda difference: residual(model, difference),
        )
