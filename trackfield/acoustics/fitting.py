"""The curve of a pass in the energies of a recording, by maximum likelihood.

A source of constant power that goes past a microphone in a straight line is heard with the power A / (1 + u^2) + B:
A is that at the closest point of approach, t0 when it is heard, w = d / v the time in which the source goes as far as
its distance there, B the noise, and u = (t' - t0) / w, where t' = t - M (sqrt(w^2 + (t - t0)^2) - w). For what arrives
from farther away, earlier or later, has come longer: without this term the middle of the curve would be late by about
0.7 M w. Its Mach number M is set to 0.04, as at 50 km/h.

Mean squares over 20 ms spread about the curve in proportion to it, as gamma variates do.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, TypeVar

import numpy as np

from trackfield.filters.types import Array

T = TypeVar("T", float, Array)

BIN_S: Final = 0.02
"""Energies are mean squares over so long."""
_SMOOTHED: Final = 20
"""Bins over which residuals are averaged: 0.4 s."""
_NEAR_WIDTHS: Final = 1.5
_MACH: Final = 0.04
_ROUNDS: Final = 30
_SETTLED: Final = 1e-3
_STIFFEST: Final = 1e8


class Curve(NamedTuple):
    """A pass: when its closest point is heard (s), its ``width_s`` w, and the powers A and B."""

    peak_s: float
    width_s: float
    power: float
    floor: float

    def at(self, t_s: T) -> T:
        """The power of the pass, without the noise, at a time or (n,) times."""
        u = (t_s - self.peak_s) / self.width_s
        power: T = self.power / (1.0 + (u - _MACH * ((1.0 + u * u) ** 0.5 - 1.0)) ** 2)
        return power


class Fit(NamedTuple):
    """A curve fitted to energies, and how well.

    ``time_sd_s`` and ``power_sd`` (relative) follow from the curvature of the likelihood and from how the energies
    spread about the curve. ``gain`` is by how much the logarithm of the likelihood exceeds that of a constant power,
    ``residual_db`` the largest deviation of the energies from the curve, both smoothed over 0.4 s, within a width and a
    half of the peak: what is heard farther away may be something else; ``explained``
    (0 to 1) the share of the variance of the smoothed levels that the curve explains.
    """

    curve: Curve
    time_sd_s: float
    power_sd: float
    gain: float
    residual_db: float
    explained: float


def smoothed(energies: Array, bins: int = _SMOOTHED) -> Array:
    """(n - bins + 1,) running means of (n,) energies."""
    sums = np.cumsum(np.concatenate(([0.0], energies)))
    return np.asarray((sums[bins:] - sums[:-bins]) / bins)


def fitted(t_s: Array, energies: Array, known: Array, first: Curve) -> Fit | None:
    """The curve that is likeliest to have given ``energies`` (n,) at ``t_s`` (n,), found from the curve ``first``.

    ``known`` (n,) is power of other origin, which the curve adds to. Fisher's scoring of t0 and the logarithms of w, A
    and B, damped after Levenberg and Marquardt. None if it finds none.
    """
    found = _scored(t_s, energies, known, first)
    if found is None:
        return None
    theta, slopes, loss = found
    curve = _curve(theta)
    mean = curve.at(t_s) + curve.floor + known
    spread = energies / mean - 1.0
    smooth = smoothed(spread)
    dispersion = float(np.square(spread).sum()) / (len(t_s) - 4)
    correlated = max(dispersion, _SMOOTHED * float(np.square(smooth).mean()))
    try:
        variances = correlated * np.diag(np.linalg.inv(slopes.T @ slopes))
    except np.linalg.LinAlgError:
        return None
    if not (variances > 0.0).all():
        return None
    constant = known + max(float((energies - known).mean()), _TINY)
    null = _loss(energies, constant)
    heard, told = (10.0 * np.log10(smoothed(part) + _TINY) for part in (energies, mean))
    near = np.abs(smoothed(t_s) - curve.peak_s) < _NEAR_WIDTHS * curve.width_s
    return Fit(
        curve,
        math.sqrt(variances[0]),
        math.sqrt(variances[2]),
        (null - loss) / max(dispersion, _TINY),
        float(np.abs(heard - told)[near].max(initial=0.0)),
        max(0.0, 1.0 - float(np.square(heard - told).sum() / max(np.square(heard - heard.mean()).sum(), _TINY))),
    )


def _loss(energies: Array, mean: Array) -> float:
    """Minus the logarithm of the likelihood of mean squares, but for what depends on them alone."""
    return float((np.log(mean) + energies / mean).sum())


def _scored(t_s: Array, energies: Array, known: Array, first: Curve) -> tuple[Array, Array, float] | None:
    """The parameters (t0, log w, log A, log B), the relative slopes (n, 4) of the curve to them, the loss."""
    theta = np.array([first.peak_s, *np.log(np.maximum(first[1:], _TINY))])
    loss, slopes, spread = _looked(theta, t_s, energies, known)
    stiff = 1e-2
    for _ in range(_ROUNDS):
        square, pull = slopes.T @ slopes, slopes.T @ spread
        while stiff < _STIFFEST:
            step = np.linalg.solve(square + stiff * np.diag(np.diag(square)) + 1e-12 * np.eye(4), pull)
            newer = theta + np.clip(step, -1.0, 1.0)
            looked = _looked(newer, t_s, energies, known)
            if looked[0] <= loss:
                break
            stiff *= 4.0
        else:
            break
        gained, stiff = loss - looked[0], stiff / 4.0
        theta, (loss, slopes, spread) = newer, looked
        if gained < _SETTLED:
            break
    return (theta, slopes, loss) if np.isfinite(loss) and np.isfinite(theta).all() else None


def _looked(theta: Array, t_s: Array, energies: Array, known: Array) -> tuple[float, Array, Array]:
    """Minus the logarithm of the likelihood but for constants, (n, 4) relative slopes, (n,) relative residuals."""
    width, power, floor = np.exp(np.clip(theta[1:], -80.0, 80.0))
    u = (t_s - theta[0]) / width
    root = np.sqrt(1.0 + u * u)
    left = u - _MACH * (root - 1.0)
    shape = 1.0 / (1.0 + left * left)
    alone = power * shape
    mean = alone + floor + known
    steep = alone * shape * 2.0 * left * (1.0 - _MACH * u / root)
    slopes = np.stack((steep / width, steep * u, alone, np.full(len(u), floor)), axis=1)
    return _loss(energies, mean), slopes / mean[:, None], energies / mean - 1.0


def _curve(theta: Array) -> Curve:
    width, power, floor = np.exp(np.clip(theta[1:], -80.0, 80.0))
    return Curve(float(theta[0]), float(width), float(power), float(floor))


_TINY: Final = 1e-30
