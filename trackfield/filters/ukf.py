"""Unscented Kalman update for independent measurements (Julier & Uhlmann 2004).

With B the weighted deviations of the sigma points from their mean, and A those of their predicted
measurements in units of the noise, P = B^T B and the update is P+ = B^T (I + A A^T)^-1 B: symmetric and never
negative, and its cost grows only linearly with the number of measurements (the transform of ensemble filters;
Bishop et al. 2001). In the linear case it is the Kalman filter.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import log_scale, root, symmetric
from trackfield.filters.types import Array, Gaussian, Update

_KAPPA = 1.0
"""The central point weighs kappa/(n+kappa). The textbook's 3-n is negative for n=4, and P+ may be then."""


def sigma_points(belief: Gaussian) -> tuple[Array, Array]:
    """Points (..., 2n+1, n), the mean first, and weights (2n+1,) that have the moments of the belief."""
    n = belief.mean.shape[-1]
    axes = np.sqrt(n + _KAPPA) * np.swapaxes(root(belief.covariance), -1, -2)
    offsets = np.concatenate((np.zeros_like(axes[..., :1, :]), axes, -axes), axis=-2)
    weights = np.full(2 * n + 1, 0.5 / (n + _KAPPA))
    weights[0] = _KAPPA / (n + _KAPPA)
    return belief.mean[..., None, :] + offsets, weights


class _Ensemble(NamedTuple):
    """The belief's sigma points: B (..., p, n), their weighted deviations, and A (..., p, K), those of their
    predicted measurements in units of the noise, as is the ``innovation`` (..., K)."""

    A: Array
    B: Array
    innovation: Array

    @property
    def precision(self) -> Array:
        return np.eye(self.A.shape[-2]) + self.A @ np.swapaxes(self.A, -1, -2)


Map = Callable[[Array], Array]


def _same(difference: Array) -> Array:
    return difference


def update(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map = _same) -> Update:
    """Take in measurements ``z`` (..., K) of independent noise ``sd`` (scalar or (..., K)).

    ``measure`` maps sigma points (..., 2n+1, n) to measurements (..., 2n+1, K); ``residual`` maps their
    differences into the range where they mean something (for angles, to [-pi, pi)). ``prior`` may have leading
    batch axes. A measurement of infinite ``sd`` is none, so steps with fewer reports fit into one array.
    """
    ensemble = _ensemble(prior, z, sd, measure, residual)
    A, B, innovation = ensemble
    precision = ensemble.precision
    shadow = np.einsum("...pk,...k->...p", A, innovation)
    solved = np.linalg.solve(precision, np.concatenate((shadow[..., None], B), axis=-1))
    moved = np.swapaxes(B, -1, -2) @ solved
    posterior = Gaussian(prior.mean + moved[..., 0], symmetric(moved[..., 1:]))
    nis = np.square(innovation).sum(axis=-1) - np.einsum("...p,...p->...", shadow, solved[..., 0])
    log_evidence = -0.5 * (nis + np.linalg.slogdet(precision)[1] + log_scale(np.broadcast_to(sd, z.shape)))
    return Update(posterior, log_evidence)


def predictive(prior: Gaussian, z: Array, sd: Array | float, measure: Map, residual: Map = _same) -> Array:
    """log p(z_k | all others) (..., K): how far each measurement is what the prior and the others let expect.

    Arguments as for ``update``. With e_k what the update leaves of the innovation and l_k the measurement's
    leverage, the others expect it e_k / (1 - l_k) off, with variance 1 / (1 - l_k), in units of the noise: the
    deleted residual of regression (Cook & Weisberg 1982, sec. 2.2.1).
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
    points, weights = sigma_points(prior)
    share = np.sqrt(weights)[:, None]
    predicted = measure(points)
    around = residual(predicted - predicted[..., :1, :])  # angles have a mean only relative to one of them
    centre = np.einsum("p,...pk->...k", weights, around)
    sd = np.broadcast_to(sd, z.shape)
    A = share * (around - centre[..., None, :]) / sd[..., None, :]
    B = share * (points - prior.mean[..., None, :])
    return _Ensemble(A, B, residual(z - predicted[..., 0, :] - centre) / sd)
