"""Consistency: whether the errors of a tracker agree with its covariances (NEES)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from launcher.report import style
from launcher.report.cells import Table, number
from launcher.report.folder import Run
from trackfield.filters.metrics import nees_band

DIMENSIONS: Final = 4
"""The dimensions of the state (x, y, vx, vy)."""
BAND: Final = nees_band(DIMENSIONS, 1)
"""The NEES of one step lies in it with a probability of 95 % if the covariance is right: chi-square, 4 degrees."""
NEES_SHOWN: Final = (1e-2, 1e4)
"""The range of the axis; a filter that diverged may have any NEES."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    values = np.concatenate([track.nees[np.isfinite(track.nees)] for track in run.tracks] or [np.empty(0)])
    cut = bool(len(values)) and bool((values.max() > NEES_SHOWN[1]) | (values.min() < NEES_SHOWN[0]))
    return {"table": consistency(run), "cut": cut}


def consistency(run: Run) -> Table:
    """The mean NEES of every tracker beside the band in which it lies if its covariances are right."""
    rows = []
    for name, m in run.metrics["trackers"].items():
        cells = [(m.get(key), *(m.get(f"{key}_band") or (None, None))) for key in ("nees", "nees_position")]
        rows.append([name, *(number(one) for each in cells for one in each)])
    return Table(["tracker", "mean NEES", "95 % band from", "to", "of the position", "95 % band from", "to"], rows)


def in_words(m: Mapping[str, Any]) -> str:
    """Whether a tracker is consistent, overconfident or underconfident, by its figures in metrics.json."""
    mean, band = m["nees"], m.get("nees_band")
    if mean is None:
        return ""
    if not band:
        return f"NEES {number(mean)} ({DIMENSIONS} if its covariances are right)."
    whole, fit = _judged(mean, band)
    if m.get("nees_position") is None:
        return f"NEES {whole}: {fit}."
    position, of_position = _judged(m["nees_position"], m["nees_position_band"])
    verdict = fit if fit == of_position else f"{fit} as a whole, {of_position} of the position"
    return f"NEES {whole}, of the position {position}: {verdict}."


def _judged(mean: float, band: Sequence[float]) -> tuple[str, str]:
    """A mean beside its band, and what that says of the covariances."""
    low, high = band
    fit = "overconfident" if mean > high else "underconfident" if mean < low else "consistent"
    return f"{number(mean)} (95 % band {number(low)} to {number(high)})", fit


def nees(run: Run) -> Figure | None:
    """Error squared over covariance, step by step, with the band in which it lies if covariances are right."""
    known = [track for track in run.tracks if (np.isfinite(track.nees) & (track.nees > 0)).any()]
    if not known:
        return None
    figure, (axes,) = style.blank(2.9)
    window = run.window
    if window == 1:
        axes.axhspan(*BAND, color=style.BAND, lw=0, label="95 % of steps, if covariances are right", zorder=0)
    axes.axhline(DIMENSIONS, color=style.SOFT, lw=0.9, ls="--", zorder=1)
    for track in known:
        values = np.where(track.nees > 0, track.nees, np.nan)
        for pale in (False, True):
            chosen = np.where(track.interpolated == pale, values, np.nan)
            style.line(axes, run, track, style.rolling(chosen, window), pale=pale)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, NEES_SHOWN[0]), min(high, NEES_SHOWN[1]))
    what = "NEES of (x, y, vx, vy)"
    axes.set_ylabel(what if window == 1 else f"{what},\nmean over {window * run.step_s:g} s")
    style.over_time(axes, run)
    style.legend(axes)
    return figure


FIGURES: Final[style.Figures] = {"nees": nees}
