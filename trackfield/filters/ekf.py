"""Extended Kalman update for independent measurements (Bar-Shalom, Li & Kirubarajan 2001, sec. 10.3).

With G = H^T R^-1 H, the information of the measurements, the update is P+ = (I + P G)^-1 P: a system of the state's
size for any number of measurements, and no inverse of P, which may be singular. In the linear case it is the Kalman
filter.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import identity, log_scale, symmetric, times
from trackfield.filters.types import Array, Gaussian, Update

Map = Callable[[Array], Array]


def update(
    prior: Gaussian, z: Array, sd: Array | float, measure: Map, jacobian: Map, residual: Map | None = None
) -> Update:
    """Update with measurements ``z`` (..., K) of independent noise ``sd`` (scalar or (..., K)), all at once.

    ``measure`` maps states (..., n) to measurements (..., K) and ``jacobian`` to their derivatives (..., K, n), both
    taken at the prior's mean; ``residual`` maps differences of measurements into their valid range (for angles,
    [-pi, pi)). ``prior`` may have leading batch axes, and be singular. A measurement of infinite ``sd`` has no effect,
    so steps with fewer reports fit into one array.
    """
    miss, H = _linearised(prior, z, measure, jacobian, residual)
    after, told = _corrected(prior, miss, H, sd)
    nis = np.square(told.miss).sum(axis=-1) - (told.pull * (after.covariance @ told.pull[..., None])[..., 0]).sum(
        axis=-1
    )
    scale = log_scale(np.broadcast_to(sd, z.shape))
    return Update(after, -0.5 * (nis + np.linalg.slogdet(told.system)[1] + scale))


def posterior(
    prior: Gaussian, z: Array, sd: Array | float, measure: Map, jacobian: Map, residual: Map | None = None
) -> Gaussian:
    """The posterior of ``update`` without the evidence, which takes less time."""
    return _corrected(prior, *_linearised(prior, z, measure, jacobian, residual), sd)[0]


def corrected(prior: Gaussian, miss: Array, H: Array, sd: Array | float) -> Gaussian:
    """The same of the innovation ``miss`` (..., K) and the derivatives ``H`` (..., K, n), both at the prior's mean."""
    return _corrected(prior, miss, H, sd)[0]


class _Told(NamedTuple):
    """``miss`` (..., K) in units of the noise, ``pull`` H^T R^-1 miss (..., n), ``system`` I + P G (..., n, n)."""

    miss: Array
    pull: Array
    system: Array


def _linearised(prior: Gaussian, z: Array, measure: Map, jacobian: Map, residual: Map | None) -> tuple[Array, Array]:
    difference = z - measure(prior.mean)
    return difference if residual is None else residual(difference), jacobian(prior.mean)


def _corrected(prior: Gaussian, miss: Array, H: Array, sd: Array | float) -> tuple[Gaussian, _Told]:
    mean, P = prior
    miss = miss / sd
    H = H / (sd[..., None] if isinstance(sd, np.ndarray) else sd)
    HT = H.mT
    system = P @ (HT @ H)
    system += identity(mean.shape[-1])
    covariance = symmetric(np.asarray(np.linalg.solve(system, P), np.float64))
    pull = times(HT, miss)
    return Gaussian(mean + times(covariance, pull), covariance), _Told(miss, pull, system)
