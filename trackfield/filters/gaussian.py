"""Gaussian beliefs: prediction by a linear model, moment matching, square roots, densities.

All functions take leading batch axes.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from trackfield.filters.types import Array, Gaussian
from trackfield.models import motion


class Motion(NamedTuple):
    """A linear motion model, x_t = F x_{t-1} + noise of covariance Q; both (..., 4, 4)."""

    F: Array
    Q: Array


@lru_cache(maxsize=64)
def constant_velocity(dt: float, sigma_v: float) -> Motion:
    """Nearly constant velocity over ``dt`` seconds, acceleration of sd ``sigma_v`` (m/s^2) per axis."""
    return Motion(constant(motion.transition(dt)), constant(motion.process_noise(dt, sigma_v)))


@lru_cache(maxsize=64)
def constant(rows: motion.Rows) -> Array:
    """A matrix of ``trackfield.models.motion`` as a read-only array, made once and then shared."""
    matrix = np.array(rows)
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=64)
def identity(n: int) -> Array:
    """The identity matrix (n, n), made once and then shared."""
    matrix = np.eye(n)
    matrix.flags.writeable = False
    return matrix


def predict(belief: Gaussian, model: Motion) -> Gaussian:
    """The belief after one step of the motion: F m, F P F^T + Q."""
    F, Q = model
    return Gaussian(times(F, belief.mean), F @ belief.covariance @ F.mT + Q)


def times(matrix: Array, vector: Array) -> Array:
    """The products (..., m) of matrices (..., m, n) and vectors (..., n)."""
    found: Array = matrix @ vector if vector.ndim == 1 else (matrix @ vector[..., None])[..., 0]
    return found


def collapse(weights: Array, means: Array, covariances: Array) -> Gaussian:
    """The Gaussian with the mean and covariance of a mixture.

    ``weights`` (..., M) sum to 1, ``means`` (..., M, n), ``covariances`` (..., M, n, n).
    """
    mean = np.einsum("...m,...mi->...i", weights, means)
    apart = means - mean[..., None, :]
    spread = covariances + apart[..., :, None] * apart[..., None, :]
    return Gaussian(mean, np.einsum("...m,...mij->...ij", weights, spread))


def moments(weights: Array, points: Array) -> Gaussian:
    """Mean and covariance of weighted points: ``weights`` (..., n) sum to 1, ``points`` (..., n, d)."""
    mean = (weights[..., None, :] @ points)[..., 0, :]
    apart = np.subtract(points, mean[..., None, :], order="F")  # long loops over points, not short ones over axes
    apart *= np.sqrt(weights)[..., None]
    return Gaussian(mean, apart.mT @ apart)


def near_moments(weights: Array, points: Array) -> Gaussian:
    """The same of points that lie around the origin, in fewer operations: far from it rounding would show."""
    mean = weights @ points if weights.ndim == 1 else (weights[..., None, :] @ points)[..., 0, :]
    square = (points * weights[..., None]).mT @ points
    square -= mean[..., None] * mean[..., None, :]
    return Gaussian(mean, square)


def symmetric(covariance: Array) -> Array:
    """``covariance`` (..., n, n) without the asymmetry that rounding leaves."""
    half: Array = covariance + covariance.mT
    half *= 0.5
    return half


def extent(covariance: Array) -> float:
    """The largest sd of the position (m), of a ``covariance`` (4, 4) of (x, y, vx, vy)."""
    (a, b), (_, c) = covariance[:2, :2].tolist()  # in numbers, which takes a tenth of the time
    return math.sqrt(max((a + c) / 2.0 + math.hypot((a - c) / 2.0, b), 0.0))


def root(covariance: Array) -> Array:
    """L (..., n, n) with L L^T = ``covariance``: Cholesky's if there is one.

    A singular covariance, or one that rounding pushed below zero, gets its principal axes with negative
    variances taken as zero. It changes nothing for the others of its batch.
    """
    try:
        return np.asarray(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError:
        if covariance.ndim > 2:  # numpy does not say which of them it was
            return np.array([root(one) for one in covariance])
        variances, axes = np.linalg.eigh(covariance)
        return np.asarray(axes * np.sqrt(np.maximum(variances, 0.0))[..., None, :])


def log_scale(sd: Array) -> Array:
    """Log of 2 pi sd^2, summed over K measurements of noise ``sd`` (..., K); one of infinite noise adds nothing."""
    scale: Array = np.log(np.where(np.isinf(sd), 1.0, 2.0 * np.pi * np.square(sd))).sum(axis=-1)
    return scale


def log_density(points: Array, belief: Gaussian) -> Array:
    """log N(x; m, P) (..., n) of ``points`` (..., n, d), up to directions in which P has no extent.

    Variances below 1e-12 of the largest count as that much, so a singular P still ranks points.
    """
    variances, axes = np.linalg.eigh(belief.covariance)
    variances = np.maximum(variances, 1e-12 * variances[..., -1:])
    along = (points - belief.mean[..., None, :]) @ axes
    density: Array = (np.square(along) @ (-0.5 / variances)[..., None])[..., 0]
    density -= 0.5 * np.log(2.0 * np.pi * variances).sum(axis=-1, keepdims=True)
    return density
