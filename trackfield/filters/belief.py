"""What a tracker knows, in a form that travels: to its next life, or to another process that goes on tracking.

A belief is a ``Gaussian``, ``Modes`` or ``Particles`` over a state of n numbers. Its bytes are little-endian float32:

- Gaussian (form 1): the mean, and the covariance's upper triangle row by row; 56 bytes for n = 4.
- modes (form 2): for each its weight, mean and triangle; 252 bytes for three of n = 5.
- particles (form 3): for each its weight and point.

The form and n are not in the bytes; they travel beside them. A float32 holds 24 bits: a position that is 10 km from the
origin is rounded by half a millimetre at most.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from trackfield.filters import gaussian
from trackfield.filters.types import Array, Gaussian, Model

MAX_DIMENSION: Final = 32
"""The highest n of a belief."""
_GAUSSIAN, _MODES, _PARTICLES = 1, 2, 3
_LARGEST: Final = float(np.finfo(np.float32).max)
_SMALLEST: Final = float(np.finfo(np.float32).tiny)
_ROUNDING: Final = 2.0**-22
"""Twice as much as rounding to float32 may change a correlation: its covariance and two variances, 2^-24 each."""


class Modes(NamedTuple):
    """A mixture of M Gaussians: ``weights`` (M,) that sum to 1, ``means`` (M, n), ``covariances`` (M, n, n)."""

    weights: Array
    means: Array
    covariances: Array


class Particles(NamedTuple):
    """N weighted points: ``weights`` (N,) that sum to 1, ``points`` (N, n)."""

    weights: Array
    points: Array


Belief = Gaussian | Modes | Particles


@runtime_checkable
class Believes(Protocol):
    """A tracker that knows more than the mean and covariance of its estimate say.

    Any other tracker's belief is the Gaussian of its last estimate, and it resumes by ``init``.
    """

    def belief(self, state: Any) -> Belief | None:
        """What it knows in this state, over (x, y, vx, vy) and any unknowns of the sensing.

        None: what its estimate says.
        """
        ...

    def resume(self, belief: Belief, model: Model) -> Any:
        """The state of this belief: its own after a pause, or another tracker's, so in any form (``moments``)."""
        ...


def moments(belief: Belief) -> Gaussian:
    """The Gaussian of a belief's mean (n,) and covariance (n, n); that of particles is made positive definite."""
    match belief:
        case Modes(weights, means, covariances):
            return gaussian.collapse(weights, means, covariances)
        case Particles(weights, points):
            mean, covariance = gaussian.moments(weights, points)
            return Gaussian(mean, repaired(covariance))
    return belief


def dimension(belief: Belief) -> int:
    """The n of a belief."""
    return int(belief[-1].shape[-1])


def form_of(belief: Belief) -> int:
    """The number of its form: 1 Gaussian, 2 modes, 3 particles."""
    match belief:
        case Modes():
            return _MODES
        case Particles():
            return _PARTICLES
    return _GAUSSIAN


def pack(belief: Belief) -> bytes:
    """The bytes of a belief.

    Raises ``ValueError`` if a number is not finite or too large for float32 (3.4e38): such a belief says nothing.
    """
    match belief:
        case Gaussian(mean, covariance):
            numbers = np.append(mean, _triangle(covariance))
        case Modes(weights, means, covariances):
            numbers = np.concatenate((weights[:, None], means, _triangle(covariances)), axis=1)
        case Particles(weights, points):
            numbers = np.concatenate((weights[:, None], points), axis=1)
    if not (np.abs(numbers) <= _LARGEST).all():
        raise ValueError("a belief with numbers that are not finite, or too large for float32")
    return numbers.astype("<f4").tobytes()


def unpack(form: int, n: int, data: bytes) -> Belief:
    """The belief of these bytes: weights that sum to 1, and covariances as of ``repaired``.

    Raises ``ValueError`` with a reason for bytes that are of no belief.
    """
    if not 1 <= n <= MAX_DIMENSION:
        raise ValueError(f"a belief of dimension {n}; expected 1 to {MAX_DIMENSION}")
    triangle = n * (n + 1) // 2
    length = {_GAUSSIAN: n + triangle, _MODES: 1 + n + triangle, _PARTICLES: 1 + n}.get(form)
    if length is None:
        raise ValueError(f"a belief of form {form}; expected 1, 2 or 3")
    if not data or len(data) % (4 * length) or (form == _GAUSSIAN and len(data) != 4 * length):
        several = "" if form == _GAUSSIAN else "a multiple of "
        raise ValueError(f"a belief of {len(data)} bytes; expected {several}{4 * length}")
    numbers = np.frombuffer(data, "<f4").astype(float).reshape(-1, length)
    if not np.isfinite(numbers).all():
        raise ValueError("a belief that is not finite")
    if form == _GAUSSIAN:
        return Gaussian(numbers[0, :n], _covariances(numbers[:, n:], n)[0])
    weights, points = _shares(numbers[:, 0]), numbers[:, 1 : 1 + n]
    return (
        Particles(weights, points)
        if form == _PARTICLES
        else Modes(weights, points, _covariances(numbers[:, 1 + n :], n))
    )


def repaired(covariance: Array) -> Array:
    """A ``covariance`` (..., n, n) that is positive definite, whatever rounding has done to it.

    Judged is the matrix of correlations, since the units of a state differ. If its least eigenvalue is below what
    rounding may have made of it, n 2^-22, all its eigenvalues are raised to at least that, and it is scaled so that the
    variances stay. A variance that float32 cannot hold is the smallest that it can, 1.2e-38. Other covariances stay
    exactly as they are.
    """
    n = covariance.shape[-1]
    itself = np.arange(n)
    whole = covariance.copy()
    whole[..., itself, itself] = variances = np.maximum(covariance[..., itself, itself], _SMALLEST)
    scale = np.sqrt(variances)[..., :, None] * np.sqrt(variances)[..., None, :]
    values, axes = np.linalg.eigh(np.clip(whole / scale, -1.0, 1.0))
    least = n * _ROUNDING
    raised = (axes * np.maximum(values, least)[..., None, :]) @ axes.mT
    sd = np.sqrt(raised[..., itself, itself])
    raised = gaussian.symmetric(raised / (sd[..., :, None] * sd[..., None, :])) * scale
    return np.where(values[..., :1, None] < least, raised, whole)


def _triangle(covariances: Array) -> Array:
    """(..., n (n + 1) / 2) of (..., n, n)."""
    rows, columns = _indices(covariances.shape[-1])
    upper: Array = covariances[..., rows, columns]
    return upper


def _covariances(triangles: Array, n: int) -> Array:
    """The inverse of ``_triangle``, repaired."""
    rows, columns = _indices(n)
    covariances = np.empty((len(triangles), n, n))
    covariances[:, rows, columns] = covariances[:, columns, rows] = triangles
    if (covariances[:, np.arange(n), np.arange(n)] < 0.0).any():
        raise ValueError("a belief with a negative variance")
    return repaired(covariances)


@lru_cache(maxsize=MAX_DIMENSION)
def _indices(n: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """The rows and columns of a triangle's numbers, made once and then shared."""
    rows, columns = np.triu_indices(n)
    return rows, columns


def _shares(weights: Array) -> Array:
    if (weights < 0.0).any() or not weights.sum() > 0.0:
        raise ValueError("a belief whose weights are negative or sum to 0")
    shares: Array = weights / weights.sum()
    return shares
