"""Several targets whose energies add up at each sensor: one particle filter over the stacked states of all.

Yu et al. (2009), eq. 1, of K targets. A particle holds a state of each, which move and turn by themselves, as in
``jm_rbpf``; it is weighted by readings of the sum, and resampled as a whole.

The arrays of a ``Cloud`` have an axis of targets here, the last before that of particles: (..., K, N, n).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from trackfield.filters.jm_rbpf import JmRbpf, switched
from trackfield.filters.rao_blackwell import Cloud, Draws, moved, posterior, resampled
from trackfield.filters.resampling import normalised
from trackfield.filters.robust import tailed
from trackfield.filters.turning import shares
from trackfield.filters.types import Array, Gaussian, Model


class Additive(Protocol):
    """A kind of sensing whose readings are of the sum of what targets emit (``trackfield.sensing.energy``)."""

    @property
    def h(self) -> Callable[[Array, Array], Array]:
        """See ``Sensing``: of one target alone."""
        ...

    @property
    def variance_of(self) -> Callable[[Array], Array]:
        """The variances (...) of the noise of what is received (...)."""
        ...


def advance(
    tracker: JmRbpf,
    kind: Additive,
    cloud: Cloud,
    readings: Array,
    places: Array,
    model: Model,
    dt: float,
    draws: Draws,
) -> tuple[Cloud, Gaussian]:
    """The particles ``dt`` seconds later, and the belief about each target (..., K, n) before they are resampled.

    ``readings`` (..., S) of sensors at ``places`` (..., S, 2), NaN where there is none. ``draws`` have the axes of the
    cloud; of ``u`` (..., K) all targets of a run have the same.
    """
    cloud = moved(switched(cloud, draws, tracker.turns), model, dt, draws.normals, tracker.density(model, dt))
    weights = normalised(log_likelihood(kind, cloud.points, readings, places, robust=tracker.robust))
    each = np.broadcast_to(weights[..., None, :], cloud.mode.shape)
    mass = shares(each, cloud.mode, cloud.probability.shape[-1])
    return resampled(cloud, each, draws.u)._replace(probability=mass), posterior(each, cloud)


def log_likelihood(kind: Additive, points: Array, readings: Array, places: Array, *, robust: bool = False) -> Array:
    """log p(z | x) (..., N) of the sums over targets, of ``points`` (..., K, N, n), up to a constant."""
    received = kind.h(points, places[..., None, None, :, :])[..., 0].sum(axis=-3)
    variance = kind.variance_of(received)
    squares = np.square(readings[..., None, :] - received) / variance
    cost = (tailed(squares) if robust else squares) + np.log(variance)
    found: Array = -0.5 * np.where(np.isnan(readings)[..., None, :], 0.0, cost).sum(axis=-1)
    return found
