"""A position from the readings of one instant, of any kind of sensing: the best of many descents, if it is unique.

Gauss-Newton as in ``fix.py``, from a grid of places within the sensors' range at once. Readings such as ranges may fit
several places equally well; then there is no fix. The unknowns of the sensing are found along with the position.
"""

from __future__ import annotations

import numpy as np

from trackfield.filters.gaussian import extent, symmetric
from trackfield.filters.measurement import extended, innovations, jacobians, noise_sd
from trackfield.filters.robust import inflated, tailed
from trackfield.filters.types import Array, Gaussian, Model, Reports

_GRID = np.stack(np.meshgrid(*2 * (np.linspace(-0.8, 0.8, 5),)), axis=-1).reshape(-1, 2)
"""(25, 2) of the range: where descents begin."""
_STEPS = 30
_SHORTER = 0.5 ** np.arange(8)[:, None, None]
"""The factors by which a step may be shortened."""
_AS_LIKELY = 13.8
"""A place whose cost exceeds the best by more than this (twice the log of 1000) is ruled out."""


def searched(
    anywhere: Array, model: Model, reports: Reports, lost_m: float, *, robust: bool = False
) -> Gaussian | None:
    """The belief over (4 + u,) from readings alone; ``anywhere`` (4, 4) is the covariance without information.

    None if they fit several places, or leave the position's sd above ``lost_m``. With ``robust`` readings may be
    outliers (``robust.tailed``); the steps then weigh each by its raised noise.
    """
    if len(reports) == 0:
        return None
    where = np.append(reports.positions.mean(axis=0), [0.0, 0.0])
    centre, spread = extended(Gaussian(where, anywhere), model.unknowns)
    scale = np.sqrt(np.diag(spread))

    def cost(x: Array) -> Array:
        sd = noise_sd(model, reports, x)
        misses = innovations(model, x, reports) / sd
        squares = np.square(misses)
        total: Array = np.square((x - centre) / scale).sum(axis=-1)
        total += (tailed(squares) if robust else squares).sum(axis=-1)
        total += 2.0 * np.broadcast_to(np.log(sd), misses.shape).sum(axis=-1)
        return total

    def normal(x: Array) -> tuple[Array, Array]:
        """J^T J and J^T misses less the pull of the prior, in units of its sd."""
        sd, misses = noise_sd(model, reports, x), innovations(model, x, reports)
        if robust:
            sd = inflated(sd, misses, np.zeros_like(misses))
        J = jacobians(model, x, reports) * scale / sd[..., None]
        pull = np.einsum("...ki,...k->...i", J, misses / sd) - (x - centre) / scale
        return np.eye(len(scale)) + np.swapaxes(J, -1, -2) @ J, pull

    range_m = max(kind.range_m for kind in model.kinds.values())
    x = centre + np.pad(_GRID * range_m, ((0, 0), (0, len(scale) - 2)))
    for _ in range(_STEPS):
        matrix, pull = normal(x)
        tried = np.concatenate((x[None], x + _SHORTER * scale * np.linalg.solve(matrix, pull[..., None])[..., 0]))
        x = np.take_along_axis(tried, cost(tried).argmin(axis=0)[None, :, None], axis=0)[0]
    costs = cost(x)
    mean = x[costs.argmin()]
    covariance = symmetric(scale[:, None] * np.linalg.inv(normal(mean)[0]) * scale)
    apart = np.hypot(*(x[costs <= costs.min() + _AS_LIKELY] - mean)[:, :2].T)
    if extent(covariance) > lost_m or apart.max() > 3.0 * extent(covariance):
        return None
    return Gaussian(mean, covariance)
