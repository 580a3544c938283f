"""Systematic resampling (Kitagawa 1996; Chopin & Papaspiliopoulos 2020, alg. 9.4)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array


def systematic(weights: Array, n: int, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    """Indices (n,), ascending, of ``n`` draws from ``weights`` (m,): floor or ceil of n w_i times each i.

    The weights need not sum to 1 exactly; what has no weight is never drawn. Raises ValueError if nothing has
    weight.
    """
    cumulative = np.cumsum(weights)
    total = cumulative[-1]
    if not total > 0.0:
        raise ValueError("cannot resample: no weight is positive")
    points = (np.arange(n) + rng.random()) * (total / n)
    chosen = np.searchsorted(cumulative, points, side="right")
    # rounding may lift the last point to the total itself: it belongs to the last index that has weight
    indices: npt.NDArray[np.intp] = np.minimum(chosen, np.searchsorted(cumulative, total))
    return indices


def normalised(log_weights: Array) -> Array:
    """Weights (..., n) that sum to 1, from logarithms of any size."""
    weights = np.exp(log_weights - log_weights.max(axis=-1, keepdims=True))
    share: Array = weights / weights.sum(axis=-1, keepdims=True)
    return share
