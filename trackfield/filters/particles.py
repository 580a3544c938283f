"""Common functions of particle filters: drawing, propagating and weighting particles."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import numpy as np
import numpy.typing as npt

from trackfield.filters.gaussian import constant, root
from trackfield.filters.types import Array, Gaussian, Reports
from trackfield.models import doa, motion
from trackfield.models.doa import wrap
from trackfield.options import Within

Particles = Annotated[int, Within(1, 100_000)]
"""A number of particles."""


def draw(belief: Gaussian, n: int, rng: np.random.Generator) -> Array:
    """``n`` points (n, d) from a Gaussian, singular or not."""
    return placed(belief, rng.standard_normal((n, len(belief.mean))))


def placed(belief: Gaussian, normals: Array) -> Array:
    """Points (..., n, d) of a Gaussian, from independent ``normals`` (..., n, d)."""
    points = normals @ root(belief.covariance).mT
    points += belief.mean[..., None, :]
    return points


def propagate(particles: Array, dt: float, sigma_v: float, rng: np.random.Generator) -> Array:
    """Particles (n, 4) ``dt`` seconds later: F x + Gamma v, v ~ N(0, sigma_v^2 I)."""
    return moved(particles, dt, sigma_v, rng.standard_normal((len(particles), 2)))


def moved(particles: Array, dt: float, sigma_v: float, normals: Array) -> Array:
    """The same for ``particles`` (..., n, 4), from independent ``normals`` (..., n, 2)."""
    onward, kick = _motion(dt, sigma_v)
    after = particles @ onward
    after += normals @ kick
    return after


@lru_cache(maxsize=64)
def _motion(dt: float, sigma_v: float) -> tuple[Array, Array]:
    """F^T (4, 4) and sigma_v Gamma^T (2, 4)."""
    return constant(motion.transition(dt)).T, sigma_v * constant(motion.noise_gain(dt)).T


def log_likelihood(particles: Array, reports: Reports, sigma_w: float) -> Array:
    """log p(y | x) (..., n) of all bearings for ``particles`` (..., n, 4), up to a constant.

    The arrays of ``reports`` may have the leading axes of runs, too (``batch.stacked``); a report with a level of
    minus infinity is only padding.
    """
    misses = wrap(reports.bearings[..., None, :] - doa.measure(particles, reports.positions[..., None, :, :]))
    if reports.levels.ndim > 1:
        misses *= np.isfinite(reports.levels)[..., None, :]
    log_weights: Array = np.vecdot(misses, misses)
    log_weights *= -0.5 / sigma_w**2
    return log_weights


def picked(particles: Array, indices: npt.NDArray[np.intp]) -> Array:
    """The particles (..., m, d) at ``indices`` (..., m) of ``particles`` (..., n, d)."""
    if particles.ndim == 2:
        return particles.take(indices, axis=0)
    return np.take_along_axis(particles, indices[..., None], axis=-2)
