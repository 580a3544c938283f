"""State partition with parallel extended Kalman filters (Zhai et al. 2009, sec. IV-B).

The state is a nominal part plus a residual. N nominals run through the motion model with noise; around each,
an EKF estimates the residual from one sensor's reading, a single number (in the paper a bearing). The N x K filters of
N nominals and K sensors are one array operation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import constant_velocity, symmetric, times
from trackfield.filters.measurement import innovations, jacobians, noise_sd, varies
from trackfield.filters.robust import BEYOND
from trackfield.filters.types import Array, Gaussian, Model, Reports


class Fused(NamedTuple):
    """The sensors' estimates as one Gaussian, and the covariance that the filters carry on."""

    proposal: Gaussian
    carried: Array


def advance(
    expected: Array,
    noisy: Array,
    carried: Array,
    reports: Reports,
    shares: Array,
    model: Model,
    dt: float,
    *,
    robust: bool = False,
) -> Fused:
    """One step of all filters, and their sum over sensors.

    ``expected`` (..., N, 4) are the nominals of the last step, whose residuals are 0, after the motion model without
    noise, ``noisy`` (..., N, 4) the same with noise (eq. 10); ``carried`` (..., 4, 4) the covariance of each filter;
    ``shares`` (..., K) the sensors' weights, summing to 1. The arrays of ``reports`` may have the leading axes of runs,
    too. A noise that depends on the state is that of ``expected``. With ``robust`` noise is taken for larger where a
    filter's innovation asks for it (``robust.inflated``).
    """
    F, Q = constant_velocity(dt, model.sigma_v)
    R = F @ carried @ F.T + Q  # eq. 18
    innovation = innovations(model, expected, reports).mT  # (..., K, N), eq. 20
    slopes = jacobians(model, noisy, reports).swapaxes(-3, -1)  # (..., 4, K, N), eq. 14
    H = _flat(slopes)
    RH = R @ H  # (..., 4, K * N)
    S = np.add.reduce(RH * H, axis=-2).reshape(innovation.shape)
    S += _variance(model, reports, expected)
    if robust:
        S = np.maximum(S, np.square(innovation / BEYOND))
    scaled = innovation / S
    # eq. 16 with the gain RH / S of eq. 17: what the nominal gained by noise, the residual loses
    estimates = RH.reshape(slopes.shape) * scaled[..., None, :, :]
    estimates += expected.mT[..., None, :]
    # eqs. 21 and 23 per sensor and then the weighted sum over sensors have the moments of one mixture
    scaled *= innovation
    weights = _likelihoods(S, scaled, shares)
    gained = (RH * _flat(weights / S)[..., None, :]) @ RH.mT  # of eq. 19, R - gain RH^T
    updated = symmetric(R - gained)
    mean, spread = _moments(_flat(weights), _flat(estimates))
    return Fused(Gaussian(mean, updated + spread), updated)


def _variance(model: Model, reports: Reports, states: Array) -> Array | float:
    """R (..., K, N), or one for all; of padding, whose shares are 0, any number."""
    if not varies(model):
        return model.sensor.sd[0] ** 2
    variance = np.square(noise_sd(model, reports, states))
    return np.where(np.isinf(variance), 1.0, variance).mT if variance.ndim > 1 else variance[:, None]


def _likelihoods(S: Array, nis: Array, shares: Array) -> Array:
    """Weights (..., K, N) of each sensor's filters among themselves (eq. 22), summing to its share.

    ``nis`` (..., K, N) are the squares of the innovations over their variances ``S``.
    """
    weights = np.log(S)
    weights += nis
    weights -= np.minimum.reduce(weights, axis=-1, keepdims=True)
    weights *= -0.5
    np.exp(weights, out=weights)
    weights *= (shares / np.add.reduce(weights, axis=-1))[..., None]
    return weights


def _moments(weights: Array, points: Array) -> Gaussian:
    """Mean and covariance of ``points`` (..., 4, M), which are changed, by ``weights`` (..., M) that sum to 1."""
    mean = times(points, weights)
    points -= mean[..., None]
    return Gaussian(mean, (points * weights[..., None, :]) @ points.mT)


def _flat(values: Array) -> Array:
    """(..., K, N) as (..., K * N)."""
    return values.reshape(*values.shape[:-2], -1)
