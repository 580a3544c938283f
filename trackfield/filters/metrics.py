"""Measures of a track's quality. Errors are estimate minus truth, (..., T, d), leading axes for runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

LOST_M: Final = 50.0
"""Default position error (m) above which a target counts as lost."""


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


def nees_band(dof: int, n: float, level: float = 0.95) -> tuple[float, float]:
    """Where the mean of ``n`` independent values of NEES lies with probability ``level``, if covariances are right.

    The sum of n chi-square values of ``dof`` degrees of freedom is chi-square with n dof (Bar-Shalom, Li & Kirubarajan
    2001, sec. 5.4.2). ``n`` need not be whole. It also holds for NIS (innovations in place of errors) of ``dof``
    measurements.
    """
    from scipy.special import gammaincinv

    low, high = gammaincinv(dof * n / 2.0, [(1.0 - level) / 2.0, (1.0 + level) / 2.0]) * 2.0 / n
    return float(low), float(high)


def effective_count(values: Array) -> float:
    """The effective number of independent values in a time series (n,), for the uncertainty of its mean.

    n over the integrated autocorrelation time, its sum cut at Geyer's initial positive sequence (Geyer 1992,
    sec. 3.3); at most n.
    """
    apart, n = values - values.mean(), len(values)
    if n < 2 or not (variance := float(apart @ apart)) > 0.0:
        return float(n)
    correlation = np.array([apart[: n - k] @ apart[k:] for k in range(n - n % 2)]) / variance
    pairs = correlation[::2] + correlation[1::2]
    last = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    return n / max(2.0 * float(pairs[:last].sum()) - 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Lost:
    """When a target counts as lost: off for ``steps`` steps in a row, somewhere in the last ``within`` (None: in all).

    Off means a position error above ``beyond_m`` metres, or no track. By default the last step decides. Raises
    ``ValueError`` for ``steps`` below 1 or above ``within``.
    """

    beyond_m: float = LOST_M
    steps: int = 1
    within: int | None = 1

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"steps: {self.steps} is below 1")
        if self.within is not None and self.within < self.steps:
            raise ValueError(f"within: the last {self.within} hold no {self.steps} steps in a row")

    def holds(self, errors: Array) -> npt.NDArray[np.bool_]:
        """Whether the target was lost: (...) of position errors (..., T, 2) in metres, NaN where there is no track."""
        off = ~(np.linalg.norm(errors, axis=-1) <= self.beyond_m)
        if self.within is not None:
            off = off[..., -self.within :]
        for _ in range(self.steps - 1):
            off = off[..., 1:] & off[..., :-1]  # so many in a row, and one more
        found: npt.NDArray[np.bool_] = off.any(axis=-1)
        return found
