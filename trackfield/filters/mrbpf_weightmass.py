"""MRBPF with the modes' probability from the mass of weights: Table 1 of Yu et al. (2009), put right.

Modes are drawn once, by their predicted common probability, and a mode's probability afterwards is the sum of its
particles' weights. So each reading counts once, and the whole of a mode's particles speaks for it. A particle's mode
does not depend on the one that it had: with few switches in a step that costs little.
"""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.filters.blackwell import Turning
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.mrbpf import given
from trackfield.filters.rao_blackwell import Cloud, Draws, moved, posterior, renewed, resampled
from trackfield.filters.resampling import normalised
from trackfield.filters.turning import shares
from trackfield.filters.types import Gaussian, Model, Reports


@dataclass(frozen=True)
class MrbpfWeightmass(Turning):
    """Multi-model Rao-Blackwellised particle filter: a mode is as probable as its particles weigh together.

    Modes: straight ahead, ``left_deg_s`` to the left, ``right_deg_s`` to the right. ``enter`` is the chance in a step
    that either turn begins, ``leave`` that it ends, ``swap`` that it changes sides. ``draw`` says how modes are drawn:
    evenly over the particles, or for each by itself. ``q`` (m^2/s^3) is the density of the acceleration's noise; 0:
    that of ``sigma_v``, held over a step. After ``silent`` steps without reports the particles start anew around the
    loudest sensors; 0: never. ``robust``: the weights know that readings may be outliers.
    """

    def advance(
        self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws, again: Draws
    ) -> tuple[Cloud, Gaussian]:
        """See ``Blackwell``."""
        turns, q = self.turns, self.density(model, dt)
        cloud = moved(given(cloud, cloud.probability @ turns.switching, draws, turns), model, dt, draws.normals, q)
        cloud = renewed(cloud, reports, model, draws.normals, self.silent)
        weights = normalised(log_likelihood(model, cloud.points, reports, robust=self.robust))
        mass = shares(weights, cloud.mode, len(turns.rates))
        return resampled(cloud, weights, draws.u)._replace(probability=mass), posterior(weights, cloud)
