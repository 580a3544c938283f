"""Common functions of particle filters: drawing, propagating and weighting particles."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import numpy as np
import numpy.typing as npt

from trackfield.filters.gaussian import constant, root
from trackfield.filters.types import Array, Gaussian
from trackfield.models import motion
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
    after = advanced(particles, dt)
    after += normals @ noise_gain(dt, sigma_v)
    return after


def advanced(particles: Array, dt: float) -> Array:
    """Particles (..., n, 4) ``dt`` seconds later, at constant velocity."""
    after: Array = particles @ _onward(dt)
    return after


@lru_cache(maxsize=64)
def _onward(dt: float) -> Array:
    """F^T (4, 4)."""
    return constant(motion.transition(dt)).T


@lru_cache(maxsize=64)
def noise_gain(dt: float, sigma_v: float) -> Array:
    """sigma_v Gamma^T (2, 4): what a noise in units of its sd adds to the state."""
    return sigma_v * constant(motion.noise_gain(dt)).T


def picked(particles: Array, indices: npt.NDArray[np.intp]) -> Array:
    """The particles (..., m, d) at ``indices`` (..., m) of ``particles`` (..., n, d)."""
    if particles.ndim == 2:
        return particles.take(indices, axis=0)
    return np.take_along_axis(particles, indices[..., None], axis=-2)
