"""Reports that no target can have given: so far from all others that a fit would follow them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from launcher.calibrate.reports import Reports
from launcher.calibrate.samples import Floats
from trackfield.sensing.sensing import IMPOSSIBLE_SD

MOST_SHARE: Final = 0.01
"""If more reports than that are far off, they are no outliers: the kind does not fit."""
MOST_NAMED: Final = 5
_SD_OF_MEDIAN: Final = 1.4826
"""The standard deviation of a normal variable, beside the median of its absolute values."""


def regular(reports: Reports, residual: Callable[[Reports], Floats]) -> tuple[Reports, str]:
    """The reports without outliers, and a sentence about those, empty without any.

    An outlier is more than ``IMPOSSIBLE_SD`` standard deviations off; ``residual`` is what a fit leaves of each report,
    and its standard deviation is taken from the median, which outliers do not change (Hampel 1974). As they draw the
    fit to themselves, it is repeated without them.
    """
    kept = np.arange(len(reports.value))
    while True:
        left = reports.only(kept)
        off = np.abs(residual(left))
        far = off > IMPOSSIBLE_SD * _SD_OF_MEDIAN * float(np.median(off))
        if not far.any():
            return left, _words(reports, np.setdiff1d(np.arange(len(reports.value)), kept).tolist())
        kept = kept[~far]
        if len(kept) < (1.0 - MOST_SHARE) * len(reports.value):
            return reports, ""


def _words(reports: Reports, which: list[int]) -> str:
    if not which:
        return ""
    named = [
        f"{reports.value[i]:g} of {reports.ids[reports.sensor[i]]} at {reports.t_s[i]:.1f} s"
        for i in which[:MOST_NAMED]
    ]
    more = f" and {len(which) - MOST_NAMED} more" if len(which) > MOST_NAMED else ""
    count = "1 report is" if len(which) == 1 else f"{len(which)} reports are"
    return f"{count} left out, more than {IMPOSSIBLE_SD:g} standard deviations off: {', '.join(named)}{more}."
