"""Levenberg and Marquardt's descent of many likelihoods at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from trackfield.filters.passes.likelihood import Likelihood
from trackfield.filters.passes.types import Flags
from trackfield.filters.types import Array

_STEPS = 40
_DAMPING = 1e-3
_SETTLED = 1e-4
"""A descent has arrived if a step would lower the cost by less than this: a hundredth of an sd away."""
_HOPELESS = 30.0
"""A descent is given up if its next step will leave the cost so much above the least of the same event."""


class Descended(NamedTuple):
    """Where descents ended: ``parameters`` (..., n), the likelihood there, and whether they ``converged`` (...,)."""

    parameters: Array
    at: Likelihood
    converged: Flags


def descend(start: Array, look: Callable[[Array], Likelihood], *, rivals: bool) -> Descended:
    """Minima of the cost that ``look`` tells of, next to ``start`` (..., n), by damped steps of Fisher's scoring.

    With ``rivals`` the last leading axis has several starts for the same, of which those that will not win are given
    up. A descent that has arrived stays, so an answer is the same in any batch.
    """
    x, here = start, look(start)
    damping = np.full(here.cost.shape, _DAMPING)
    converged, hopeless = np.zeros(here.cost.shape, bool), np.zeros(here.cost.shape, bool)
    for _ in range(_STEPS):
        step, gain = _step(here, damping)
        converged = converged | (gain < _SETTLED)
        if rivals:
            hopeless = hopeless | (here.cost - gain > np.fmin.reduce(here.cost, axis=-1, keepdims=True) + _HOPELESS)
        going = ~converged & ~hopeless
        if not going.any():
            break
        there = look(x + step)
        better = (there.cost < here.cost) & going
        x = np.where(better[..., None], x + step, x)
        here = Likelihood(
            *(
                np.where(better.reshape(better.shape + (1,) * (new.ndim - better.ndim)), new, old)
                for new, old in zip(there, here, strict=True)
            )
        )
        damping = np.where(better, damping / 5.0, damping * 4.0)
    return Descended(x, here, converged)


def _step(here: Likelihood, damping: Array) -> tuple[Array, Array]:
    """The damped step (..., n), and by how much an undamped one would lower the cost (...,)."""
    scale = np.sqrt(np.maximum(np.diagonal(here.information, axis1=-2, axis2=-1), np.finfo(float).tiny))
    scaled = here.information / (scale[..., :, None] * scale[..., None, :])
    gradient = -here.gradient / scale
    eye = np.eye(scale.shape[-1])
    both = np.stack((scaled + (1e-12 + damping[..., None, None]) * eye, scaled + 1e-12 * eye))
    damped, full = np.linalg.solve(both, np.stack((gradient, gradient))[..., None])[..., 0]
    return damped / scale, (gradient * full).sum(axis=-1)
