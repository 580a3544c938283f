"""Trackers with one Gaussian belief and one motion model (nearly constant velocity): EKF, UKF, prediction only."""

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
    """Predicts from the prior and takes no reports: a baseline that shows the value of reports."""

    def init(self, prior: Gaussian, model: Model) -> SingleState:
        """The state of belief ``prior``."""
        return SingleState(model, prior)

    def step(
        self, state: SingleState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[SingleState, Estimate]:
        """Predict with ``Model.sigma_v``, then update with the readings, if any; no random draws."""
        belief = predict(state.belief, constant_velocity(dt, state.model.sigma_v))
        if len(reports):
            belief = self._take(belief, reports, state.model)
        return SingleState(state.model, belief), Estimate(*belief)

    def motion(self, before: SingleState, after: SingleState, dt: float) -> Motion:
        """The predicted motion between two states, ``dt`` seconds apart."""
        return constant_velocity(dt, after.model.sigma_v)

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return belief


class Ekf(PredictOnly):
    """Extended Kalman filter with one motion model.

    All readings of a step are one update, linearised at the predicted position.
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
