"""``calibrate rss``: the kind of sensing ``rss``, fitted to recorded reports of a target whose path is known.

z = level - 10 n log10(d) + offset of the sensor + noise, by least squares. Distances are those on the ground, as in the
kind. The offsets are what is a sensor's own for good, and 0 in the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, log, sqrt
from pathlib import Path
from typing import Final

import numpy as np

from launcher.calibrate.intervals import Fitted, blocks_of, jackknifed, raised
from launcher.calibrate.memory import Memory
from launcher.calibrate.missing import fitted_missing, missing_share
from launcher.calibrate.outliers import regular
from launcher.calibrate.reports import Reports, reports_of
from launcher.calibrate.samples import Bools, Floats
from launcher.calibrate.sensors import SensorFit, own_table
from trackfield.sensing.rss import Rss

FLOOR_M: Final = Rss.floor_m
"""Assumed: nearer than this the level is as there."""
_TINY: Final = 1e-12
FIXED: Final = "0: what is a sensor's own for good are the offsets"


def calibrate_rss(files: Sequence[Path], sensors: Path) -> SensorFit:
    """The kind ``rss`` by these recordings. Raises ``ScenarioError`` for files that cannot be used."""
    return fitted_rss(reports_of(files, sensors))


def fitted_rss(reports: Reports) -> SensorFit:
    """The kind by these reports, without outliers."""
    reports, outliers = regular(reports, lambda some: _Fitting(some).residual(np.ones(len(some.value), bool)))
    fitting, count = _Fitting(reports), len(reports.ids)
    everything = np.ones(len(reports.value), bool)
    first = fitting.estimate(everything)
    slow_s = float(np.exp(first[4]))
    blocks = blocks_of(reports.recording, reports.t_s, 2.0 * slow_s)
    found = jackknifed(fitting.estimate, blocks.of)
    level, exponent, sd, slow, ln_slow_s, missing = found[:6]
    fitted = {"level_dbm": level, "exponent": exponent, "shadow_sd_db": sd}
    left = {"range_m": f"not fitted: reports came from as far as {reports.distance_m.max():.1f} m"}
    memory, why = _memory(slow, raised(ln_slow_s), fitting.memory)
    gone, absent = fitted_missing(missing)
    own = ("offsets", own_table(reports, blocks, found[6 : 6 + count]))
    residual = fitting.residual(everything)
    return SensorFit(
        kind="rss",
        reports=reports,
        fitted=fitted | memory | gone,
        assumed={"floor_m": FLOOR_M},
        left=left | why | absent | {"fixed": FIXED},
        own=own,
        residual=residual,
        unit="dB",
        blocks=blocks,
        notes=("The offsets are 0 in the mean.", outliers),
    )


def _memory(slow: Fitted, slow_s: Fitted, memory: Memory) -> tuple[dict[str, Fitted], dict[str, str]]:
    if slow.low <= 0.0 or not isfinite(slow_s.high):
        why = f"no correlation in time found: slow is {max(slow.low, 0.0):.2g} to {min(slow.high, 1.0):.2g}"
        return {}, dict.fromkeys(("slow", "slow_s"), why)
    if slow_s.value > 0.99 * memory.longest_s:
        why = (
            f"{slow.value:.2g} of the variance is slower than the {memory.longest_s:.0f} s that the recordings can show"
        )
        return {}, dict.fromkeys(("slow", "slow_s"), why)
    return {"slow": Fitted(slow.value, slow.low, min(slow.high, 1.0)), "slow_s": slow_s}, {}


class _Fitting:
    """What is estimated from any part of the reports."""

    def __init__(self, reports: Reports) -> None:
        self._reports, self.memory = reports, Memory(reports)
        self._decades: Floats = -10.0 * np.log10(np.maximum(reports.distance_m, FLOOR_M))
        self._whole: tuple[float, Floats] = (0.0, np.zeros(len(reports.ids)))
        self._whole = self._line(np.ones(len(reports.value), bool))

    def _line(self, some: Bools) -> tuple[float, Floats]:
        """The exponent, and the level of each sensor; of one without a report that of all reports."""
        of = self._reports.sensor[some]
        count = np.bincount(of, minlength=len(self._reports.ids))
        x, z = self._decades[some], self._reports.value[some]
        mean_x, mean_z = (np.bincount(of, one, len(count)) / np.maximum(count, 1) for one in (x, z))
        apart = x - mean_x[of]
        exponent = float(apart @ (z - mean_z[of])) / max(float(apart @ apart), _TINY)
        return exponent, np.where(count > 0, mean_z - exponent * mean_x, self._whole[1])

    def residual(self, some: Bools) -> Floats:
        """What the fit to some reports leaves of all."""
        exponent, levels = self._line(some)
        found: Floats = self._reports.value - levels[self._reports.sensor] - exponent * self._decades
        return found

    def estimate(self, some: Bools) -> list[float]:
        """The figures by these reports (R,) alone: level, exponent, sd, slow, ln(slow_s), missing and the offsets."""
        exponent, levels = self._line(some)
        variance, slow, slow_s = self.memory.fit(self.residual(some), some)
        level = float(np.mean(levels))
        missing = missing_share(self._reports, some)
        return [level, exponent, sqrt(variance), slow, log(slow_s), missing, *(levels - level).tolist()]
