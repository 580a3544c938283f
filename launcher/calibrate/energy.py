"""``calibrate energy``: the kind of sensing ``energy``, fitted to one pass of a target on a known path.

y = g_i (S / d^alpha + noise), with the variance noise^2 + (relative S / d^alpha)^2. What is emitted, S, and the mean of
the gains cannot be told apart: gains are 1 in the geometric mean.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from math import exp, log
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.optimize import Bounds, minimize

from launcher.calibrate.intervals import blocks_of, jackknifed, raised
from launcher.calibrate.missing import fitted_missing, missing_share
from launcher.calibrate.outliers import regular
from launcher.calibrate.reports import Reports, reports_of
from launcher.calibrate.samples import Bools, Floats
from launcher.calibrate.sensors import SensorFit, own_table
from trackfield.errors import ScenarioError
from trackfield.sensing.energy import Energy

ASSUMED: Final = {"gain": 1.0, "floor_m": Energy.floor_m, "window_s": 0.0, "sound_m_s": 0.0}
ALPHAS: Final = (0.5, 20.0)
"""A scenario can have these."""
NOTE: Final = "What is emitted and the mean gain cannot be told apart: gains are 1 in the geometric mean."
_ALPHAS: Final = (*np.linspace(0.75, 4.0, 14).tolist(), 5.0, 7.0, 10.0, 15.0)
_RELATIVES: Final = (0.03, 0.1, 0.3, 0.7)
"""The fit starts from the likeliest of these: from far away it may end where one noise explains everything."""
_LEAST: Final = 1e-6
_APART: Final = 10.0
"""Gains that the fit starts from are at most so much from the mean: a sensor that heard noise only has none."""
_LEAST_LN: Final = log(1e-9)
_MOST_LN: Final = log(10.0)
"""The limits of ln(noise) and ln(relative), and the highest of the latter."""


def calibrate_energy(file: Path, sensors: Path) -> SensorFit:
    """The kind ``energy`` by this recording. Raises ``ScenarioError`` for files that cannot be used."""
    reports = reports_of([file], sensors)
    if float(reports.value.max()) <= 0.0:
        what = f"no report is above 0, the greatest is {reports.value.max():g}"
        raise ScenarioError(what, file=str(file), expected="energies of a target that passes")
    return fitted_energy(reports)


def fitted_energy(reports: Reports) -> SensorFit:
    """The kind by these reports, without outliers."""
    reports, outliers = regular(reports, lambda some: _Fitting(some).residual())
    fitting, count = _Fitting(reports), len(reports.ids)
    blocks = blocks_of(reports.recording, reports.t_s, 0.0)
    found = jackknifed(fitting.estimate, blocks.of)
    emitted, alpha, noise, relative, missing = found[:5]
    fitted = {"emitted": raised(emitted), "alpha": alpha}
    left = {"range_m": f"not fitted: reports came from as far as {reports.distance_m.max():.1f} m"}
    for key, one in (("noise", noise), ("relative", relative)):
        if one.value > _LEAST_LN / 2.0 and raised(one).high < exp(one.value) * 100.0:
            fitted[key] = raised(one)
        else:
            left[key] = f"cannot be told from 0 beside the other noise; about {exp(one.value):.2g}"
    gone, absent = fitted_missing(missing)
    left |= absent | dict.fromkeys(("emitted_sd", "emitted_walk"), "what is known of the next target, not of this one")
    return SensorFit(
        kind="energy",
        reports=reports,
        fitted=fitted | gone,
        assumed=dict(ASSUMED),
        left=left,
        own=("gains", own_table(reports, blocks, [raised(one) for one in found[5 : 5 + count]])),
        residual=fitting.residual(),
        unit="standard deviations",
        blocks=blocks,
        notes=(NOTE, outliers),
    )


class _Fitting:
    """What is estimated from any part of the reports, by greatest likelihood.

    Parameters (K + 3,): alpha, ln(S g) of each of K sensors, ln(noise), ln(relative).
    """

    def __init__(self, reports: Reports) -> None:
        self._reports, self._count = reports, len(reports.ids)
        self._ln_d: Floats = np.log(np.maximum(reports.distance_m, Energy.floor_m))
        everything = np.ones(len(reports.value), bool)
        starts = [self._start(*one) for one in product(_ALPHAS, self._noises(), _RELATIVES)]
        starts.sort(key=lambda one: self._unlikely(everything, one)[0])
        self._whole = self._fit(starts[0], everything)

    def _noises(self) -> Floats:
        """Noises of a plausible size, beside readings of the middle one's."""
        middle = float(np.median(np.abs(self._reports.value)))
        found: Floats = max(middle, _LEAST) * np.geomspace(1e-3, 1.0, 7)
        return found

    def _start(self, alpha: float, noise: float, relative: float) -> Floats:
        """With these, and the energy of each sensor by least squares, weighted by what its readings are."""
        y, sensor = self._reports.value, self._reports.sensor
        x, weight = np.exp(-alpha * self._ln_d), 1.0 / (noise**2 + np.square(relative * np.maximum(y, 0.0)))
        above, below = (np.bincount(sensor, weight * one, self._count) for one in (x * y, x * x))
        usual = max(float(above.sum() / below.sum()), _LEAST)
        level = np.log(np.clip(above / below, usual / _APART, usual * _APART))
        return np.concatenate([[alpha], level, np.log([noise, relative])])

    def _fit(self, start: Floats, some: Bools) -> Floats:
        """From there to the likeliest; TNC, as L-BFGS-B waits for its threads where others use the cores."""
        low, high = np.array([ALPHAS, *[(-50.0, 50.0)] * self._count, (_LEAST_LN, 50.0), (_LEAST_LN, _MOST_LN)]).T
        unlikely: Any = partial(self._unlikely, some)
        precise: Any = {"maxfun": 4000, "ftol": 1e-10, "gtol": 1e-8}
        best = minimize(unlikely, start, method="TNC", jac=True, bounds=Bounds(low, high), options=precise)
        return np.asarray(best.x, float)

    def _parts(self, parameters: Floats) -> tuple[Floats, Floats, Floats]:
        """The expected energy of each report, its sensor's gain, and what would be received with a gain of 1."""
        levels = parameters[1:-2]
        received = np.exp(levels.mean() - parameters[0] * self._ln_d)
        gain = np.exp(levels - levels.mean())[self._reports.sensor]
        return gain * received, gain, received

    def _unlikely(self, some: Bools, parameters: Floats) -> tuple[float, Floats]:
        """Minus the logarithm of the likelihood of some reports, and its derivatives."""
        mean, gain = (one[some] for one in self._parts(parameters)[:2])
        sensor, ln_d, count = self._reports.sensor[some], self._ln_d[some], self._count
        around, share = np.exp(2.0 * parameters[-2:])
        quiet, loud = np.square(gain) * around, share * np.square(mean)
        variance, off = quiet + loud, self._reports.value[some] - mean
        by_mean, by_variance = -off / variance * mean, (1.0 - np.square(off) / variance) / variance
        own = np.bincount(sensor, by_mean + by_variance * variance, count)
        every = float((by_variance * quiet).sum()) / count
        by_alpha = -float(((by_mean + by_variance * loud) * ln_d).sum())
        by_noises = (by_variance * quiet).sum(), (by_variance * loud).sum()
        total = 0.5 * float((np.square(off) / variance + np.log(variance)).sum())
        return total, np.concatenate([[by_alpha], own - every, by_noises])

    def residual(self) -> Floats:
        """What the fit to all reports leaves of each, in its standard deviation."""
        mean, gain, received = self._parts(self._whole)
        around, share = np.exp(self._whole[-2:])
        found: Floats = (self._reports.value - mean) / (gain * np.hypot(around, share * received))
        return found

    def estimate(self, some: Bools) -> list[float]:
        """By these reports (R,) alone: ln(emitted), alpha, ln(noise), ln(relative), missing and ln of the gains.

        Both noises are corrected for the number of parameters that were fitted.
        """
        found, count = self._fit(self._whole, some), int(some.sum())
        levels, wider = found[1:-2], 0.5 * log(count / max(count - len(found), 1))
        noise, relative = (found[-2:] + wider).tolist()
        missing = missing_share(self._reports, some)
        emitted = float(levels.mean())
        return [emitted, float(found[0]), noise, relative, missing, *(levels - emitted).tolist()]
