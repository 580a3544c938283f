"""State partition with parallel extended Kalman filters (Zhai et al. 2009, sec. IV-B).

The state is a nominal part plus a residual. N nominals run through the motion model with noise; around each,
an EKF estimates the residual from one sensor's bearing. The N x K filters of N nominals and K sensors are one
array operation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import constant_velocity, moments, predict, symmetric
from trackfield.filters.resampling import normalised
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

    ``nominals`` (N, 4) are the last step's, their residuals 0; ``noisy`` (N, 4) the same after the motion
    model with noise (eq. 10); ``carried`` (4, 4) the covariance of each filter; ``shares`` (K,) the sensors'
    weights, summing to 1.
    """
    # eq. 15: what the nominal gained by noise, the residual loses, so the predicted state is F x_n
    expected, R = predict(Gaussian(nominals, carried), constant_velocity(dt, sigma_v))  # eq. 18
    H = doa.jacobian(noisy, reports.positions)  # (N, K, 4), eq. 14
    RH = H @ R
    S = (RH * H).sum(axis=-1) + sigma_w**2
    innovation = wrap(reports.bearings - doa.measure(expected, reports.positions))  # eq. 20
    gain = RH / S[..., None]  # eq. 17
    estimates = expected[:, None, :] + gain * innovation[..., None]  # eq. 16
    log_evidence = -0.5 * (np.log(S) + np.square(innovation) / S)
    psi = normalised(log_evidence.T).T  # eq. 22, each sensor's filters among themselves
    # eqs. 21 and 23 per sensor and then the weighted sum over sensors have the moments of one mixture
    weights = (psi * shares).reshape(-1)
    gained = (gain.reshape(-1, 4).T * weights) @ RH.reshape(-1, 4)  # of eq. 19, R - gain RH^T
    updated = symmetric(R - gained)
    mean, spread = moments(weights, estimates.reshape(-1, 4))
    return Fused(Gaussian(mean, updated + spread), updated)
