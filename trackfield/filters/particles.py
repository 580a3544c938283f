"""What particle filters have in common: to draw particles, to propagate and to weigh them."""

from __future__ import annotations

import numpy as np

from trackfield.filters.gaussian import constant, root
from trackfield.filters.types import Array, Gaussian, Reports
from trackfield.models import doa, motion
from trackfield.models.doa import wrap


def draw(belief: Gaussian, n: int, rng: np.random.Generator) -> Array:
    """``n`` points (n, d) from a Gaussian, singular or not."""
    points: Array = belief.mean + rng.standard_normal((n, len(belief.mean))) @ root(belief.covariance).T
    return points


def propagate(particles: Array, dt: float, sigma_v: float, rng: np.random.Generator) -> Array:
    """Particles (n, 4) ``dt`` seconds later: F x + Gamma v, v ~ N(0, sigma_v^2 I)."""
    noise = sigma_v * rng.standard_normal((len(particles), 2))
    moved: Array = particles @ constant(motion.transition(dt)).T + noise @ constant(motion.noise_gain(dt)).T
    return moved


def log_likelihood(particles: Array, reports: Reports, sigma_w: float) -> Array:
    """log p(y | x) (n,) of all bearings, up to a constant."""
    misses = wrap(reports.bearings - doa.measure(particles, reports.positions))
    log_weights: Array = np.square(misses).sum(axis=-1) * (-0.5 / sigma_w**2)
    return log_weights
