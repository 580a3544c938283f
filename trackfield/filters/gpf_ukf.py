"""GPF-UKF: a Gaussian particle filter (Kotecha & Djuric 2003) that draws from a UKF's posterior.

It is what the single UKF of Zhou et al. (2011, sec. II-C) is good for: the particles correct it where the readings are
not linear, and what is carried on is the mean and covariance alone, which fits one frame of a radio (56 bytes).

With N(x-, P-) the predicted belief and N(x+, P+) the UKF's posterior, particles are drawn from N(x+, ``wider`` P+) and
weighted by p(z | x) N(x; x-, P-) / N(x; x+, ``wider`` P+): in the correct form of eq. 1, and not of eq. 6, which leaves
out the ratio and so counts readings twice. The proposal is wider than P+, so that its tails cover those of the
posterior. The covariance that is carried on has the proposal's as that of one more particle: a few particles with all
the weight would leave none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.filters.gaussian import Motion, log_density, moments, predict
from trackfield.filters.measurement import heard, log_likelihood, moving
from trackfield.filters.particles import Particles, picked, placed
from trackfield.filters.recovery import restarts
from trackfield.filters.resampling import effective_size, normalised
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports
from trackfield.filters.updates import unscented
from trackfield.options import Within


class Corrected(NamedTuple):
    """After a step: the belief, the particles (..., N, 4 + u) that it is of, and their effective number (...,).

    ``fixes`` are positions (..., 2) from the readings, where no particle explained them (``recovery``).
    """

    belief: Gaussian
    particles: Array
    effective: Array
    fixes: Gaussian | None = None


class GpfUkfState(NamedTuple):
    """The ``belief`` over (x, y, vx, vy) and the unknowns of the sensing, and any ``fixes`` (``recovery``)."""

    model: Model
    belief: Gaussian
    fixes: Gaussian | None = None


@dataclass(frozen=True)
class GpfUkf:
    """Gaussian particle filter with the posterior of a UKF as its proposal (after Zhou et al. 2011).

    The ``particles`` are drawn from the proposal with ``wider`` times its covariance. With ``reset``, a filter whose
    particles all miss the readings begins anew from the readings. ``robust``: readings that are far from what was
    expected are taken for outliers, by the proposal and by the weights.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    particles: Particles = 100
    wider: Annotated[float, Within(1, 100)] = 1.5
    reset: bool = True
    robust: bool = False

    def init(self, prior: Gaussian, model: Model) -> GpfUkfState:
        """The state of belief ``prior``."""
        return GpfUkfState(model, prior)

    def step(
        self, state: GpfUkfState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[GpfUkfState, Estimate]:
        """Predict; with reports, draw from the UKF's posterior and weight."""
        model, belief, before = state
        if len(reports) == 0:
            belief = predict(belief, moving(model, dt))
            return GpfUkfState(model, belief), Estimate(*belief)
        after = self.fuse(belief, before, reports, model, dt, self.draws(rng, belief.mean.shape[-1]))
        return GpfUkfState(model, after.belief, after.fixes), Estimate(*after.belief, after.particles[:, :2])

    def draws(self, rng: np.random.Generator, n: int = 4) -> Array:
        """The random numbers of a step with reports: normal (N, n), n the numbers of a state."""
        return rng.standard_normal((self.particles, n))

    def fuse(
        self, belief: Gaussian, before: Gaussian | None, reports: Reports, model: Model, dt: float, normals: Array
    ) -> Corrected:
        """A step with reports as a pure function; all arrays may have leading axes of runs.

        ``before`` has the fixes of the step before.
        """
        ahead = predict(belief, moving(model, dt))
        mean, covariance = unscented(ahead, reports, model, robust=self.robust)
        proposal = Gaussian(mean, self.wider * covariance)
        particles = placed(proposal, normals)
        likely = log_likelihood(model, particles, reports, robust=self.robust)
        weights = normalised(likely + log_density(particles, ahead) - log_density(particles, proposal))
        effective = effective_size(weights)
        after = _where(heard(reports), _summed_up(weights, particles, effective, proposal), ahead)
        if not self.reset:
            return Corrected(after, particles, effective)
        nearest = picked(particles, likely.argmax(axis=-1)[..., None])[..., 0, :]
        start = restarts(before, nearest, after, reports, model, dt, robust=self.robust)
        return Corrected(start.belief, particles, effective, start.fixes)

    def motion(self, before: GpfUkfState, after: GpfUkfState, dt: float) -> Motion:
        """The predicted motion between two states, ``dt`` seconds apart."""
        return moving(after.model, dt)


def _summed_up(weights: Array, particles: Array, effective: Array, proposal: Gaussian) -> Gaussian:
    """The moments of weighted particles, with the proposal's covariance as that of one more."""
    mean, covariance = moments(weights, particles)
    share = effective[..., None, None]
    return Gaussian(mean, (share * covariance + proposal.covariance) / (share + 1.0))


def _where(which: npt.NDArray[np.bool_], one: Gaussian, other: Gaussian) -> Gaussian:
    """The one belief where ``which`` (...,) is true, the other elsewhere."""
    if which.all():
        return one
    mean = np.where(which[..., None], one.mean, other.mean)
    return Gaussian(mean, np.where(which[..., None, None], one.covariance, other.covariance))
