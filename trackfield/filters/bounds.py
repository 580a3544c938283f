"""Lower bounds of the estimation error.

Both are the recursion of Tichavsky, Muravchik & Nehorai (1998, eq. 21) for linear motion x_t = F x_{t-1} + v, v of
covariance Q: J_t = (F J_{t-1}^-1 F^T + Q)^-1 + D_t, where D_t is the information of the measurements of step t. It
is computed on the bound C = J^-1 itself, which may be singular, as may Q.

They differ in D_t. The posterior bound (PCRLB) holds when only the prior is known: D_t is the mean over all paths that
the target may take. The bound along a trajectory takes D_t at the target's true states: it is the covariance of a
Kalman filter linearised about the truth (Taylor 1979), the reference for the error on this path.
In the linear case D_t is the same everywhere, and both are the Kalman filter's covariance.
"""

from __future__ import annotations

import numpy as np

from trackfield.filters.gaussian import Motion, symmetric
from trackfield.filters.types import Array


def information(jacobian: Array, sd: Array | float) -> Array:
    """D (..., n, n): the information of K independent measurements about a state.

    ``jacobian`` (..., K, n) holds their derivatives dh/dx there, ``sd`` (scalar or (..., K)) their noise, positive and
    in their own unit; an infinite sd stands for a measurement that was not made.
    """
    slopes = jacobian / np.asarray(sd, float)[..., None]
    return np.asarray(np.swapaxes(slopes, -1, -2) @ slopes)


def trajectory_crlb(prior: Array, motions: Motion, informations: Array) -> Array:
    """Bounds (..., T, n, n) for steps 1 to T along given trajectories, leading axes for several of them.

    ``prior`` (n, n) is the covariance at step 0. ``motions`` lead to each step, (..., T, n, n), or (n, n) if they are
    all the same. ``informations`` (..., T, n, n) are D at the true states of these steps.
    """
    F, Q = (np.broadcast_to(matrix, informations.shape) for matrix in motions)
    bounds = np.empty(informations.shape)
    C = prior
    for t in range(informations.shape[-3]):
        C = F[..., t, :, :] @ C @ np.swapaxes(F[..., t, :, :], -1, -2) + Q[..., t, :, :]
        # (C^-1 + D)^-1 without the inverse of C
        C = symmetric(np.asarray(np.linalg.solve(np.eye(C.shape[-1]) + C @ informations[..., t, :, :], C)))
        bounds[..., t, :, :] = C
    return bounds


def pcrlb(prior: Array, motions: Motion, informations: Array) -> Array:
    """Posterior bounds (T, n, n) for steps 1 to T, as ``trajectory_crlb``.

    ``informations`` (R, T, n, n) are D along R paths drawn from the target's motion. Their mean need not exist: the
    information of a bearing grows as 1 / distance^2, so if the target may pass over a sensor the mean grows without
    limit, as the logarithm of R, and the bound falls. It is then meaningful only together with R.
    """
    return trajectory_crlb(prior, motions, informations.mean(axis=0))


def position_sd(bounds: Array) -> Array:
    """Root of the trace of the position's part: metres (...), of bounds (..., n, n) on (x, y, ...)."""
    return np.asarray(np.sqrt(np.trace(bounds[..., :2, :2], axis1=-2, axis2=-1)))
