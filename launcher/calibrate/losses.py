"""Noise floor and bursts of losses, from the shares received on links of known RSSI.

On a link of RSSI r the share (1 - p) c(r - noise) is received: c is the radio's reception curve
(``trackfield.link.reception.cc2420``), p the share of the time in bursts (``trackfield.link.bursty``).
"""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from launcher.calibrate.samples import Bools, Floats, Samples
from trackfield.link.reception import cc2420

SURE: Final = 0.9999
"""A link is strong if this share of its frames is received by the curve: what it loses is lost in bursts."""
_SNR_DB: Final = np.arange(-15.0, 25.0, 0.01)
_MOST_S: Final = 1e7
_MOST_WINDOWS: Final = 50
"""Of longer series, the mean is as good as that of any longer one."""


def curve(snr_db: Floats, frame_bytes: int) -> Floats:
    """The share of frames received at these signal-to-noise ratios."""
    return np.interp(snr_db, _SNR_DB, _curve(frame_bytes))


@cache
def _curve(frame_bytes: int) -> Floats:
    return np.array([cc2420(float(snr), frame_bytes) for snr in _SNR_DB])


def noise_and_losses(rssi_dbm: Floats, pdr: Floats, windows: Floats, frame_bytes: int) -> tuple[float, float]:
    """The noise floor in dBm and the share p, from links (L,): least squares, each link by its number of windows."""
    weight = np.sqrt(windows)

    def off(parameters: Floats) -> Floats:
        noise, p = parameters
        return np.asarray(weight * ((1 - p) * curve(rssi_dbm - noise, frame_bytes) - pdr))

    middle = _SNR_DB[np.searchsorted(_curve(frame_bytes), 0.5)]
    starts = np.quantile(rssi_dbm, [0.0, 0.02, 0.05, 0.1, 0.2, 0.4]) - middle
    p = float(np.clip(1 - np.quantile(pdr, 0.75), 0.0, 0.9))
    first = min(starts, key=lambda noise: float(np.sum(off(np.array([noise, p])) ** 2)))
    best = least_squares(
        off, [first, p], bounds=([-250.0, 0.0], [50.0, 0.99]), x_scale=[1.0, 0.1], diff_step=[1e-4, 1e-4]
    )
    noise, p = best.x
    return float(noise), float(p)


class Swings(NamedTuple):
    """How the shares lost on strong links vary over time, as sums by link (L,).

    The windows of a link on one channel are a series. ``windows`` is their number, ``lost`` the sum of what they lost,
    ``square`` that of squares around the mean of the series, ``product`` that of products of successive windows around
    it, ``follow`` the number of these. A series has ``length`` windows, ``apart_s`` apart, of ``frames`` frames, one
    every ``frame_s``.
    """

    windows: Floats
    lost: Floats
    square: Floats
    follow: Floats
    product: Floats
    length: int
    apart_s: float
    frames: int
    frame_s: float


def swings(samples: Samples, strong: Bools) -> Swings:
    """Of the links that are ``strong`` (L,); 0 for all others.

    What a link loses on a channel all the time is no burst, so it does not count here. A recording with one window of
    each link on each channel does not tell the two apart; there, a series is what a link has on all channels.
    """
    link, n = samples.links.of_window, len(strong)
    _, series = np.unique(link * (samples.channel.max() + 1) + samples.channel, return_inverse=True)
    if len(link) < 2 * (series.max() + 1):
        series = link
    order = np.lexsort((samples.at_s, series))
    link, series, at_s = link[order], series[order], samples.at_s[order]
    use, lost = strong[link], 1 - samples.pdr[order]
    size = np.bincount(series)
    off = lost - (np.bincount(series, lost) / size)[series]
    next_too = series[1:] == series[:-1]
    gaps = np.diff(at_s)[next_too]
    windows, lost_, square, follow, product = (
        np.bincount(at, values, n).astype(np.float64)
        for at, values in (
            (link, 1.0 * use),
            (link, use * lost),
            (link, use * off**2),
            (link[1:], 1.0 * (use[1:] & next_too)),
            (link[1:], use[1:] * next_too * off[1:] * off[:-1]),
        )
    )
    apart_s = float(np.median(gaps)) if len(gaps) else np.inf
    length = int(np.median(size))
    return Swings(windows, lost_, square, follow, product, length, apart_s, samples.frames, samples.frame_s)


def burst_s(swings: Swings, some: Bools) -> float:
    """The mean length of bursts, from ``some`` of the links (L,); NaN if there are no losses, or no series.

    A link is bad for exponential times, so that whether it is bad at two instants t apart has the covariance
    p (1 - p) exp(-t / tau), with tau = burst_s (1 - p). From that follow the variance within a series and the
    covariance of successive windows; tau is where both are nearest to what is observed.
    """
    windows, lost, square, follow, product = (float(one[some].sum()) for one in swings[:5])
    p = lost / windows if windows else 0.0
    if not 0 < p < 1 or not follow:
        return float("nan")
    observed = np.array([square / windows, product / follow]) / (p * (1 - p))

    def off(ln_tau: float) -> float:
        return float(np.sum((_variation(float(np.exp(ln_tau)), swings) - observed) ** 2))

    grid = np.linspace(np.log(swings.frame_s / 100), np.log(_MOST_S), 200)
    at = int(np.argmin([off(one) for one in grid]))
    best = minimize_scalar(off, bounds=(grid[max(at - 1, 0)], grid[min(at + 1, 199)]), method="bounded")
    return float(np.exp(best.x)) / (1 - p)


def _variation(tau: float, swings: Swings) -> Floats:
    """(2,) The variance within a series and the covariance of its successive windows, as parts of p (1 - p)."""
    n, frame_s, length = swings.frames, swings.frame_s, min(swings.length, _MOST_WINDOWS)
    k = np.arange(n)
    window = 1 / n + 2 / n**2 * float(np.sum((n - k[1:]) * np.exp(-k[1:] * frame_s / tau)))
    ends = float(np.mean(np.exp(-k * frame_s / tau)))  # of the instants of a window with its first one, or its last
    between = np.arange(length) * swings.apart_s - (n - 1) * frame_s
    lags = np.where(np.arange(length), ends**2 * np.exp(-np.maximum(between, 0) / tau), window)
    covariance = lags[np.abs(np.subtract.outer(np.arange(length), np.arange(length)))]
    centred = covariance - covariance.mean(axis=0) - covariance.mean(axis=1)[:, None] + covariance.mean()
    return np.array([np.trace(centred) / length, np.mean(np.diag(centred, 1))])
