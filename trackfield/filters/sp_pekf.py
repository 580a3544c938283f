"""State partition with parallel extended Kalman filters (Zhai et al. 2009, sec. IV-B).

The state is a nominal part plus a residual. N nominals run through the motion model with noise; around each,
an EKF estimates the residual from one sensor's reading, a single number (in the paper a bearing). The N x K filters of
N nominals and K sensors are one array operation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import constant_velocity, moments, symmetric
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
    innovation = innovations(model, expected, reports)  # (..., N, K), eq. 20
    H = _rows(jacobians(model, noisy, reports))  # (..., N * K, 4), eq. 14
    RH = H @ R
    S = np.vecdot(RH, H).reshape(innovation.shape) + _variance(model, reports, expected)
    if robust:
        S = np.maximum(S, np.square(innovation / BEYOND))
    gain = RH / _flat(S)[..., None]  # eq. 17
    # eq. 16: what the nominal gained by noise, the residual loses
    estimates = gain * _flat(innovation)[..., None] + expected.repeat(innovation.shape[-1], axis=-2)
    # eqs. 21 and 23 per sensor and then the weighted sum over sensors have the moments of one mixture
    weights = _flat(_likelihoods(S, innovation, shares))
    gained = (gain.mT * weights[..., None, :]) @ RH  # of eq. 19, R - gain RH^T
    updated = symmetric(R - gained)
    mean, spread = moments(weights, estimates)
    return Fused(Gaussian(mean, updated + spread), updated)


def _variance(model: Model, reports: Reports, states: Array) -> Array | float:
    """R (..., N, K), or one for all; of padding, whose shares are 0, any number."""
    if not varies(model):
        return model.sensor.sd[0] ** 2
    variance = np.square(noise_sd(model, reports, states))
    return np.where(np.isinf(variance), 1.0, variance) if variance.ndim > 1 else variance


def _likelihoods(S: Array, innovation: Array, shares: Array) -> Array:
    """Weights (..., N, K) of each sensor's filters among themselves (eq. 22), summing to its share."""
    log_evidence = np.log(S) + np.square(innovation) / S
    log_evidence -= log_evidence.min(axis=-2, keepdims=True)
    log_evidence *= -0.5
    weights: Array = np.exp(log_evidence, out=log_evidence)
    weights *= (shares / weights.sum(axis=-2))[..., None, :]
    return weights


def _flat(values: Array) -> Array:
    """(..., N, K) as (..., N * K)."""
    return values.reshape(*values.shape[:-2], -1)


def _rows(values: Array) -> Array:
    """(..., N, K, 4) as (..., N * K, 4)."""
    return values.reshape(*values.shape[:-3], -1, 4)
