"""Figures over time: errors against the bound with the reports fused, and whether covariances told the truth."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.report import style
from launcher.report.folder import Run, Track
from trackfield.filters.metrics import nees_band

DIMENSIONS: Final = 4
"""Of the state (x, y, vx, vy)."""
BAND: Final = nees_band(DIMENSIONS, 1)
"""Where the NEES of one step lies with 95 % if the covariance is right: chi-square of 4 degrees of freedom."""
NEES_SHOWN: Final = (1e-2, 1e4)
"""A filter that diverged may have any."""
WIDE: Final = 30.0
"""Errors whose largest is so many times their median are shown on a logarithmic scale."""
_DASHES: Final = ("-", "--", "-.", ":")
"""Of several targets."""


def error(run: Run) -> Figure | None:
    """The distance of each track from the truth over time, the bound, and how many reports each step had."""
    known = [track for track in run.tracks if np.isfinite(track.error_m).any()]
    if not run.tracks:
        return None
    figure, (above, below) = style.blank(4.3, 2, ratios=[3.2, 1.0])
    for track in known:
        _line(above, run, track, track.error_m)
    bounded = [track for track in run.tracks if np.isfinite(track.bound).any()]  # smoothed ones are not
    for track in {track.target: track for track in bounded}.values():
        above.plot(track.t_s, track.bound, "--", color=style.INK, lw=1.3, label="bound for these reports (rms)")
    errors = np.concatenate([track.error_m[np.isfinite(track.error_m)] for track in known] or [np.ones(1)])
    if errors.max() > WIDE * max(float(np.median(errors)), 1e-9):
        above.set_yscale("log")
    else:
        above.set_ylim(bottom=0.0)
    above.set_ylabel("position error [m]")
    _events(above, run)
    style.legend(above)
    _reports(below, run)
    style.over_time(below, run)
    return figure


def nees(run: Run) -> Figure | None:
    """Error squared over covariance, step by step, with the band in which it lies if covariances are right."""
    known = [track for track in run.tracks if (np.isfinite(track.nees) & (track.nees > 0)).any()]
    if not known:
        return None
    figure, (axes,) = style.blank(2.9)
    axes.axhspan(*BAND, color=style.BAND, lw=0, label="95 % of steps lie here if covariances are right", zorder=0)
    axes.axhline(DIMENSIONS, color=style.SOFT, lw=0.9, ls="--", zorder=1)
    for track in known:
        _line(axes, run, track, np.where(track.nees > 0, track.nees, np.nan))
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, NEES_SHOWN[0]), min(high, NEES_SHOWN[1]))
    axes.set_ylabel("NEES of (x, y, vx, vy)")
    style.over_time(axes, run)
    style.legend(axes)
    return figure


def _line(axes: Axes, run: Run, track: Track, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    targets = list(dict.fromkeys(other.target for other in run.tracks))
    label = track.tracker if len(targets) == 1 else f"{track.tracker}, {track.target}"
    dash = _DASHES[targets.index(track.target) % len(_DASHES)]
    axes.plot(track.t_s, values, dash, color=style.colour(run, track.tracker), lw=style.width(len(values)), label=label)


def _reports(axes: Axes, run: Run) -> None:
    """How many reports were fused in each step, by the tracker that took most."""
    times = np.unique(np.concatenate([track.t_s for track in run.tracks]))
    most = np.zeros(len(times))
    for track in run.tracks:
        at = np.searchsorted(times, track.t_s)
        most[at] = np.maximum(most[at], track.reports)
    axes.fill_between(times, most, step="mid", color="#b9c8da", lw=0)
    axes.set_ylim(0.0, max(float(most.max()), 1.0) * 1.1)
    axes.set_ylabel("reports fused")
    style.counts(axes)


def _events(axes: Axes, run: Run) -> None:
    """Stretches without data of the target, and when something broke."""
    for index, (begin, end) in enumerate(next(iter(run.site.paths.values())).gaps):
        axes.axvspan(begin, end, color=style.GAP, alpha=0.12, lw=0, label=None if index else "no data of the target")
    for index, t_s in enumerate(broken_at(run)):
        axes.axvline(t_s, color=style.DEAD, lw=0.9, ls=":", label=None if index else "fault or death")


def broken_at(run: Run) -> list[float]:
    """When a fault began or somebody died or stood still, s; each instant once."""
    unplanned = [one["t"] for name in ("died", "stopped") for one in run.metrics["processes"][name] or []]
    empty = [one["t"] for one in run.metrics["lifetime_s"].get("empty") or []]
    return sorted({t_s for t_s, *_ in run.marks} | {t for t in (*unplanned, *empty) if t is not None})
