"""The scaled unscented Kalman update with the paper's parameters (Wan & van der Merwe 2000), for many runs at once.

The weight of the central point is -399 with them, so that a covariance may come out indefinite: it is repaired.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.gaussian import root, symmetric
from trackfield.filters.types import Array, Gaussian

LEAST: Final = 1e-9
"""Variances below this share of the largest are raised to it."""


class Scaling(NamedTuple):
    """How far out sigma points lie, and what is known of the fourth moments."""

    alpha: float = 0.05
    beta: float = 2.0
    kappa: float = 0.0


PAPER: Final = Scaling()
"""Sec. IV; it has no kappa."""


def posterior(
    prior: Gaussian, z: Array, sd: Array, measure: Callable[[Array], Array], scaling: Scaling = PAPER
) -> Gaussian:
    """The belief after readings ``z`` (R, K) of noise ``sd`` (R, K), infinite for padding; see ``ukf.posterior``."""
    n = prior.mean.shape[-1]
    width = scaling.alpha**2 * (n + scaling.kappa)  # n + lambda
    steps = np.sqrt(width) * np.concatenate((np.zeros((1, n)), np.eye(n), -np.eye(n)))
    offsets = steps @ root(prior.covariance).mT
    weights = np.full(2 * n + 1, 0.5 / width)
    weights[0] = 1.0 - n / width
    spreads = weights.copy()
    spreads[0] += 1.0 - scaling.alpha**2 + scaling.beta
    there = np.isfinite(sd)
    predicted = measure(prior.mean[:, None] + offsets)
    around = np.where(there[:, None], predicted - predicted[:, :1], 0.0)  # from the centre: large weights cancel
    centre = weights @ around
    apart = around - centre[:, None]
    innovation = np.where(there, z - predicted[:, 0] - centre, 0.0)
    noise = np.where(there, np.square(sd), 1.0)
    weighted = spreads[:, None] * apart
    S = apart.mT @ weighted + noise[..., None] * np.eye(z.shape[-1])
    cross = offsets.mT @ weighted  # (R, n, K)
    gain = np.linalg.solve(S, cross.mT).mT
    mean = prior.mean + (gain @ innovation[..., None])[..., 0]
    return Gaussian(mean, repaired(prior.covariance - gain @ cross.mT))


def repaired(covariance: Array) -> Array:
    """``covariance`` (R, n, n), symmetric, with no variance that is below ``LEAST`` of the largest."""
    variances, axes = np.linalg.eigh(symmetric(covariance))
    raised = np.maximum(variances, LEAST * variances[..., -1:])
    return np.asarray((axes * raised[..., None, :]) @ axes.mT)
