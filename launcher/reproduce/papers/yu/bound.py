"""The error that no filter of the target of Yu et al. (2009) is below: the modes are known, and so is the noise."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from launcher.reproduce.papers.yu.truth import NOISE, PRIOR_SD, STEPS, Field, T, Truth, rates
from trackfield.filters.bounds import position_sd, trajectory_crlb
from trackfield.filters.gaussian import Motion
from trackfield.filters.rao_blackwell import foreseen
from trackfield.filters.types import Array
from trackfield.sensing.energy import Energy


def bounds(field: Field, told: Truth, sensors: int) -> Array:
    """The bound (R, T) m of the position's error along each run's path, in its own field.

    The mean of the information over fields says less: where a target may pass over a sensor it has no limit.
    """
    informations = _informations(field, told, sensors)
    return position_sd(trajectory_crlb(np.diag(np.square(PRIOR_SD)), _motions(field), informations))


def _motions(field: Field) -> Motion:
    """The target's motion in each step, (T, 5, 5): no rate apart from that of the step."""
    each = [foreseen(np.zeros(5), np.array([rate]), field.model, T, NOISE) for rate in rates()]
    F, Q = (np.stack(parts) for parts in zip(*each, strict=True))
    return Motion(F, Q)


def _informations(field: Field, told: Truth, sensors: int) -> Array:
    """(R, T, 5, 5) of the sensors nearest to the target that hear it.

    H^T R^-1 H and half the sum of the squared slopes of log R (Kay 1993, eq. 3.31), where R = noise^2 + (rho h)^2.
    """
    kind, x = field.kind, np.empty((*told.path[:, 1:].shape[:2], 5))
    x[..., :4], x[..., 4] = told.path[:, 1:], field.model.unknowns[0].mean
    found = np.empty((len(x), STEPS, 5, 5))
    for t in range(STEPS):
        away = np.linalg.norm(told.places - x[:, None, t, :2], axis=-1)
        nearest = np.argsort(away, axis=-1)[:, :sensors]
        at = np.take_along_axis(told.places, nearest[..., None], axis=1)
        found[:, t] = _information(kind, x[:, t], at, np.take_along_axis(away, nearest, axis=1) <= kind.range_m)
    return found


def _information(kind: Energy, x: Array, at: Array, heard: npt.NDArray[np.bool_]) -> Array:
    slopes, received = kind.jacobian(x, at)[..., 0, :], kind.h(x, at)[..., 0]
    R = kind.variance_of(received)
    worth = heard * (1.0 / R + 2.0 * np.square(kind.relative**2 * received / R))
    found: Array = np.einsum("rk,rki,rkj->rij", worth, slopes, slopes)
    return found
