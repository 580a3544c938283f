"""UPF: an unscented particle filter (van der Merwe et al. 2000) as Zhou et al. (2011, sec. II-C) need it.

Each particle proposes where it goes: an unscented transform of the noise w of its motion x = F x' + G w, five points
in two dimensions, updated with all readings of the step. The noise is drawn from what it gives.

Deviations from the paper, and why:

- Eq. 6 weights particles by p(z | x) alone, although they are drawn with a knowledge of z: the likelihood counts twice
  (``upf-paper`` does so). Here the weight is p(z | x) p(w) / q(w).
- G G^T has rank 2, so p(x_k | x_k-1) has no density over four numbers: the noise is drawn, not the state.
- Its UKF is one for the whole set of particles; here there is one for each.
- N_eff < N (step 7) is always so; here particles are resampled when N_eff is at most ``ess`` of N.
- A filter that has lost its target begins anew (``recovery``); the paper's goes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated, NamedTuple

import numpy as np

from trackfield.filters.clouds import Cloud, CloudTracker, Draws, weighted
from trackfield.filters.measurement import expected, log_likelihood, measured, noise_sd, residual
from trackfield.filters.particles import Particles, advanced, noise_gain
from trackfield.filters.recovery import begun_anew
from trackfield.filters.robust import inflated
from trackfield.filters.types import Array, Model, Reports
from trackfield.options import Within

Share = Annotated[float, Within(0, 1)]
_FAR = sqrt(3.0)
"""How far from the first point the others are, in sds of the noise: the fourth moment is that of a Gaussian, too."""
_POINTS = _FAR * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


@dataclass(frozen=True)
class Upf(CloudTracker):
    """Unscented particle filter: each particle's unscented transform proposes where it goes (after Zhou et al. 2011).

    The ``particles`` are resampled when their effective number is at most the share ``ess`` of them. With ``reset``, a
    filter whose particles all miss the readings begins anew from the readings. ``robust``: readings that are far from
    what a particle expects are taken for outliers, by its proposal and by its weight.
    """

    particles: Particles = 200
    ess: Share = 0.5
    reset: bool = True
    robust: bool = False

    def fuse(self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws) -> Cloud:
        """Draw each particle's noise from its own proposal, weight, resample where due."""
        onward = advanced(cloud.particles, dt)
        noise, log_ratio = drawn(
            proposed(transformed(onward, reports, model, dt, robust=self.robust)), draws.normals[..., :2]
        )
        particles = onward + noise @ noise_gain(dt, model.sigma_v)
        likely = log_likelihood(model, particles, reports, robust=self.robust)
        after = weighted(particles, cloud.log_weights + likely + log_ratio, draws.u, self.ess)
        if not self.reset:
            return after
        return begun_anew(after, cloud.fixes, particles, likely, reports, model, dt, draws, robust=self.robust)


class Transform(NamedTuple):
    """What the five points of a particle say: z = misses + slopes^T noise + an error of these variances.

    ``slopes`` (..., N, 2, K), ``misses`` and ``variances`` (..., N, K).
    """

    slopes: Array
    misses: Array
    variances: Array


def transformed(onward: Array, reports: Reports, model: Model, dt: float, *, robust: bool = False) -> Transform:
    """The unscented transform of each particle's noise, which is N(0, I) in units of its sd.

    ``onward`` (..., N, 4) is where particles get without noise. Where readings are not linear in the noise, the
    transform's error is added to theirs; errors of several readings are taken as independent, so that a proposal is of
    two dimensions however many readings there are. An infinite variance stands for padding. With ``robust`` variances
    are raised for outliers, particle by particle.
    """
    if reports.positions.shape[-2] == 0:
        none = np.zeros((*onward.shape[:-1], 0))
        return Transform(np.zeros((*onward.shape[:-1], 2, 0)), none, none)
    places = onward[..., None, :] + _POINTS @ noise_gain(dt, model.sigma_v)
    expected_z = expected(model, places, reports)
    centre = expected_z[..., 0, :]
    apart = residual(model, reports, expected_z[..., 1:, :] - expected_z[..., :1, :])
    ahead, behind = apart[..., :2, :], apart[..., 2:, :]
    bends = (ahead + behind) / 6.0  # the weights are 1/3 of the first point, and 1/6 of each other
    shift = bends[..., 0, :] + bends[..., 1, :]
    errors = 3.0 * (np.square(bends[..., 0, :]) + np.square(bends[..., 1, :])) - np.square(shift)
    z = measured(model, reports)
    z = z if z.ndim == 1 else np.nan_to_num(z)[..., None, :]  # padding
    misses = residual(model, reports, z - centre - shift)
    slopes = (ahead - behind) / (2.0 * _FAR)
    variances = errors + np.square(noise_sd(model, reports, onward))
    if robust:
        variances = np.square(inflated(np.sqrt(variances), misses, np.square(slopes).sum(axis=-2)))
    return Transform(slopes, misses, variances)


class Proposal(NamedTuple):
    """A Gaussian of each particle's noise: ``mean`` (..., N, 2) and a lower triangular root of its covariance.

    ``first``, ``along`` and ``second`` (..., N) are the root's numbers: row by row, without the zero.
    """

    mean: Array
    first: Array
    along: Array
    second: Array


def proposed(transform: Transform) -> Proposal:
    """The noise given the readings: N(0, I) updated by the transform, in the form of its information."""
    slopes, misses, variances = transform
    one, two = slopes[..., 0, :], slopes[..., 1, :]
    precisions = 1.0 / variances
    a, c = (1.0 + np.vecdot(np.square(slope), precisions) for slope in (one, two))
    b = np.vecdot(one * two, precisions)
    pull = misses * precisions
    g, h = np.vecdot(one, pull), np.vecdot(two, pull)
    determinant = np.maximum(a * c - b * b, a + c - 1.0)  # which it is at least, but for rounding
    mean = np.empty((*b.shape, 2))
    np.divide(c * g - b * h, determinant, out=mean[..., 0])
    np.divide(a * h - b * g, determinant, out=mean[..., 1])
    first = np.sqrt(c / determinant)
    return Proposal(mean, first, -b / (determinant * first), 1.0 / np.sqrt(c))


def log_evidence(transform: Transform, proposal: Proposal) -> Array:
    """log p(z | x') (..., N) by the transform, up to a constant of each run."""
    slopes, misses, variances = transform
    pull = misses / variances
    explained = sum(np.vecdot(slopes[..., j, :], pull) * proposal.mean[..., j] for j in (0, 1))
    scale = np.log(np.where(np.isinf(variances), 1.0, variances)).sum(axis=-1)
    scale -= 2.0 * np.log(proposal.first * proposal.second)
    density: Array = -0.5 * (np.vecdot(misses, pull) - explained + scale)
    return density


def drawn(proposal: Proposal, normals: Array) -> tuple[Array, Array]:
    """Noise (..., N, 2) from its proposals q, by ``normals`` (..., N, 2), and log of N(noise; 0, I) / q(noise)."""
    mean, first, along, second = proposal
    noise = mean.copy()
    noise[..., 0] += first * normals[..., 0]
    noise[..., 1] += along * normals[..., 0] + second * normals[..., 1]
    log_ratio: Array = 0.5 * (np.vecdot(normals, normals) - np.vecdot(noise, noise)) + np.log(first * second)
    return noise, log_ratio
