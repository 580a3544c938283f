"""SP-CPF: state-partition centralised particle filter (Zhai et al. 2009, algorithm 1).

The bank of parallel EKFs proposes one Gaussian, from which the particles are drawn and then weighed.

Deviations from the paper, and why:

- The particle weight of eq. 26 has a prior p(x_t | x_{t-1}) of rank 2 under the paper's motion model and a
  proposal that knows no ancestors, so it has no value. ``paper`` weights are p(y | x) alone, which reproduces
  the paper's figures; ``gaussian-prior`` weights are p(y | x) N(x; F m, F P F^T + Q) / q(x) with the last
  posterior's m, P. A single bearing says nothing of range, so a step with one sensor always takes the latter.
- The filters' covariance is carried on as the sensors' weighted mean of eq. 19; the reset to zero that eqs.
  7-9 read like loses the target.
- The estimate is the weighted mean before resampling: the paper's mean after it has the same expectation and
  more noise. Its covariance takes in the proposal's as one more sample, since few particles may hold all the
  weight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from trackfield.filters import sp_pekf
from trackfield.filters.fix import intensity_weights
from trackfield.filters.gaussian import constant_velocity, log_density, moments, predict
from trackfield.filters.particles import draw, log_likelihood, propagate
from trackfield.filters.resampling import normalised, systematic
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports


class SpCpfState(NamedTuple):
    """The last step's ``posterior``, the EKFs' covariance ``carried`` (4, 4), and ``particles`` (Ns, 4).

    Before the first step there are no particles, and the posterior is the prior.
    """

    model: Model
    posterior: Gaussian
    carried: Array
    particles: Array | None


@dataclass(frozen=True)
class SpCpf:
    """The tracker: ``particles`` is the paper's Ns, ``nominals`` its N."""

    particles: int = 200
    nominals: int = 15
    weights: Literal["paper", "gaussian-prior"] = "paper"

    def init(self, prior: Gaussian, model: Model) -> SpCpfState:
        """The state of belief ``prior``; particles are drawn in the first step."""
        return SpCpfState(model, prior, prior.covariance, None)

    def step(
        self, state: SpCpfState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[SpCpfState, Estimate]:
        """Propose by the EKF bank, weigh, resample; without reports predict only."""
        model = state.model
        particles = state.particles
        if particles is None:
            particles = draw(state.posterior, self.particles, rng)
        if len(reports) == 0:
            return self._coast(state, particles, dt, rng)
        nominals = particles[rng.integers(self.particles, size=self.nominals)]
        fused = sp_pekf.advance(
            nominals,
            propagate(nominals, dt, model.sigma_v, rng),
            state.carried,
            reports,
            intensity_weights(reports.levels),
            dt=dt,
            sigma_v=model.sigma_v,
            sigma_w=model.sigma_w,
        )
        particles = draw(fused.proposal, self.particles, rng)
        log_weights = log_likelihood(particles, reports, model.sigma_w)
        if self.weights == "gaussian-prior" or len(reports) == 1:
            prior = predict(state.posterior, constant_velocity(dt, model.sigma_v))
            log_weights += log_density(particles, prior) - log_density(particles, fused.proposal)
        weights = normalised(log_weights)
        posterior = _posterior(weights, particles, fused.proposal)
        particles = particles.take(systematic(weights, self.particles, rng), axis=0)
        return SpCpfState(model, posterior, fused.carried, particles), Estimate(*posterior, particles[:, :2])

    def _coast(
        self, state: SpCpfState, particles: Array, dt: float, rng: np.random.Generator
    ) -> tuple[SpCpfState, Estimate]:
        model = state.model
        motion = constant_velocity(dt, model.sigma_v)
        posterior = predict(state.posterior, motion)
        carried = predict(Gaussian(state.posterior.mean, state.carried), motion).covariance
        particles = propagate(particles, dt, model.sigma_v, rng)
        return SpCpfState(model, posterior, carried, particles), Estimate(*posterior, particles[:, :2])


def _posterior(weights: Array, particles: Array, proposal: Gaussian) -> Gaussian:
    mean, covariance = moments(weights, particles)
    effective = 1.0 / np.square(weights).sum()
    return Gaussian(mean, (effective * covariance + proposal.covariance) / (effective + 1.0))
