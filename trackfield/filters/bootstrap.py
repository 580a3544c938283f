"""Bootstrap particle filter (Gordon, Salmond & Smith 1993): motion as proposal, weights from the likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, NamedTuple

import numpy as np

from trackfield.filters import belief as beliefs
from trackfield.filters.belief import Belief
from trackfield.filters.gaussian import Motion, moments
from trackfield.filters.measurement import STATE, log_likelihood, moving
from trackfield.filters.particles import Particles, draw, propagate
from trackfield.filters.resampling import due, normalised, residual, systematic
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports
from trackfield.options import Within

_RESAMPLERS: Final = {"systematic": systematic, "residual": residual}


class BootstrapState(NamedTuple):
    """``particles`` (n, 4 + u), their ``weights`` (n,), None if equal; before the first step there is a prior only."""

    model: Model
    prior: Gaussian
    particles: Array | None
    weights: Array | None = None


@dataclass(frozen=True)
class Bootstrap:
    """Bootstrap particle filter: motion moves the particles, the likelihood weighs them.

    The ``n`` particles are resampled in every step that has reports. With an ``ess_share`` below 1, only when their
    effective number is at most that share of n; until then they carry weights, which are not part of the estimate's
    particles. ``keeps`` is what its next life gets: its ``particles``, or the ``gaussian`` of its estimate.
    ``robust``: its weights know that readings may be outliers.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    n: Particles = 2000
    resampling: Literal["systematic", "residual"] = "systematic"
    ess_share: Annotated[float, Within(0, 1)] = 1.0
    keeps: Literal["gaussian", "particles"] = "gaussian"
    robust: bool = False

    def init(self, prior: Gaussian, model: Model) -> BootstrapState:
        """The state of belief ``prior``; particles are drawn in the first step."""
        return BootstrapState(model, prior, None)

    def step(
        self, state: BootstrapState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[BootstrapState, Estimate]:
        """Propagate, weight by the readings, resample; without reports propagate only."""
        model, prior, particles, before = state
        if particles is None:
            particles = draw(prior, self.n, rng)
        particles = _moved(particles, model, dt, rng)
        log_weights = log_likelihood(model, particles, reports, robust=self.robust)
        if before is not None:
            with np.errstate(divide="ignore"):  # a weight of 0 stays 0
                log_weights = log_weights + np.log(before)
        weights = normalised(log_weights)
        mean, covariance = moments(weights, particles)
        if len(reports) and due(weights, self.ess_share):
            particles = particles.take(_RESAMPLERS[self.resampling](weights, self.n, rng), axis=0)
            kept = None
        else:
            kept = weights if len(reports) else before
        return BootstrapState(model, prior, particles, kept), Estimate(mean, covariance, particles[:, :2])

    def belief(self, state: BootstrapState) -> Belief | None:
        """Its particles, if it keeps them. They need not be resampled, as their weights travel with them."""
        if self.keeps == "gaussian" or state.particles is None:
            return None
        n = len(state.particles)
        return beliefs.Particles(np.full(n, 1.0 / n) if state.weights is None else state.weights, state.particles)

    def resume(self, belief: Belief, model: Model) -> BootstrapState:
        """Particles go on with their weights, however many: the next resampling makes them ``n``."""
        if isinstance(belief, beliefs.Particles):
            return BootstrapState(model, beliefs.moments(belief), belief.points, belief.weights)
        return self.init(beliefs.moments(belief), model)

    def motion(self, before: BootstrapState, after: BootstrapState, dt: float) -> Motion:
        """The predicted motion between two states, ``dt`` seconds apart."""
        return moving(after.model, dt)


def _moved(particles: Array, model: Model, dt: float, rng: np.random.Generator) -> Array:
    """The particles ``dt`` seconds later, the unknowns of the sensing by their random walks."""
    after = propagate(particles[:, :STATE], dt, model.sigma_v, rng)
    if not model.unknowns:
        return after
    sds = np.array([one.walk_sd for one in model.unknowns]) * np.sqrt(dt)
    walked = particles[:, STATE:] + sds * rng.standard_normal((len(particles), len(sds)))
    return np.concatenate((after, walked), axis=1)
