"""Weighted particles of a filter that carries its weights from step to step, of one run or of many.

All arrays may have leading axes of runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from trackfield.filters import belief as beliefs
from trackfield.filters.belief import Belief
from trackfield.filters.gaussian import Motion, moments
from trackfield.filters.measurement import moving
from trackfield.filters.needs import NO_UNKNOWNS
from trackfield.filters.particles import Particles, picked, placed
from trackfield.filters.resampling import effective_size, evenly, normalised
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports


class Cloud(NamedTuple):
    """N particles after a step.

    ``posterior`` has the moments of the weighted particles, and ``effective`` (...,) is their effective number, both
    before any resampling.
    """

    posterior: Gaussian
    particles: Array
    """(..., N, n)"""
    log_weights: Array
    """(..., N), up to a constant"""
    effective: Array
    fixes: Gaussian | None = None
    """positions (..., 2) from the readings, where no particle explained them (``recovery``)"""


class Draws(NamedTuple):
    """The random numbers of a step: ``normals`` (..., N, n) of places, and ``u`` (...,) in [0, 1) of resampling."""

    normals: Array
    u: Array | float


def begun(prior: Gaussian, normals: Array) -> Cloud:
    """Equal particles of a Gaussian, placed by ``normals`` (..., N, n)."""
    shape = normals.shape[:-1]
    return Cloud(prior, placed(prior, normals), np.zeros(shape), np.full(shape[:-1], float(shape[-1])))


def weighted(particles: Array, log_weights: Array, u: Array | float, ess: float) -> Cloud:
    """Particles (..., N, n) with these weights (..., N); resampled where few have most of the weight.

    That is where their effective number is at most ``ess`` of N (Liu & Chen 1998); with 1 always, with 0 never.
    """
    weights = normalised(log_weights)
    effective = effective_size(weights)
    posterior = moments(weights, particles)
    due = effective <= ess * particles.shape[-2] if ess < 1.0 else np.full(effective.shape, True)
    if due.any():
        chosen = np.where(due[..., None], evenly(weights, weights.shape[-1], u), np.arange(weights.shape[-1]))
        particles = picked(particles, chosen)
        log_weights = np.where(due[..., None], 0.0, log_weights)
    return Cloud(posterior, particles, log_weights, effective)


class CloudState(NamedTuple):
    """``cloud`` is None before the first step: then there is only the prior."""

    model: Model
    prior: Gaussian
    cloud: Cloud | None


@dataclass(frozen=True)
class CloudTracker:
    """A tracker whose steps are a pure function of a cloud, ``fuse``; the rest of it.

    ``particles`` is their number N. ``keeps`` is what its next life gets: its ``particles``, or the ``gaussian`` of its
    estimate.
    """

    needs: ClassVar[tuple[str, ...]] = (NO_UNKNOWNS,)

    particles: Particles = 100
    keeps: Literal["gaussian", "particles"] = "gaussian"

    def fuse(self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws) -> Cloud:
        """The cloud ``dt`` seconds later, when these reports were measured, if any; of one run or many."""
        raise NotImplementedError

    def draws(self, rng: np.random.Generator) -> Draws:
        """The random numbers of a step."""
        return Draws(rng.standard_normal((self.particles, 4)), rng.random())

    def init(self, prior: Gaussian, model: Model) -> CloudState:
        """The state of belief ``prior``; particles are drawn in the first step."""
        return CloudState(model, prior, None)

    def step(
        self, state: CloudState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[CloudState, Estimate]:
        """One step of ``fuse``."""
        model, prior, cloud = state
        if cloud is None:
            cloud = begun(prior, rng.standard_normal((self.particles, 4)))
        cloud = self.fuse(cloud, reports, model, dt, self.draws(rng))
        return CloudState(model, prior, cloud), Estimate(*cloud.posterior, cloud.particles[:, :2])

    def belief(self, state: CloudState) -> Belief | None:
        """Its particles with their weights, if it keeps them."""
        if self.keeps == "gaussian" or state.cloud is None:
            return None
        return beliefs.Particles(normalised(state.cloud.log_weights), state.cloud.particles)

    def resume(self, belief: Belief, model: Model) -> CloudState:
        """Particles go on with their weights, if there are as many; any other belief as its Gaussian."""
        prior = beliefs.moments(belief)
        if not isinstance(belief, beliefs.Particles) or len(belief.points) != self.particles:
            return self.init(prior, model)
        with np.errstate(divide="ignore"):  # a weight of 0 stays 0
            log_weights = np.log(belief.weights)
        return CloudState(model, prior, Cloud(prior, belief.points, log_weights, effective_size(belief.weights)))

    def motion(self, before: CloudState, after: CloudState, dt: float) -> Motion:
        """The predicted motion between two states, ``dt`` seconds apart."""
        return moving(after.model, dt)
