"""Resampling: systematic (Kitagawa 1996) and residual (Liu & Chen 1998), and when to do it.

Chopin & Papaspiliopoulos 2020, algs. 9.3 and 9.4, and sec. 10.2 of the effective size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

Indices = npt.NDArray[np.intp]
Resampler = Callable[[Array, int, np.random.Generator], Indices]
"""Indices (n,), ascending, of n draws from weights (m,)."""


def systematic(weights: Array, n: int, rng: np.random.Generator) -> Indices:
    """Indices (n,), ascending, of ``n`` draws from ``weights`` (m,): floor or ceil of n w_i times each i.

    The weights need not sum to 1 exactly; particles of weight 0 are never drawn. Raises ``ValueError`` if all
    weights are 0.
    """
    return evenly(weights, n, rng.random())


def evenly(weights: Array, n: int, u: Array | float) -> Indices:
    """The same (..., n) of ``weights`` (..., m), with the one random number ``u`` (...,) in [0, 1) as an argument."""
    # how many points (k + u) total / n are not below each sum, counted from the end: there rounding does no harm
    beyond = _cumulative(weights)
    beyond /= -beyond[..., -1:]
    beyond += 1.0
    beyond *= n
    beyond += u if beyond.ndim == 1 else np.asarray(u)[..., None]
    left = np.empty((*beyond.shape[:-1], beyond.shape[-1] + 1), np.intp)
    left[..., 0] = n
    left[..., 1:] = np.minimum(beyond, n, out=beyond)  # never negative, so this is the floor
    counts = left[..., :-1] - left[..., 1:]
    chosen = np.arange(counts.size).repeat(counts.ravel())
    return chosen if counts.ndim == 1 else chosen.reshape(*counts.shape[:-1], n) % counts.shape[-1]


def residual(weights: Array, n: int, rng: np.random.Generator) -> Indices:
    """Indices (n,), ascending, of ``n`` draws: floor of n w_i times each i, the rest by chance of what is left.

    Weights as for ``systematic``, and the same error.
    """
    shares = np.asarray(weights, np.float64) * (n / _cumulative(weights)[-1])
    copies = np.floor(shares).astype(np.intp)
    rest = n - int(copies.sum())
    if rest:
        cumulative = np.cumsum(shares - copies)
        drawn = np.searchsorted(cumulative, rng.random(rest) * cumulative[-1], side="right")
        # rounding may lift a draw to the sum itself: it belongs to the last index that has a share
        drawn = np.minimum(drawn, np.searchsorted(cumulative, cumulative[-1]))
        copies += np.bincount(drawn, minlength=len(copies))
    return np.repeat(np.arange(len(copies)), copies)


def effective_size(weights: Array) -> Array:
    """The effective sample size of weights (..., n): 1 / sum w^2 if they sum to 1 (Kong et al. 1994)."""
    size: Array = np.square(weights.sum(axis=-1)) / np.square(weights).sum(axis=-1)
    return size


def due(weights: Array, share: float) -> bool:
    """Whether to resample now: the effective size of the weights (n,) is at most ``share`` of n.

    Until then particles may keep their weights, which spares the noise of a draw. With a ``share`` of 1 it is always.
    """
    return share >= 1.0 or bool(effective_size(weights) <= share * len(weights))


def normalised(log_weights: Array) -> Array:
    """Weights (..., n) that sum to 1, from logarithms of any size."""
    weights: Array = log_weights - np.maximum.reduce(log_weights, axis=-1, keepdims=True)
    np.exp(weights, out=weights)
    weights /= np.add.reduce(weights, axis=-1, keepdims=True)
    return weights


def _cumulative(weights: Array) -> Array:
    cumulative = np.add.accumulate(weights, axis=-1, dtype=np.float64)
    total = cumulative[..., -1]
    if not (total > 0.0 if total.ndim == 0 else total.min() > 0.0):
        raise ValueError("cannot resample: no weight is positive")
    return cumulative
