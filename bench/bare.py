"""Plain numpy filters for this one model only: the reference for the cost of Trackfield's filters.

They have only the essential steps: no checks, no evidence, no missing reports. ``EKF`` and ``UKF`` take any
number of filters at once, (n, 4) and (n, 4, 4). Each ``step`` changes its filter and gives the mean.
"""

from __future__ import annotations

from math import pi

import numpy as np

from bench.data import DT, Track
from trackfield.filters.types import Array


def _wrap(angle: Array) -> Array:
    turns: Array = np.rint(angle * (0.5 / pi))
    turns *= 2.0 * pi
    return np.subtract(angle, turns, out=turns)


class _Bare:
    """The model's matrices."""

    def __init__(self, track: Track) -> None:
        self.F = np.eye(4)
        self.F[0, 2] = self.F[1, 3] = DT
        self.G = track.model.sigma_v * np.array([[DT**2 / 2, 0.0], [0.0, DT**2 / 2], [DT, 0.0], [0.0, DT]])
        self.Q = self.G @ self.G.T
        self.R = track.model.sigma_w**2


class Bootstrap(_Bare):
    """Bootstrap particle filter of ``n`` particles, with systematic resampling in every step."""

    def __init__(self, track: Track, n: int, rng: np.random.Generator) -> None:
        super().__init__(track)
        self.n, self.rng = n, rng
        self.x = track.prior.mean + rng.standard_normal((n, 4)) @ np.linalg.cholesky(track.prior.covariance).T
        self.covariance = track.prior.covariance

    def step(self, sensors: Array, bearings: Array) -> Array:
        """Propagate, weight, resample; particles are in rows, distances to one sensor in a contiguous column."""
        x = self.x @ self.F.T
        x += self.rng.standard_normal((self.n, 2)) @ self.G.T
        east = np.subtract(x[:, :1], sensors[:, 0], order="F")
        north = np.subtract(x[:, 1:2], sensors[:, 1], order="F")
        miss = _wrap(bearings - np.arctan2(east, north))
        weight = np.einsum("nk,nk->n", miss, miss)
        weight *= -0.5 / self.R
        weight -= weight.max()
        np.exp(weight, out=weight)
        weight /= weight.sum()
        mean: Array = weight @ x
        apart = x - mean
        self.covariance = (apart * weight[:, None]).T @ apart
        below = np.ceil(np.cumsum(weight) * self.n - self.rng.random())  # of the points (k + u) / n, up to each sum
        below[-1] = self.n
        self.x = x.repeat(np.diff(below, prepend=0.0).astype(np.intp), axis=0)
        return mean


class Ekf(_Bare):
    """``n`` extended Kalman filters, all bearings of a step in one update."""

    def __init__(self, track: Track, n: int) -> None:
        super().__init__(track)
        self.mean, self.P = np.tile(track.prior.mean, (n, 1)), np.tile(track.prior.covariance, (n, 1, 1))

    def step(self, sensors: Array, bearings: Array) -> Array:
        """The textbook form with the gain."""
        mean = self.mean @ self.F.T
        P = self.F @ self.P @ self.F.T + self.Q
        east, north = mean[:, :1] - sensors[:, 0], mean[:, 1:2] - sensors[:, 1]
        square = east * east + north * north
        H = np.zeros((*square.shape, 4))
        H[..., 0], H[..., 1] = north / square, -east / square
        HP = H @ P
        S = HP @ H.transpose(0, 2, 1) + self.R * np.eye(len(bearings))
        gain = np.linalg.solve(S, HP).transpose(0, 2, 1)
        miss = _wrap(bearings - np.arctan2(east, north))
        self.mean = mean + (gain @ miss[..., None])[..., 0]
        self.P = P - gain @ HP
        return self.mean


class Ukf(_Bare):
    """``n`` unscented Kalman filters with kappa = 1, all bearings of a step in one update."""

    def __init__(self, track: Track, n: int) -> None:
        super().__init__(track)
        self.mean, self.P = np.tile(track.prior.mean, (n, 1)), np.tile(track.prior.covariance, (n, 1, 1))
        self.weights = np.array([0.2, *[0.1] * 8])

    def step(self, sensors: Array, bearings: Array) -> Array:
        """The textbook form, with sigma points of the predicted belief."""
        mean = self.mean @ self.F.T
        P = self.F @ self.P @ self.F.T + self.Q
        axes = np.linalg.cholesky(5.0 * P).transpose(0, 2, 1)
        points = mean[:, None] + np.concatenate((np.zeros_like(axes[:, :1]), axes, -axes), axis=1)
        expected = np.arctan2(points[..., :1] - sensors[:, 0], points[..., 1:2] - sensors[:, 1])
        around = _wrap(expected - expected[:, :1])
        centre = self.weights @ around
        around -= centre[:, None]
        weighted = (self.weights[:, None] * around).transpose(0, 2, 1)
        S = weighted @ around + self.R * np.eye(len(bearings))
        C = weighted @ (points - mean[:, None])
        gain = np.linalg.solve(S, C).transpose(0, 2, 1)
        miss = _wrap(bearings - expected[:, 0] - centre)
        self.mean = mean + (gain @ miss[..., None])[..., 0]
        self.P = P - gain @ C
        return self.mean
