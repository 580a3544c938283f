"""The share of reports that are missing, of those that there would be if each sensor reported at each instant."""

from __future__ import annotations

from math import isnan
from typing import Final

import numpy as np
from scipy.optimize import brentq

from launcher.calibrate.intervals import Fitted
from launcher.calibrate.reports import Reports
from launcher.calibrate.samples import Bools

TOGETHER: Final = 1.5
"""If fewer sensors report at an instant, in the mean, each reports at instants of its own."""
_MOST: Final = 1.0 - 1e-9


def missing_share(reports: Reports, some: Bools) -> float:
    """The share by some of the reports (R,) alone, which are all those of some instants; NaN if it cannot be seen.

    A sensor is expected to report at all instants at which the target is no farther away than when anything was ever
    received. An instant at which nothing was received is not seen: the share is the one of greatest likelihood, given
    that each instant has at least one report.
    """
    instants = np.unique(reports.instant[some])
    reach = reports.away_m[instants] <= float(reports.distance_m.max())
    reach |= reports.heard[instants]
    received, of = int((reports.heard[instants] & reach).sum()), reach.sum(axis=1)
    if received < TOGETHER * len(instants):
        return float("nan")

    def too_many(share: float) -> float:
        return float((of * (1.0 - share) / (1.0 - share**of)).sum()) - received

    return float(brentq(too_many, 0.0, _MOST)) if too_many(0.0) > 0.0 else 0.0


def fitted_missing(share: Fitted) -> tuple[dict[str, Fitted], dict[str, str]]:
    """The key ``missing``, or why it is left."""
    if isnan(share.value):
        return {}, {"missing": "not fitted: the sensors do not report at the same instants"}
    return {"missing": Fitted(share.value, max(share.low, 0.0), min(share.high, 1.0))}, {}
