"""A position from the bearings of one instant: the maximum a posteriori (MAP) point by Gauss-Newton.

With x = m + L u and P = L L^T, the MAP point minimises |u|^2 / 2 + |wrap(z - h(x))|^2 / (2 sigma_w^2). Its
normal matrix I + J^T J is never singular, even where P is, and its inverse gives the covariance. Next to a sensor
J is so large that I would be lost in rounding, so J stacked on I is factorised instead of their product.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import NamedTuple

import numpy as np

from trackfield.filters.gate import CLUTTER, Indices, Story, likeliest
from trackfield.filters.gaussian import extent, root, symmetric
from trackfield.filters.types import Array, Gaussian, Reports, Update
from trackfield.models import doa
from trackfield.models.doa import wrap

_STEPS = 30
_SETTLED = 1e-9  # of the prior's sd
_SUSPECTS = 8


class _Point(NamedTuple):
    u: Array
    misses: Array
    cost: float


def intensity_weights(levels: Array) -> Array:
    """Each sensor's share (..., K) in the received power, from levels in dB (Zhai et al. 2009, sec. III-A)."""
    power: Array = np.exp((levels - levels.max(axis=-1, keepdims=True)) * (log(10.0) / 10.0))
    power /= power.sum(axis=-1, keepdims=True)
    return power


def centroid(reports: Reports) -> Array:
    """Intensity-weighted centroid (2,) of the reporting sensors."""
    centre: Array = intensity_weights(reports.levels) @ reports.positions
    return centre


def first_fix(reports: Reports, sigma_w: float, anywhere: Array) -> Gaussian | None:
    """The belief from the bearings of one step alone, or None if their geometry does not give one.

    ``anywhere`` (4, 4) is the covariance over (x, y, vx, vy) without information.
    """
    if len(reports) < 2:
        return None
    prior = Gaussian(np.append(centroid(reports), [0.0, 0.0]), anywhere)
    return certain_fix(prior, reports.only(agreeing(prior, reports, sigma_w).believed), sigma_w)


def map_fix(prior: Gaussian, reports: Reports, sigma_w: float) -> Update:
    """The belief after ``prior`` over (x, y, vx, vy) and the bearings of ``reports`` (at least one).

    Gauss-Newton from the intensity-weighted centroid and from the prior's mean; the better result counts. A single
    bearing has no slope at the centroid, which is its sensor, and a wrong prior is a bad start. Covariance and
    evidence are Laplace's approximation there.
    """
    L, eye = root(prior.covariance), np.eye(prior.mean.shape[-1])
    bearings, positions = reports.bearings, reports.positions

    def at(u: Array) -> _Point:
        misses = wrap(bearings - doa.measure(prior.mean + L @ u, positions)) / sigma_w
        return _Point(u, misses, float(u @ u + misses @ misses))

    def slopes(u: Array) -> Array:
        return doa.jacobian(prior.mean + L @ u, positions) @ (L / sigma_w)

    def descend(point: _Point) -> _Point:
        for _ in range(_STEPS):
            J = slopes(point.u)
            step = np.linalg.lstsq(np.vstack((J, eye)), np.append(point.misses, -point.u))[0]
            better = next((p for k in range(10) if (p := at(point.u + step / 2**k)).cost < point.cost), None)
            if better is None or np.abs(better.u - point.u).max() < _SETTLED:
                return better or point
            point = better
        return point

    # the likeliest state of the prior whose position is the centroid
    there = np.linalg.pinv(L[:2]) @ (centroid(reports) - prior.mean[:2])
    best = min((descend(at(u)) for u in (there, np.zeros(len(eye)))), key=lambda point: point.cost)
    mean = prior.mean + L @ best.u
    J = slopes(best.u) * _trust(slopes(best.u), L, mean[:2] - positions)[:, None]
    normal = eye + J.T @ J
    scale = len(reports) * np.log(2.0 * np.pi * sigma_w**2)
    log_evidence = -0.5 * (best.cost + np.linalg.slogdet(normal)[1] + scale)
    return Update(Gaussian(mean, symmetric(L @ np.linalg.solve(normal, L.T))), log_evidence)


def certain_fix(prior: Gaussian, reports: Reports, sigma_w: float) -> Gaussian | None:
    """The belief after these bearings, or None if they do not determine the position, as a single one never does.

    The sd of a fix must be below half the (rms) distance to its sensors: beyond that, bearings are no longer nearly
    linear in the position and the covariance is not valid.
    """
    if len(reports) < 2:
        return None
    fix, _ = map_fix(prior, reports, sigma_w)
    distance = np.sqrt(np.square(fix.mean[:2] - reports.positions).sum(axis=1).mean())
    return fix if extent(fix.covariance) < distance / 2.0 else None


@dataclass(frozen=True)
class _Fixes:
    """Evidence of bearings for the fix that they give. Of many outliers, only the ``_SUSPECTS`` worst are tried."""

    prior: Gaussian
    reports: Reports
    sigma_w: float

    def evidence(self, which: Indices) -> float:
        return float(map_fix(self.prior, self.reports.only(which), self.sigma_w).log_evidence)

    def without(self, which: Indices) -> Array:
        these = self.reports.only(which)
        place = map_fix(self.prior, these, self.sigma_w).posterior.mean
        misses = np.abs(wrap(these.bearings - doa.measure(place, these.positions)))
        evidence = np.full(len(which), -np.inf)
        for k in np.argsort(-misses)[:_SUSPECTS]:
            if misses[k] > self.sigma_w:
                evidence[k] = self.evidence(np.delete(which, k)) if len(which) > 1 else 0.0
        return evidence


def agreeing(prior: Gaussian, reports: Reports, sigma_w: float, clutter: Array | float = CLUTTER) -> Story:
    """Which bearings to fix a position from; ``clutter`` (K,) is the probability that a bearing is clutter."""
    return likeliest(np.broadcast_to(clutter, len(reports)), _Fixes(prior, reports, sigma_w))


def _trust(J: Array, L: Array, apart: Array) -> Array:
    """Factors (K,) for each bearing's slope, averaged over the region where the target may be.

    The slope falls as 1/r with the distance r to the sensor. Over a region of extent s it counts as
    r / (r^2 + s^2): otherwise a fix next to a sensor would have an sd of millimetres.
    """
    _, R = np.linalg.qr(np.vstack((J, np.eye(J.shape[1]))))  # R^T R = I + J^T J
    region = np.square(np.linalg.solve(R.T, L[:2].T)).sum()
    square = np.square(apart).sum(axis=-1)
    share: Array = square / (square + region)
    return share
