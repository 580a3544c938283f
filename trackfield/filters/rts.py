"""Rauch-Tung-Striebel smoother (Rauch, Tung & Striebel 1965; Särkkä 2013, thm. 8.2): all reports, back to the start."""

from __future__ import annotations

import numpy as np

from trackfield.filters.gaussian import Motion, predict, symmetric
from trackfield.filters.types import Array, Gaussian

_FLAT = 1e-12
"""Eigenvalues of the predicted correlation below this count as none: rounding leaves some 1e-16 of them."""


def smooth(filtered: Gaussian, motion: Motion) -> Gaussian:
    """The smoothed beliefs: T filtered beliefs (..., T, n), each given all later measurements too.

    ``motion`` leads from each belief to the next: (..., T-1, n, n), or (n, n) for all. A predicted covariance
    may be singular. Exact if motion and measurements are linear.
    """
    means, covariances = filtered
    now = Gaussian(means[..., :-1, :], covariances[..., :-1, :, :])
    ahead = predict(now, motion)
    gain = now.covariance @ np.swapaxes(motion.F, -1, -2) @ _inverse(ahead.covariance)
    # Joseph's form of P + G (P_later - P_ahead) G^T: no covariance goes below zero by rounding
    keep = np.eye(means.shape[-1]) - gain @ motion.F
    own = keep @ now.covariance @ np.swapaxes(keep, -1, -2) + gain @ motion.Q @ np.swapaxes(gain, -1, -2)
    mean, covariance = means.copy(), covariances.copy()
    for t in range(means.shape[-2] - 2, -1, -1):
        G = gain[..., t, :, :]
        gap = mean[..., t + 1, :] - ahead.mean[..., t, :]
        mean[..., t, :] += (G @ gap[..., None])[..., 0]
        covariance[..., t, :, :] = own[..., t, :, :] + G @ covariance[..., t + 1, :, :] @ np.swapaxes(G, -1, -2)
    return Gaussian(mean, symmetric(covariance))


def _inverse(covariance: Array) -> Array:
    """Pseudo-inverse (..., n, n), with metres and metres per second brought to one scale first."""
    sd = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    scale = np.where(sd > 0.0, sd, 1.0)
    scale = scale[..., :, None] * scale[..., None, :]
    inverse: Array = np.linalg.pinv(covariance / scale, rcond=_FLAT, hermitian=True) / scale
    return inverse
