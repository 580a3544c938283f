"""A position from the readings of one instant: the maximum a posteriori (MAP) point by Gauss-Newton.

With x = m + L u and P = L L^T, the MAP point minimises |u|^2 / 2 + |z - h(x)|^2 / (2 R). Its normal matrix I + J^T J is
never singular, even where P is, and its inverse gives the covariance. Next to a sensor J is so large that I would be
lost in rounding, so J stacked on I is factorised instead of their product.

Where the noise depends on the state, log R belongs to the cost, and each number z gives a second row: with the slope g
of log R, g / sqrt(2) against (e^2 / R - 1) / sqrt(2). That makes a step one of Fisher's scoring (Kay 1993, eqs. 3.31
and 7.42).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from trackfield.filters.gate import CLUTTER, Indices, Story, left_out, likeliest
from trackfield.filters.gaussian import extent, root, symmetric
from trackfield.filters.measurement import (
    innovations,
    jacobians,
    log_anywhere,
    log_noise_slopes,
    noise_sd,
    owners,
    problem,
    shares,
    varies,
)
from trackfield.filters.types import Array, Gaussian, Model, Reports, Update

_STEPS = 30
_SETTLED = 1e-9  # of the prior's sd
_GAINED = 1e-6  # of the log likelihood, twice: where the noise depends on the state the last steps are many and small
_SUSPECTS = 8


class _Point(NamedTuple):
    """A state ``x`` (n,), ``u`` in units of the prior; what it leaves of each number, in sds of its noise; its cost."""

    u: Array
    x: Array
    misses: Array
    cost: float


def centroid(model: Model, reports: Reports) -> Array:
    """Centroid (2,) of the reporting sensors, weighted by how loud they are."""
    centre: Array = shares(model, reports) @ reports.positions
    return centre


def first_fix(reports: Reports, model: Model, anywhere: Array) -> Gaussian | None:
    """The belief from the readings of one step alone, or None if their geometry does not give one.

    ``anywhere`` (4, 4) is the covariance over (x, y, vx, vy) without information.
    """
    if len(reports) < enough(model, reports):
        return None
    prior = Gaussian(np.append(centroid(model, reports), [0.0, 0.0]), anywhere)
    return certain_fix(prior, reports.only(agreeing(prior, reports, model).believed), model)


def map_fix(prior: Gaussian, reports: Reports, model: Model) -> Update:
    """The belief after ``prior`` over (4 + u,) and the readings of ``reports`` (at least one).

    Gauss-Newton from the weighted centroid of the sensors and from the prior's mean; the better result counts. A single
    bearing has no slope at the centroid, which is its sensor, and a wrong prior is a bad start. Covariance and
    evidence are Laplace's approximation there.
    """
    least = _Problem(prior, reports, model)
    # the likeliest state of the prior whose position is the centroid
    there = np.linalg.pinv(least.L[:2]) @ (centroid(model, reports) - prior.mean[:2])
    starts = (there, np.zeros(len(prior.mean)))
    best = min((least.descend(least.at(u)) for u in starts), key=lambda point: point.cost)
    J = least.slopes(best.x)
    J = J * least.trust(J, best)[:, None]
    normal = np.eye(len(prior.mean)) + J.T @ J
    scale = len(least.sd) * np.log(2.0 * np.pi * least.unit**2)
    log_evidence = -0.5 * (best.cost + np.linalg.slogdet(normal)[1] + scale)
    covariance = symmetric(least.L @ np.linalg.solve(normal, least.L.T))
    return Update(Gaussian(best.x, covariance), log_evidence)


def enough(model: Model, reports: Reports) -> int:
    """How many reports may determine a position: as many as the most demanding kind among them takes."""
    return max((model.kinds[one.kind].fix_sensors for one in reports.readings if len(one.values)), default=1)


def certain_fix(prior: Gaussian, reports: Reports, model: Model) -> Gaussian | None:
    """The belief after these readings, or None if they do not determine the position, as a single bearing never does.

    The sd of a fix must be below half the (rms) distance to its sensors: beyond that, readings are no longer nearly
    linear in the position and the covariance is not valid.
    """
    if len(reports) < enough(model, reports):
        return None
    fix, _ = map_fix(prior, reports, model)
    distance = np.sqrt(np.square(fix.mean[:2] - reports.positions).sum(axis=1).mean())
    return fix if extent(fix.covariance) < distance / 2.0 else None


class _Problem:
    """Least squares over u, the state in units of the prior."""

    def __init__(self, prior: Gaussian, reports: Reports, model: Model) -> None:
        self.prior, self.reports, self.model = prior, reports, model
        self.L = root(prior.covariance)
        self.z, self.measure, self.residual = problem(model, reports)
        self.scoring = varies(model)
        self.sd = noise_sd(model, reports, prior.mean)
        """(K m,) at the prior's mean, and everywhere without ``scoring``."""
        self.unit = float(self.sd[0])
        self.even = not self.scoring and bool((self.sd == self.unit).all())
        self.scaled = self.L / self.unit

    def at(self, u: Array) -> _Point:
        x = self.prior.mean + self.L @ u
        if self.even:
            misses = self.residual(self.z - self.measure(x)) / self.sd
            return _Point(u, x, misses, float(u @ u + misses @ misses))
        with np.errstate(over="ignore", invalid="ignore"):  # a step too long is shortened
            sd = self._sd(x)
            misses = self.residual(self.z - self.measure(x)) / sd
            cost = float(u @ u + misses @ misses) + 2.0 * float(np.log(sd / self.unit).sum())
        return _Point(u, x, misses, cost)

    def slopes(self, x: Array) -> Array:
        """J (rows, n): of all numbers and, where the noise depends on the state, of its logarithm below them."""
        J: Array = jacobians(self.model, x, self.reports) @ self.scaled
        if not self.even:
            J = J * (self.unit / self._sd(x))[:, None]
        if self.scoring:
            J = np.concatenate((J, log_noise_slopes(self.model, x, self.reports) @ self.L / sqrt(2.0)))
        return J

    def descend(self, point: _Point) -> _Point:
        eye = np.eye(len(point.u))
        for _ in range(_STEPS):
            rows = [point.misses, -point.u]
            if self.scoring:
                rows.insert(1, (np.square(point.misses) - 1.0) / sqrt(2.0))
            step = np.linalg.lstsq(np.concatenate((self.slopes(point.x), eye)), np.concatenate(rows))[0]
            better = next((p for k in range(10) if (p := self.at(point.u + step / 2**k)).cost < point.cost), None)
            if better is None or np.abs(better.u - point.u).max() < _SETTLED:
                return better or point
            if self.scoring and point.cost - better.cost < _GAINED:
                return better
            point = better
        return point

    def trust(self, J: Array, point: _Point) -> Array:
        """Factors (rows,) for each slope, averaged over the region where the target may be.

        The slope of a bearing or a level falls as 1/r with the distance r to the sensor. Over a region of extent s it
        counts as r / (r^2 + s^2): otherwise a fix next to a sensor would have an sd of millimetres. That of a range
        turns round there, and is taken for as uncertain.
        """
        _, R = np.linalg.qr(np.concatenate((J, np.eye(J.shape[1]))))  # R^T R = I + J^T J
        region = np.square(np.linalg.solve(R.T, self.L[:2].T)).sum()
        apart = point.x[:2] - self.reports.positions[owners(self.model, self.reports)]
        square = np.square(apart).sum(axis=-1)
        share: Array = square / (square + region)
        return np.tile(share, len(J) // len(share))

    def _sd(self, x: Array) -> Array:
        return noise_sd(self.model, self.reports, x) if self.scoring else self.sd


@dataclass(frozen=True)
class _Fixes:
    """Evidence of readings for the fix that they give. Of many outliers, only the ``_SUSPECTS`` worst are tried."""

    prior: Gaussian
    reports: Reports
    model: Model

    def evidence(self, which: Indices) -> float:
        return float(map_fix(self.prior, self.reports.only(which), self.model).log_evidence)

    def without(self, which: Indices) -> Array:
        these = self.reports.only(which)
        place = map_fix(self.prior, these, self.model).posterior.mean
        sds = np.abs(innovations(self.model, place, these)) / noise_sd(self.model, these, place)
        misses = np.zeros(len(which))
        np.maximum.at(misses, owners(self.model, these), sds)
        evidence = np.full(len(which), -np.inf)
        for k in np.argsort(-misses)[:_SUSPECTS]:
            if misses[k] > 1.0:
                evidence[k] = self.evidence(np.delete(which, k)) if len(which) > 1 else 0.0
        return evidence


def agreeing(prior: Gaussian, reports: Reports, model: Model, clutter: Array | float = CLUTTER) -> Story:
    """Which readings to fix a position from; ``clutter`` (K,) is the probability that a reading is clutter."""
    return likeliest(left_out(clutter, log_anywhere(model, reports)), _Fixes(prior, reports, model))
