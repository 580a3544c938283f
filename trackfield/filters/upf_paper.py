"""The unscented particle filter of Zhou et al. (2011), as printed: sec. II-C, steps 1 to 8.

One UKF takes the mean and covariance of the particle set through the step (step 2), all particles are drawn anew from
what it gives (step 3), and weighted by p(z | x) (eq. 6). So the readings count twice, in the UKF and in the weights,
and the filter believes in too small errors: it is here to be compared with. ``upf`` and ``gpf-ukf`` are sound.

How it was read: step 3's q(x | x, x_1:k) is conditioned on the readings z_1:k. N_eff < N (step 7) is always so, so
particles are always resampled, and w_k-1 of eq. 6 is the same for all. The UKF's mean and covariance are those of the
weighted particles, before they are resampled.
"""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.filters.clouds import Cloud, CloudTracker, Draws, weighted
from trackfield.filters.gaussian import predict
from trackfield.filters.measurement import log_likelihood, moving
from trackfield.filters.particles import placed
from trackfield.filters.types import Model, Reports
from trackfield.filters.updates import unscented


@dataclass(frozen=True)
class UpfPaper(CloudTracker):
    """Unscented particle filter as Zhou et al. (2011) print it: one UKF draws all ``particles``, p(z | x) weights them.

    It counts each reading twice; ``upf`` and ``gpf-ukf`` do not.
    """

    def fuse(self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws) -> Cloud:
        """Steps 2 to 8 of sec. II-C."""
        proposal = predict(cloud.posterior, moving(model, dt))
        if reports.positions.shape[-2]:
            proposal = unscented(proposal, reports, model)
        particles = placed(proposal, draws.normals)
        return weighted(particles, log_likelihood(model, particles, reports), draws.u, ess=1.0)
