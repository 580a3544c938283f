"""The Kalman filter as textbooks write it: the exact answer in the linear case."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.types import Array, Gaussian, Reports, of_bearings
from trackfield.models import motion

FAR = 1e7
"""From sensors this far (m) a bearing is linear in the position, to a part in 1e5 of the noise."""


class Exact(NamedTuple):
    mean: Array
    covariance: Array
    log_evidence: float


def predict(belief: Gaussian, dt: float, sigma_v: float) -> Gaussian:
    F, gain = np.array(motion.transition(dt)), np.array(motion.noise_gain(dt))
    return Gaussian(F @ belief.mean, F @ belief.covariance @ F.T + sigma_v**2 * gain @ gain.T)


def update(belief: Gaussian, z: Array, H: Array, R: Array) -> Exact:
    S = H @ belief.covariance @ H.T + R
    K = belief.covariance @ H.T @ np.linalg.inv(S)
    miss = z - H @ belief.mean
    log_evidence = -0.5 * (miss @ np.linalg.inv(S) @ miss + np.linalg.slogdet(S)[1] + len(z) * np.log(2.0 * np.pi))
    P = (np.eye(len(belief.mean)) - K @ H) @ belief.covariance
    return Exact(belief.mean + K @ miss, P, float(log_evidence))


def far_reports(z: Array) -> Reports:
    """Bearings that measure x and y linearly, as z (2,) in metres, with noise in units of 1 / FAR.

    The sensors stand far to the south, where a bearing is x / FAR, and far to the east: there it is
    -pi/2 + y / FAR.
    """
    positions = np.array([[0.0, -FAR], [FAR, 0.0]])
    bearings = np.array([z[0] / FAR, -np.pi / 2.0 + z[1] / FAR])
    return of_bearings(0, ("south", "east"), positions, bearings, np.full(2, 60.0))
