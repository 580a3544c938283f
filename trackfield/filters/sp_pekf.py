"""State partition with parallel extended Kalman filters (Zhai et al. 2009, sec. IV-B).

The state is a nominal part plus a residual. N nominals run through the motion model with noise; around each,
an EKF estimates the residual from one sensor's bearing. The N x K filters of N nominals and K sensors are one
array operation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import constant_velocity, moments, symmetric
from trackfield.filters.types import Array, Gaussian, Reports
from trackfield.models import doa
from trackfield.models.doa import wrap


class Fused(NamedTuple):
    """The sensors' estimates as one Gaussian, and the covariance that the filters carry on."""

    proposal: Gaussian
    carried: Array


def advance(
    nominals: Array,
    noisy: Array,
    carried: Array,
    reports: Reports,
    shares: Array,
    *,
    dt: float,
    sigma_v: float,
    sigma_w: float,
) -> Fused:
    """One step of all filters, and their sum over sensors.

    ``nominals`` (..., N, 4) are the last step's, their residuals 0; ``noisy`` (..., N, 4) the same after the motion
    model with noise (eq. 10); ``carried`` (..., 4, 4) the covariance of each filter; ``shares`` (..., K) the sensors'
    weights, summing to 1. The arrays of ``reports`` may have the leading axes of runs, too.
    """
    F, Q = constant_velocity(dt, sigma_v)
    expected = nominals @ F.T  # eq. 15: what the nominal gained by noise, the residual loses
    R = F @ carried @ F.T + Q  # eq. 18
    sensors = reports.positions[..., None, :, :]
    innovation = wrap(reports.bearings[..., None, :] - doa.measure(expected, sensors))  # (..., N, K), eq. 20
    H = _rows(doa.jacobian(noisy, sensors))  # (..., N * K, 4), eq. 14
    RH = H @ R
    S = np.vecdot(RH, H).reshape(innovation.shape) + sigma_w**2
    gain = RH / _flat(S)[..., None]  # eq. 17
    estimates = gain * _flat(innovation)[..., None] + expected.repeat(innovation.shape[-1], axis=-2)  # eq. 16
    # eqs. 21 and 23 per sensor and then the weighted sum over sensors have the moments of one mixture
    weights = _flat(_likelihoods(S, innovation, shares))
    gained = (gain.mT * weights[..., None, :]) @ RH  # of eq. 19, R - gain RH^T
    updated = symmetric(R - gained)
    mean, spread = moments(weights, estimates)
    return Fused(Gaussian(mean, updated + spread), updated)


def _likelihoods(S: Array, innovation: Array, shares: Array) -> Array:
    """Weights (..., N, K) of each sensor's filters among themselves (eq. 22), summing to its share."""
    log_evidence = np.log(S) + np.square(innovation) / S
    weights: Array = np.exp(-0.5 * (log_evidence - log_evidence.min(axis=-2, keepdims=True)))
    weights *= (shares / weights.sum(axis=-2))[..., None, :]
    return weights


def _flat(values: Array) -> Array:
    """(..., N, K) as (..., N * K)."""
    return values.reshape(*values.shape[:-2], -1)


def _rows(values: Array) -> Array:
    """(..., N, K, 4) as (..., N * K, 4)."""
    return values.reshape(*values.shape[:-3], -1, 4)
