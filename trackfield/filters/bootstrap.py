"""Bootstrap particle filter (Gordon, Salmond & Smith 1993): motion proposes, the likelihood weighs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import moments
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.particles import draw, propagate
from trackfield.filters.resampling import normalised, systematic
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports


class BootstrapState(NamedTuple):
    """``particles`` (n, 4) of equal weight; before the first step there is only the prior."""

    model: Model
    prior: Gaussian
    particles: Array | None


@dataclass(frozen=True)
class Bootstrap:
    """The tracker; ``n`` particles, resampled in every step that has reports."""

    n: int = 2000

    def init(self, prior: Gaussian, model: Model) -> BootstrapState:
        """The state of belief ``prior``; particles are drawn in the first step."""
        return BootstrapState(model, prior, None)

    def step(
        self, state: BootstrapState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[BootstrapState, Estimate]:
        """Propagate, weigh by the readings, resample; without reports propagate only."""
        model, prior, particles = state
        if particles is None:
            particles = draw(prior, self.n, rng)
        particles = propagate(particles, dt, model.sigma_v, rng)
        weights = normalised(log_likelihood(model, particles, reports))
        mean, covariance = moments(weights, particles)
        if len(reports):
            particles = particles[systematic(weights, self.n, rng)]
        return BootstrapState(model, prior, particles), Estimate(mean, covariance, particles[:, :2])
