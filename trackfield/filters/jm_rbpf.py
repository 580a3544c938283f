"""JM-RBPF: a jump-Markov Rao-Blackwellised particle filter, each particle with a mode of its own.

What Yu et al. (2009) aim at: the posterior of position, velocity and mode (Doucet, Gordon & Krishnamurthy 2001). A
particle's mode follows the Markov chain (their eq. 10) from its own last one. The rate of a turn need not be known: a
particle that enters a turn draws it, and keeps it until the turn ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

from trackfield.filters.blackwell import Degrees, Turning
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.rao_blackwell import Cloud, Draws, moved, posterior, renewed, resampled
from trackfield.filters.resampling import normalised
from trackfield.filters.turning import Turns, followed, left_and_right, rates_of, shares
from trackfield.filters.types import Gaussian, Model, Reports


@dataclass(frozen=True)
class JmRbpf(Turning):
    """Jump-Markov Rao-Blackwellised particle filter: each particle goes straight ahead or turns, by itself.

    ``turn`` says whether the rates of turns are known: ``left_deg_s`` and ``right_deg_s``, or any up to ``most_deg_s``.
    ``enter`` is the chance in a step that a turn to either side begins, ``leave`` that it ends, ``swap`` that it
    changes sides. ``draw`` says how modes are drawn: evenly over the particles, or for each by itself. ``q`` (m^2/s^3)
    is the density of the acceleration's noise; 0: that of ``sigma_v``, held over a step. After ``silent`` steps without
    reports the particles start anew around the loudest sensors; 0: never. ``robust``: the weights know
    that readings may be outliers.
    """

    turn: Literal["known", "unknown"] = "unknown"
    most_deg_s: Degrees = 70.0

    @property
    def turns(self) -> Turns:
        """See ``Blackwell``."""
        most = radians(self.most_deg_s) if self.turn == "unknown" else 0.0
        left, right = radians(self.left_deg_s), radians(self.right_deg_s)
        return left_and_right(left, right, self.enter, self.leave, self.swap, most)

    def advance(
        self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws, again: Draws
    ) -> tuple[Cloud, Gaussian]:
        """See ``Blackwell``."""
        turns = self.turns
        cloud = moved(switched(cloud, draws, turns), model, dt, draws.normals, self.density(model, dt))
        cloud = renewed(cloud, reports, model, draws.normals, self.silent)
        weights = normalised(log_likelihood(model, cloud.points, reports, robust=self.robust))
        mass = shares(weights, cloud.mode, len(turns.rates))
        return resampled(cloud, weights, draws.u)._replace(probability=mass), posterior(weights, cloud)


def switched(cloud: Cloud, draws: Draws, turns: Turns) -> Cloud:
    """The particles with the modes of the coming step, each by the Markov chain from its own."""
    mode = followed(cloud.mode, draws.modes, turns)
    return cloud._replace(mode=mode, rate=rates_of(mode, cloud.mode, cloud.rate, draws.rates, turns))
