"""MRBPF: the multi-model Rao-Blackwellised particle filter of Yu et al. (2009), Table 1.

A step looks ahead first: particles get modes by the modes' common probability and are moved (2a), the reading's
likelihood at each mode's mean corrects that probability (2b), and then the same particles get modes by it and are moved
again (2c), weighted and resampled. So a reading counts twice, and in 2b a mode is judged by one point.

As printed but for what cannot be run or has no meaning there:

- The turns are those of ``turning``, and the update of velocities (2d, 6) that of ``rao_blackwell``: (6) and (7) are no
  rotations, the noise of w_t alone leaves out the velocity's own uncertainty, and a whole particle is resampled.
- In 2b gamma, summed over the particles of a mode, has no definition. As weights that sum to 1 within each mode
  (``gamma`` "within") they have no effect: a mode is as probable as the reading at its mean, whatever was known of it.
  As weights that sum to 1 over all particles (``gamma`` "share") the sum is the mode's predicted probability, and 2b is
  Bayes' rule. The errors are alike.
- The Markov chain (4) is applied at the beginning of the next step, to the first one's as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from trackfield.filters.blackwell import Turning
from trackfield.filters.measurement import log_likelihood
from trackfield.filters.rao_blackwell import Cloud, Draws, moved, posterior, renewed, resampled
from trackfield.filters.resampling import normalised
from trackfield.filters.turning import Turns, drawn, shares
from trackfield.filters.types import Array, Gaussian, Model, Reports


@dataclass(frozen=True)
class Mrbpf(Turning):
    """Multi-model Rao-Blackwellised particle filter of Yu et al. (2009), as in their Table 1.

    Modes: straight ahead, ``left_deg_s`` to the left, ``right_deg_s`` to the right. ``enter`` is the chance in a step
    that either turn begins, ``leave`` that it ends, ``swap`` that it changes sides. ``draw`` says how modes are drawn:
    evenly over the particles, or for each by itself. ``q`` (m^2/s^3) is the density of the acceleration's noise; 0:
    that of ``sigma_v``, held over a step. After ``silent`` steps without reports the particles start anew around the
    loudest sensors; 0: never. ``gamma`` says which weights count in step 2b: those that sum to 1 within each mode, or
    over all particles. ``robust``: weights and step 2b know that readings may be outliers.
    """

    gamma: Literal["within", "share"] = "within"

    looks: ClassVar[int] = 2

    def advance(
        self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws, again: Draws
    ) -> tuple[Cloud, Gaussian]:
        """See ``Blackwell``; ``draws`` are those of 2a, ``again`` those of 2c."""
        turns, q = self.turns, self.density(model, dt)
        tried = moved(given(cloud, cloud.probability @ turns.switching, draws, turns), model, dt, draws.normals, q)
        probability = judged(tried, reports, model, by_share=self.gamma == "share", robust=self.robust)
        cloud = moved(given(cloud, probability, again, turns), model, dt, again.normals, q)
        cloud = renewed(cloud._replace(probability=probability), reports, model, again.normals, self.silent)
        weights = normalised(log_likelihood(model, cloud.points, reports, robust=self.robust))
        return resampled(cloud, weights, again.u), posterior(weights, cloud)


def given(cloud: Cloud, probability: Array, draws: Draws, turns: Turns) -> Cloud:
    """The particles with modes drawn from a common ``probability`` (..., M)."""
    mode = drawn(probability, draws.modes)
    return cloud._replace(mode=mode, rate=turns.rates[mode])


def judged(cloud: Cloud, reports: Reports, model: Model, *, by_share: bool, robust: bool = False) -> Array:
    """The modes' probability (..., M) by the reports' likelihood at their mean, times their share if that counts."""
    m = cloud.probability.shape[-1]
    count = shares(np.ones(cloud.mode.shape), cloud.mode, m)
    own = (cloud.mode[..., None, :] == np.arange(m)[:, None]).astype(float)
    means = own @ cloud.points / np.maximum(count, 1.0)[..., None]
    with np.errstate(divide="ignore"):  # a mode without particles
        weights = np.log(count if by_share else np.sign(count))
    return normalised(weights + log_likelihood(model, means, reports, robust=robust))
