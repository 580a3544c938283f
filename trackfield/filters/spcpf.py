"""SP-CPF: state-partition centralised particle filter (Zhai et al. 2009, algorithm 1).

The bank of parallel EKFs gives one Gaussian proposal, from which the particles are drawn and then weighted.

Deviations from the paper, and why:

- The particle weight of eq. 26 has a prior p(x_t | x_{t-1}) of rank 2 under the paper's motion model and a
  proposal that knows no ancestors, so it has no value. ``paper`` weights are p(y | x) only, which reproduces
  the paper's figures; ``gaussian-prior`` weights are p(y | x) N(x; F m, F P F^T + Q) / q(x) with the last
  posterior's m, P. A single bearing gives no range, so a step with one sensor always takes the latter.
- Readings may be of any kind that has one number (the paper's are bearings): ranges, levels. The sensors' weights of
  eq. 24 are their shares in the loudness, as the kind has it.
- The filters' covariance is carried on as the sensors' weighted mean of eq. 19; the reset to zero that eqs.
  7-9 suggest loses the target.
- The estimate is the weighted mean before resampling: the paper's mean after it has the same expectation and
  more noise. Its covariance includes the proposal's as one more sample, since few particles may hold all the
  weight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.filters import sp_pekf
from trackfield.filters.gaussian import constant_velocity, log_density, near_moments, predict, root
from trackfield.filters.measurement import log_likelihood, shares
from trackfield.filters.particles import Particles, advanced, draw, moved, noise_gain, picked
from trackfield.filters.resampling import evenly, normalised
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports
from trackfield.options import Within

Weights = Literal["paper", "gaussian-prior"]


class Cloud(NamedTuple):
    """After a step: its ``posterior``, the EKFs' covariance ``carried`` (..., 4, 4), ``particles`` (..., Ns, 4)."""

    posterior: Gaussian
    carried: Array
    particles: Array


class SpCpfState(NamedTuple):
    """``cloud`` is None before the first step: then there is only the prior."""

    model: Model
    prior: Gaussian
    cloud: Cloud | None


class Draws(NamedTuple):
    """The random numbers of a step: for choosing nominals, moving and placing particles, and resampling."""

    chosen: npt.NDArray[np.intp]
    """(..., N) of Ns"""
    noise: Array
    """(..., N, 2) normal, of the nominals' motion"""
    places: Array
    """(..., Ns, 4) normal"""
    u: Array | float
    """(...,) uniform"""


@dataclass(frozen=True)
class SpCpf:
    """State-partition centralised particle filter of Zhai et al. (2009).

    ``particles`` is the paper's Ns, ``nominals`` its N, ``single`` the weights with one sensor.
    ``robust``: readings that are far from what was expected are taken for outliers, by the EKFs and by the weights.
    """

    needs: ClassVar[tuple[str, ...]] = ("one kind", "one number", "no unknowns")

    particles: Particles = 200
    nominals: Annotated[int, Within(1, 1000)] = 15
    weights: Weights = "paper"
    single: Weights = "gaussian-prior"
    robust: bool = False

    def init(self, prior: Gaussian, model: Model) -> SpCpfState:
        """The state of belief ``prior``; particles are drawn in the first step."""
        return SpCpfState(model, prior, None)

    def step(
        self, state: SpCpfState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[SpCpfState, Estimate]:
        """Draw from the EKF bank's proposal, weight, resample; without reports predict only."""
        model, prior, cloud = state
        if cloud is None:
            cloud = Cloud(prior, prior.covariance, draw(prior, self.particles, rng))
        if len(reports) == 0:
            cloud = coast(cloud, model, dt, rng.standard_normal((self.particles, 2)))
        else:
            weights = self.single if len(reports) == 1 else self.weights
            cloud = fuse(cloud, reports, model, dt, self.draws(rng), weights == "gaussian-prior", robust=self.robust)
        return SpCpfState(model, prior, cloud), Estimate(*cloud.posterior, cloud.particles[:, :2])

    def draws(self, rng: np.random.Generator) -> Draws:
        """The draws of a step with reports."""
        chosen = (rng.random(self.nominals) * self.particles).astype(np.intp)
        normals = rng.standard_normal(2 * self.nominals + 4 * self.particles)
        noise, places = normals[: 2 * self.nominals], normals[2 * self.nominals :]
        return Draws(chosen, noise.reshape(-1, 2), places.reshape(-1, 4), rng.random())


def coast(cloud: Cloud, model: Model, dt: float, normals: Array) -> Cloud:
    """A step without reports; ``normals`` (..., Ns, 2) move the particles."""
    motion = constant_velocity(dt, model.sigma_v)
    posterior = predict(cloud.posterior, motion)
    carried = predict(Gaussian(cloud.posterior.mean, cloud.carried), motion).covariance
    return Cloud(posterior, carried, moved(cloud.particles, dt, model.sigma_v, normals))


def fuse(
    cloud: Cloud,
    reports: Reports,
    model: Model,
    dt: float,
    draws: Draws,
    by_prior: npt.NDArray[np.bool_] | bool,
    *,
    robust: bool = False,
) -> Cloud:
    """A step with reports, at least one: algorithm 1 as a pure function of its random numbers.

    All arrays may have leading axes of runs. ``by_prior`` (...,): use the weights ``gaussian-prior``.
    """
    expected = advanced(picked(cloud.particles, draws.chosen), dt)
    noisy = expected + draws.noise @ noise_gain(dt, model.sigma_v)
    loud = shares(model, reports)
    proposal, carried = sp_pekf.advance(expected, noisy, cloud.carried, reports, loud, model, dt, robust=robust)
    around = (root(proposal.covariance) @ draws.places.mT).mT
    particles = around + proposal.mean[..., None, :]
    log_weights = log_likelihood(model, particles, reports, robust=robust)
    if by_prior is not False:
        prior = predict(cloud.posterior, constant_velocity(dt, model.sigma_v))
        ratio = log_density(particles, prior) - log_density(particles, proposal)
        log_weights += np.where(np.asarray(by_prior)[..., None], ratio, 0.0)
    weights = normalised(log_weights)
    posterior = _posterior(weights, around, proposal)
    return Cloud(posterior, carried, picked(particles, evenly(weights, particles.shape[-2], draws.u)))


def _posterior(weights: Array, around: Array, proposal: Gaussian) -> Gaussian:
    """Of particles that lie ``around`` (..., Ns, 4) the mean of the proposal."""
    mean, covariance = near_moments(weights, around)
    share = np.vecdot(weights, weights)[..., None, None]  # of one sample: 1 / the effective number
    covariance += proposal.covariance * share
    covariance /= 1.0 + share
    return Gaussian(proposal.mean + mean, covariance)
