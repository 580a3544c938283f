"""Extended Kalman update for independent measurements (Bar-Shalom, Li & Kirubarajan 2001, sec. 10.3).

With P = L L^T and J the slopes of the measurements along the columns of L, in units of the noise, the update is
P+ = L (I + J^T J)^-1 L^T: symmetric and never negative, and its cost grows only linearly with the number of
measurements. In the linear case it is the Kalman filter.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trackfield.filters.gaussian import log_scale, root, symmetric
from trackfield.filters.types import Array, Gaussian, Update

Map = Callable[[Array], Array]


def update(
    prior: Gaussian,
    z: Array,
    sd: Array | float,
    measure: Map,
    jacobian: Map,
    residual: Map | None = None,
) -> Update:
    """Take in measurements ``z`` (..., K) of independent noise ``sd`` (scalar or (..., K)), all at once.

    ``measure`` maps states (..., n) to measurements (..., K) and ``jacobian`` to their slopes (..., K, n), both
    taken at the prior's mean; ``residual`` maps differences of measurements into the range where they mean
    something (for angles, to [-pi, pi)). ``prior`` may have leading batch axes, and be singular. A measurement
    of infinite ``sd`` is none, so steps with fewer reports fit into one array.
    """
    mean, P = prior
    L = root(P)
    sd = np.broadcast_to(sd, z.shape)
    difference = z - measure(mean)
    miss = (difference if residual is None else residual(difference)) / sd
    JT = np.swapaxes((jacobian(mean) @ L) / sd[..., None], -1, -2)
    normal = np.eye(mean.shape[-1]) + JT @ np.swapaxes(JT, -1, -2)
    slope = JT @ miss[..., None]
    LT = np.swapaxes(L, -1, -2)
    solved = np.linalg.solve(normal, np.concatenate((slope, LT), axis=-1))
    moved = L @ solved
    nis = np.square(miss).sum(axis=-1) - (slope * solved[..., :1]).sum(axis=(-2, -1))
    log_evidence = -0.5 * (nis + np.linalg.slogdet(normal)[1] + log_scale(sd))
    return Update(Gaussian(mean + moved[..., 0], symmetric(moved[..., 1:])), log_evidence)
