"""Fix + joint-DOA proposal: a particle filter that draws from the posterior of all bearings of a step.

The belief between steps is a Gaussian (a Gaussian particle filter; Kotecha & Djuric 2003). Its prediction and all
bearings together give the MAP point and Laplace's covariance there (in the first step, the fix); the particles
drawn from that have weights p(y | x) N(x; F m, F P F^T + Q) / q(x). As most of them have a high weight, few suffice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from trackfield.filters.fix import map_fix
from trackfield.filters.gaussian import Motion, constant_velocity, log_density, moments, predict
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.particles import Particles, draw
from trackfield.filters.resampling import normalised, systematic
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.options import Within


class FixDoaState(NamedTuple):
    """The ``belief`` over (x, y, vx, vy) after the last step."""

    model: Model
    belief: Gaussian


@dataclass(frozen=True)
class FixDoa:
    """Particle filter that starts from a least-squares fix and draws from all bearings of a step at once.

    ``particles`` in each step, and its own ``sigma_v`` (m/s^2), wide enough for manoeuvres.
    """

    needs: ClassVar[tuple[str, ...]] = ("bearings", "one kind")

    particles: Particles = 200
    sigma_v: Annotated[float, Within(0, 10_000)] = 1.0

    def init(self, prior: Gaussian, model: Model) -> FixDoaState:
        """The state of belief ``prior``."""
        return FixDoaState(model, prior)

    def step(
        self, state: FixDoaState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[FixDoaState, Estimate]:
        """Predict, draw from the joint bearings, weight; without reports predict only."""
        model = state.model
        belief = predict(state.belief, constant_velocity(dt, self.sigma_v))
        if len(reports) == 0:
            shown = draw(belief, self.particles, rng)
            return FixDoaState(model, belief), Estimate(*belief, shown[:, :2])
        proposal = map_fix(belief, reports, model).posterior
        particles = draw(proposal, self.particles, rng)
        log_weights = log_likelihood(model, particles, reports)
        weights = normalised(log_weights + log_density(particles, belief) - log_density(particles, proposal))
        belief = moments(weights, particles)
        particles = particles.take(systematic(weights, self.particles, rng), axis=0)
        return FixDoaState(model, belief), Estimate(*belief, particles[:, :2])

    def motion(self, before: FixDoaState, after: FixDoaState, dt: float) -> Motion:
        """The predicted motion between two states, ``dt`` seconds apart."""
        return constant_velocity(dt, self.sigma_v)
