"""How good a track was. Errors are estimate minus truth, (..., T, d), leading axes for runs."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

LOST_M: Final = 50.0
"""A target is lost when the position error at the last step exceeds this (m), unless the field says otherwise."""


def rmse(errors: Array) -> float:
    """Root of the mean squared error vector, pooled over runs and time: errors (..., d)."""
    return float(np.sqrt(np.square(errors).sum(axis=-1).mean()))


def median_error(errors: Array) -> float:
    """Median length of the error vectors (..., d)."""
    return float(np.median(np.linalg.norm(errors, axis=-1)))


def nees(errors: Array, covariances: Array) -> Array:
    """Normalised estimation error squared, e^T P^-1 e: (...) of errors (..., d) and P (..., d, d).

    It is d on average if errors are as large as P says, and infinite where an error lies in a direction in
    which P has no extent.
    """
    variances, axes = np.linalg.eigh(covariances)
    along = np.square(np.einsum("...i,...ij->...j", errors, axes))
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(variances > 0.0, along / variances, np.where(along > 0.0, np.inf, 0.0))
    total: Array = shares.sum(axis=-1)
    return total


def lost(position_errors: Array, lost_m: float = LOST_M) -> npt.NDArray[np.bool_]:
    """Whether the target was lost in each run: position errors (..., T, 2) in metres, at the end above ``lost_m``."""
    gone: npt.NDArray[np.bool_] = np.linalg.norm(position_errors[..., -1, :], axis=-1) > lost_m
    return gone
