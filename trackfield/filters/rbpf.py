"""RBPF: the Rao-Blackwellised particle filter with one motion model, which Yu et al. (2009) compare theirs with."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.filters.blackwell import Blackwell
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.rao_blackwell import Cloud, Draws, moved, posterior, renewed, resampled
from trackfield.filters.resampling import normalised
from trackfield.filters.types import Gaussian, Model, Reports


@dataclass(frozen=True)
class Rbpf(Blackwell):
    """Rao-Blackwellised particle filter for a target that goes straight ahead.

    ``q`` (m^2/s^3) is the density of the acceleration's noise; 0: that of ``sigma_v``, held over a step. After
    ``silent`` steps without reports the particles start anew around the loudest sensors; 0: never.
    ``robust``: the weights know that readings may be outliers.
    """

    def advance(
        self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws, again: Draws
    ) -> tuple[Cloud, Gaussian]:
        """See ``Blackwell``."""
        cloud = moved(cloud, model, dt, draws.normals, self.density(model, dt))
        cloud = renewed(cloud, reports, model, draws.normals, self.silent)
        weights = normalised(log_likelihood(model, cloud.points, reports, robust=self.robust))
        return resampled(cloud, weights, draws.u), posterior(weights, cloud)
