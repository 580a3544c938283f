"""Trackers with one Gaussian belief and one motion model (nearly constant velocity): EKF, UKF, prediction only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from trackfield.filters.gaussian import Motion, predict
from trackfield.filters.measurement import moving
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.filters.updates import extended, unscented


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


@dataclass(frozen=True)
class Ekf(PredictOnly):
    """Extended Kalman filter with one motion model.

    All readings of a step are one update, linearised at the predicted position. ``robust``: the noise of readings that
    are far from what was expected is taken for larger.
    """

    robust: bool = False

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return extended(belief, reports, model, robust=self.robust)


@dataclass(frozen=True)
class Ukf(PredictOnly):
    """Unscented Kalman filter with one motion model.

    All readings of a step are one update. ``robust``: the noise of readings that are far from what was expected is
    taken for larger.
    """

    robust: bool = False

    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return unscented(belief, reports, model, robust=self.robust)
