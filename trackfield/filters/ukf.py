"""Unscented Kalman update for independent measurements (Julier & Uhlmann 2004).

With B the weighted deviations of the sigma points from their mean, and A those of their predicted
measurements in units of the noise, P = B^T B and the update is P+ = B^T (I + A A^T)^-1 B: symmetric and never
negative, and its cost grows only linearly with the number of measurements (the transform of ensemble filters;
Bishop et al. 2001). For fewer measurements than sigma points P - B^T A (I + A^T A)^-1 A^T B is the same and takes
less time. In the linear case it is the Kalman filter.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import identity, log_scale, root, symmetric
from trackfield.filters.types import Array, Gaussian, Update

_KAPPA = 1.0
"""The central point has weight kappa/(n+kappa). The textbook's 3-n is negative for n=4; P+ may then be indefinite."""


def sigma_points(belief: Gaussian) -> tuple[Array, Array]:
    """Points (..., 2n+1, n), the mean first, and weights (2n+1,) that have the moments of the belief."""
    return belief.mean[..., None, :] + _offsets(belief), _weights(belief.mean.shape[-1])


def _offsets(belief: Gaussian) -> Array:
    """The offsets of the points from the mean."""
    offsets: Array = _steps(belief.mean.shape[-1]) @ root(belief.covariance).mT
    return offsets


@lru_cache
def _steps(n: int) -> Array:
    """How far (2n+1, n) each point goes along each axis: nowhere, forth along each, back along each."""
    steps = sqrt(n + _KAPPA) * np.concatenate((np.zeros((1, n)), np.eye(n), -np.eye(n)))
    steps.flags.writeable = False
    return steps


@lru_cache
def _weights(n: int) -> Array:
    weights = np.full(2 * n + 1, 0.5 / (n + _KAPPA))
    weights[0] = _KAPPA / (n + _KAPPA)
    weights.flags.writeable = False
    return weights


@lru_cache
def _shares(n: int) -> Array:
    """Roots (2n+1, 1) of the weights."""
    shares = np.sqrt(_weights(n))[:, None]
    shares.flags.writeable = False
    return shares


class _Ensemble(NamedTuple):
    """The belief's sigma points: B (..., p, n), their weighted deviations, and A (..., p, K), those of their
    predicted measurements in units of the noise, as is the ``innovation`` (..., K)."""

    A: Array
    B: Array
    innovation: Array

    @property
    def precision(self) -> Array:
        return identity(self.A.shape[-2]) + self.A @ self.A.mT


Map = Callable[[Array], Array]


def _same(difference: Array) -> Array:
    return difference


def update(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map = _same) -> Update:
    """Update with measurements ``z`` (..., K) of independent noise ``sd`` (scalar or (..., K)).

    ``measure`` maps sigma points (..., 2n+1, n) to measurements (..., 2n+1, K); ``residual`` maps their
    differences into their valid range (for angles, [-pi, pi)). ``prior`` may have leading batch axes. A measurement
    of infinite ``sd`` has no effect, so steps with fewer reports fit into one array.
    """
    after, told = _update(prior, z, sd, measure, residual)
    each = np.asarray(sd) if np.ndim(sd) else np.broadcast_to(sd, z.shape)
    log_evidence = -0.5 * (told.nis() + np.linalg.slogdet(told.system)[1] + log_scale(each))
    return Update(after, log_evidence)


def posterior(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map = _same) -> Gaussian:
    """The posterior of ``update`` without the evidence, which takes less time."""
    return _update(prior, z, sd, measure, residual)[0]


def innovation(prior: Gaussian, z: Array, measure: Map, residual: Map = _same) -> tuple[Array, Array]:
    """The innovation (..., K), and the variance (..., K) that the prior gives each expected measurement."""
    ensemble = _ensemble(prior, z, 1.0, measure, residual)
    return ensemble.innovation, np.square(ensemble.A).sum(axis=-2)


class _Told(NamedTuple):
    """The normalised innovation squared (...,), and the ``system`` whose determinant the evidence needs."""

    nis: Callable[[], Array]
    system: Array


def _update(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map) -> tuple[Gaussian, _Told]:
    """Solves the smaller of I + A A^T and I + A^T A, which have the same determinant (Woodbury)."""
    ensemble = _ensemble(prior, z, sd, measure, residual)
    A, B, innovation = ensemble
    AT = A.mT
    if A.shape[-1] < A.shape[-2]:
        system = AT @ A
        system += identity(system.shape[-1])
        AB = AT @ B
        solved = np.linalg.solve(system, np.concatenate((innovation[..., None], AB), axis=-1))
        moved = AB.mT @ solved
        after = Gaussian(prior.mean + moved[..., 0], symmetric(prior.covariance - moved[..., 1:]))
        return after, _Told(lambda: (innovation * solved[..., 0]).sum(axis=-1), system)
    system = ensemble.precision
    shadow = A @ innovation[..., None]
    solved = np.linalg.solve(system, np.concatenate((shadow, B), axis=-1))
    moved = B.mT @ solved
    after = Gaussian(prior.mean + moved[..., 0], symmetric(moved[..., 1:]))
    return after, _Told(
        lambda: np.square(innovation).sum(axis=-1) - (shadow * solved[..., :1]).sum(axis=(-2, -1)), system
    )


def predictive(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map = _same) -> Array:
    """log p(z_k | all others) (..., K): how well the prior and the other measurements predict each measurement.

    Arguments as for ``update``. With e_k the innovation that remains after the update and l_k the
    measurement's leverage, its error given the others is e_k / (1 - l_k), with variance 1 / (1 - l_k), in units of the
    noise: the deleted residual of regression (Cook & Weisberg 1982, sec. 2.2.1).
    """
    ensemble = _ensemble(prior, z, sd, measure, residual)
    A, _, innovation = ensemble
    solved = np.linalg.solve(ensemble.precision, A)
    shadow = np.einsum("...pk,...k->...p", A, innovation)
    left = innovation - np.einsum("...pk,...p->...k", solved, shadow)
    free = np.maximum(1.0 - (A * solved).sum(axis=-2), np.finfo(np.float64).eps)
    density: Array = -0.5 * (np.square(left) / free - np.log(free) + np.log(2.0 * np.pi * np.square(sd)))
    return density


def _ensemble(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map) -> _Ensemble:
    n = prior.mean.shape[-1]
    offsets, weights, share = _offsets(prior), _weights(n), _shares(n)
    predicted = measure(prior.mean[..., None, :] + offsets)
    around = residual(predicted - predicted[..., :1, :])  # angles have a mean only relative to one of them
    centre = weights @ around
    A = around - centre[..., None, :]
    A *= share / (sd[..., None, :] if isinstance(sd, np.ndarray) else sd)
    return _Ensemble(A, share * offsets, residual(z - predicted[..., 0, :] - centre) / sd)
