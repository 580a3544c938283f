"""FA-UPF: the unscented particle filter with the choice of ancestors before the draw (Pitt & Shephard 1999).

As ``upf``, but particles are resampled by their weight times the unscented transform's p(z | x') of the step to come,
so that only those are moved from which the readings are likely. What is left of the weight, p(z | x) p(w) / q(w) over
that p(z | x'), would be the same for all if the transform were exact: a fully adapted filter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trackfield.filters.clouds import Cloud, CloudTracker, Draws, weighted
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.particles import Particles, advanced, noise_gain, picked
from trackfield.filters.recovery import begun_anew
from trackfield.filters.resampling import evenly, normalised
from trackfield.filters.types import Model, Reports
from trackfield.filters.upf import Proposal, drawn, log_evidence, proposed, transformed


@dataclass(frozen=True)
class FaUpf(CloudTracker):
    """Unscented particle filter that is fully adapted: it chooses particles by the readings before it moves them.

    With ``reset``, a filter whose ``particles`` all miss the readings begins anew from the readings. ``robust``:
    readings that are far from what a particle expects are taken for outliers, by its proposal and by its weight.
    """

    particles: Particles = 200
    reset: bool = True
    robust: bool = False

    def fuse(self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws) -> Cloud:
        """Choose ancestors by the likelihood of their step, then draw each one's noise from its proposal, weight."""
        onward = advanced(cloud.particles, dt)
        transform = transformed(onward, reports, model, dt, robust=self.robust)
        proposal = proposed(transform)
        evidence = log_evidence(transform, proposal)
        chosen = evenly(normalised(cloud.log_weights + evidence), self.particles, draws.u)
        mean, *root = proposal
        ancestors = Proposal(picked(mean, chosen), *(np.take_along_axis(part, chosen, axis=-1) for part in root))
        noise, log_ratio = drawn(ancestors, draws.normals[..., :2])
        particles = picked(onward, chosen) + noise @ noise_gain(dt, model.sigma_v)
        likely = log_likelihood(model, particles, reports, robust=self.robust)
        log_weights = likely + log_ratio - np.take_along_axis(evidence, chosen, axis=-1)
        after = weighted(particles, log_weights, draws.u, ess=0.0)
        if not self.reset:
            return after
        return begun_anew(after, cloud.fixes, particles, likely, reports, model, dt, draws, robust=self.robust)
