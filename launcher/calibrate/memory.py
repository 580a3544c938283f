"""Correlation in time: how much of a noise's variance changes slowly, and how slowly (``trackfield.models.noise``)."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from launcher.calibrate.reports import Reports
from launcher.calibrate.samples import Bools, Floats, Ints
from trackfield.world.recording import APART_S

MOST_LAGS: Final = 100
"""Times between two reports that are told apart, in steps of that between two successive ones."""
_TRIED: Final = 60
_FINE: Final = 2000


def common(lag: Floats) -> Floats:
    """The correlation of what is slow in two readings, ``lag`` times ``slow_s`` apart.

    A slow draw is (1 - p) a + p b over its size, with independent a and b ``slow_s`` apart (``Placed``), which begin
    anywhere: this is the mean over p in [0, 1).
    """
    table = _common()
    return np.interp(np.abs(lag), np.linspace(0.0, 2.0, len(table)), table, right=0.0)


@cache
def _common() -> Floats:
    p = (np.arange(_FINE) + 0.5) / _FINE
    table = np.empty(2 * 100 + 1)
    for i, lag in enumerate(np.linspace(0.0, 2.0, len(table))):
        whole, q = np.divmod(p + lag, 1.0)
        same, following = (1.0 - p) * (1.0 - q) + p * q, p * (1.0 - q)
        size = np.hypot(1.0 - p, p) * np.hypot(1.0 - q, q)
        table[i] = (np.where(whole == 0, same, np.where(whole == 1, following, 0.0)) / size).mean()
    return table


class Memory:
    """The pairs of reports of one sensor in one recording, by how far they are apart in time."""

    def __init__(self, reports: Reports) -> None:
        self._sensor, self._count = reports.sensor, len(reports.ids)
        order = np.lexsort((reports.t_s, reports.sensor, reports.recording))
        series = (reports.recording * self._count + reports.sensor)[order]
        t_s = reports.t_s[order]
        gaps = np.diff(t_s)[(np.diff(series) == 0) & (np.diff(t_s) >= APART_S)]
        self.every_s = float(np.median(gaps)) if len(gaps) else APART_S
        longest_s = max(float(np.ptp(t_s[series == one])) for one in np.unique(series))
        self._lags = max(min(MOST_LAGS, int(longest_s / 2.0 / self.every_s)), 2)
        self.first, self.second, lag_s = self._pairs(order, series, t_s)
        self._bin: Ints = np.rint(lag_s / self.every_s).astype(np.int64)
        count = np.bincount(self._bin, minlength=self._lags + 1)
        self._lag_s = np.bincount(self._bin, lag_s, self._lags + 1) / np.maximum(count, 1)

    def _pairs(self, order: Ints, series: Ints, t_s: Floats) -> tuple[Ints, Ints, Floats]:
        """Both reports of each pair, and the time between them, up to the longest that is looked at."""
        found, most_s = [(order[:0], order[:0], t_s[:0])], (self._lags + 0.49) * self.every_s
        for shift in range(1, len(t_s)):
            lag_s = t_s[shift:] - t_s[:-shift]
            near = np.flatnonzero((series[shift:] == series[:-shift]) & (lag_s <= most_s))
            if not len(near):
                break
            found.append((order[near], order[near + shift], lag_s[near]))
        first, second, lags = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return first, second, lags

    @property
    def longest_s(self) -> float:
        """The longest ``slow_s`` that can be told: of pairs twice as far apart nothing is in common."""
        return float(self._lags * self.every_s / 2.0)

    def correlations(self, residual: Floats) -> tuple[Floats, Floats]:
        """The times between reports (s), and the correlation of their residuals (R,): what a fit goes through."""
        a, b = residual[self.first], residual[self.second]
        count = np.maximum(np.bincount(self._bin, minlength=self._lags + 1), 1)
        return self._lag_s, np.bincount(self._bin, a * b, self._lags + 1) / count / np.square(residual).mean()

    def fit(self, residual: Floats, some: Bools) -> tuple[float, float, float]:
        """The variance of the noise, the slow share of it, and ``slow_s``, by the residuals (R,) of some reports.

        Least squares on the mean products of residuals by lag, weighted by their number, with those that the model
        would have. A residual is off by what its sensor's mean noise is, as an offset was fitted to it: so products
        are lower in the mean by the variance of that mean, which the model has, too.
        """
        both = some[self.first] & some[self.second]
        lag, of = self._bin[both], self._sensor[self.first[both]]
        product = residual[self.first[both]] * residual[self.second[both]]
        own = np.bincount(self._sensor[some], minlength=self._count).astype(float)
        size = self._lags + 1
        pairs = np.bincount(of * size + lag, minlength=self._count * size).reshape(self._count, size).astype(float)
        products = np.bincount(lag, product, size) / np.maximum(pairs.sum(axis=0), 1.0)
        seen = np.concatenate([[np.square(residual[some]).mean()], products])
        weight = np.sqrt(np.concatenate([[own.sum()], pairs.sum(axis=0)]))
        shares = np.vstack([own / own.sum(), (pairs / np.maximum(pairs.sum(axis=0), 1.0)).T])
        square = np.maximum(own, 1.0) ** 2

        def solved(ln_s: float) -> tuple[float, Floats]:
            """The sum of squares, and (white, slow) variances."""
            slow = common(self._lag_s / np.exp(ln_s))
            of_mean = np.stack([own / square, (own + 2.0 * pairs @ slow) / square], axis=1)
            model = np.stack([np.zeros(len(seen)), np.concatenate([[1.0], slow])], axis=1)
            model[0, 0] = 1.0
            model = (model - shares @ of_mean) * weight[:, None]
            return _nonnegative(model, seen * weight)

        tried = np.linspace(np.log(self.every_s / 2.0), np.log(self.longest_s), _TRIED)
        best = int(np.argmin([solved(one)[0] for one in tried]))
        ends = tried[max(best - 1, 0)], tried[min(best + 1, _TRIED - 1)]
        ln_s = float(minimize_scalar(lambda one: solved(one)[0], bounds=ends, method="bounded").x)
        white, slow = solved(ln_s)[1]
        return float(white + slow), float(slow / (white + slow)), float(np.exp(ln_s))


def _nonnegative(model: Floats, seen: Floats) -> tuple[float, Floats]:
    found, off = nnls(model, seen)
    return float(off), found
