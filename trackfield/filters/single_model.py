"""Trackers with one Gaussian belief and one motion model (nearly constant velocity): EKF, UKF, prediction only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from trackfield.filters import ekf, ukf
from trackfield.filters.gaussian import Motion, predict
from trackfield.filters.measurement import expected, jacobians, measured, moving, noise_sd, residual, varies
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports


class SingleState(NamedTuple):
    """The ``belief`` over (x, y, vx, vy) and the unknowns of the sensing, after the last step."""

    model: Model
    belief: Gaussian


@dataclass(frozen=True)
class PredictOnly:
    """Predicts from the prior and takes no reports: a baseline that shows the value of reports."""

    needs: ClassVar[tuple[str, ...]] = ()

    def init(self, prior: Gaussian, model: Model) -> SingleState:
        """The state of belief ``prior``."""
        return SingleState(model, prior)

    def step(
        self, state: SingleState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[SingleState, Estimate]:
        """Predict with ``Model.sigma_v``, then update with the readings, if any; no random draws."""
        belief = predict(state.belief, moving(state.model, dt))
        if len(reports):
            belief = self._take(belief, reports, state.model)
        return SingleState(state.model, belief), Estimate(*belief)

    def motion(self, before: SingleState, after: SingleState, dt: float) -> Motion:
        """The predicted motion between two states, ``dt`` seconds apart."""
        return moving(after.model, dt)

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return belief


class Ekf(PredictOnly):
    """Extended Kalman filter with one motion model.

    All readings of a step are one update, linearised at the predicted position.
    """

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return ekf.posterior(
            belief,
            measured(model, reports),
            noise_sd(model, reports, belief.mean),
            lambda x: expected(model, x, reports),
            lambda x: jacobians(model, x, reports),
            lambda difference: residual(model, reports, difference),
        )


class Ukf(PredictOnly):
    """Unscented Kalman filter with one motion model.

    All readings of a step are one update.
    """

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return ukf.posterior(
            belief,
            measured(model, reports),
            _expected_sd(belief, reports, model),
            lambda x: expected(model, x, reports),
            lambda difference: residual(model, reports, difference),
        )


def _expected_sd(belief: Gaussian, reports: Reports, model: Model) -> Array:
    """Root of the mean of the noise's variance (K m,) over the belief, where it depends on the state."""
    if not varies(model):
        return noise_sd(model, reports)
    points, weights = ukf.sigma_points(belief)
    return np.asarray(np.sqrt(weights @ np.square(noise_sd(model, reports, points))))
