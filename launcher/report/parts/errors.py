"""The errors of the trackers: in a table, over time, and as a distribution."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.record.figures.verdict import told
from launcher.report import style
from launcher.report.cells import Table, number
from launcher.report.folder import Run
from launcher.report.tracks import Array

WIDE: Final = 30.0
"""Errors whose largest is more than so many times their median are shown on a logarithmic scale."""
LEAST_SHOWN: Final = 1e-4
"""The lower end of such a scale, relative to the largest error."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"trackers": trackers(run), "targets": targets(run)}


# --- tables -----------------------------------------------------------------------------------------------------------


def trackers(run: Run) -> Table:
    """The errors of every tracker, then in further views; the bound and gaps only where there are some."""
    lines = [_line(name, m) for name, m in run.metrics["trackers"].items()]
    lines += [
        _line(f"{name}, {view}", figures)
        for name, m in run.metrics["trackers"].items()
        for view, figures in list(m["views"].items())[1:]
    ]
    left_out = {
        "bound [m]": run.bounded,
        "/ bound": run.bounded,
        "RMSE in gaps [m]": bool(run.gaps),
        "steps in gaps": bool(run.gaps),
    }
    head = [column for column in lines[0] if left_out.get(column, True)] if lines else []
    return Table(head, [[line[column] for column in head] for line in lines])


def _line(name: str, m: dict[str, Any]) -> dict[str, str]:
    rmse = m["rmse"]
    return {
        "tracker": name,
        "verdict": told(m),
        "RMSE [m]": number(rmse["position"]),
        "bound [m]": number(m["bound_m"]),
        "/ bound": number(m["times_bound"]),
        "east [m]": number(rmse["x"]),
        "north [m]": number(rmse["y"]),
        "median [m]": number(m["median_error"]),
        "velocity [m/s]": number(rmse["velocity"]),
        "steps": f"{m['steps_tracked']:,} of {m['steps_expected']:,}",
        "RMSE in gaps [m]": number(m["gap"]["rmse"]),
        "steps in gaps": number(m["gap"]["steps"]),
    }


def targets(run: Run) -> Table:
    """With several targets, the error of every tracker while this one was the nearest."""
    rows = [
        [name, target, number(own["rmse"]), number(own["steps"])]
        for name, m in run.metrics["trackers"].items()
        for target, own in m["targets"].items()
    ]
    return Table(["tracker", "nearest target", "RMSE [m]", "steps"], rows)


# --- over time --------------------------------------------------------------------------------------------------------


def error(run: Run) -> Figure | None:
    """The distance of each track from the truth over time, the bound, and how many reports each step had.

    Of long runs their root mean squares over a window; values in a gap of the data are pale.
    """
    known = [track for track in run.tracks if np.isfinite(track.error_m).any()]
    if not known:
        return None
    figure, (above, below) = style.blank(4.4, 2, ratios=[3.2, 1.0])
    window = run.window
    for track in known:
        for values, pale in ((track.error_m, False), (track.error_m, True)):
            chosen = np.where(track.interpolated == pale, values, np.nan)
            style.line(above, run, track, style.rolling_rms(chosen, window), pale=pale)
    if run.bounded:
        times, bound = _bound(run)
        above.plot(
            times, style.rolling_rms(bound, window), "--", color=style.INK, lw=1.3, label="bound for these reports"
        )
    errors = np.concatenate([track.error_m[np.isfinite(track.error_m)] for track in known])
    if errors.max() > WIDE * max(float(np.median(errors)), 1e-9):
        above.set_yscale("log")
        above.set_ylim(bottom=max(above.get_ylim()[0], LEAST_SHOWN * float(errors.max())))
    else:
        above.set_ylim(bottom=0.0)
    what = "error to nearest target [m]" if run.several else "position error [m]"
    above.set_ylabel(f"{what},\nrms over {window * run.step_s:g} s" if window > 1 else what)
    _reports(below, run, window)
    style.over_time(above, run)
    style.over_time(below, run, named=False)
    above.set_xlabel("")
    style.legend(above)
    return figure


def _bound(run: Run) -> tuple[Array, Array]:
    """Times and the bound at them, from any track that has one; smoothed tracks have none."""
    times = np.unique(np.concatenate([track.t_s for track in run.tracks]))
    bound = np.full(len(times), np.nan)
    for track in run.tracks:
        at = np.searchsorted(times, track.t_s)
        bound[at] = np.fmax(bound[at], track.bound)
    return times, bound


def _reports(axes: Axes, run: Run, window: int) -> None:
    """How many reports were fused in each step, by the tracker that used most; none where there was no track."""
    times = np.unique(np.concatenate([track.t_s for track in run.tracks]))
    most = np.zeros(len(times))
    for track in run.tracks:
        at = np.searchsorted(times, track.t_s)
        most[at] = np.maximum(most[at], track.reports)
    most = style.rolling(most, window)
    axes.fill_between(times, most, step="mid", color="#b9c8da", lw=0)
    axes.set_ylim(0.0, max(float(most.max()), 1.0) * 1.1)
    axes.set_ylabel("reports fused" if window == 1 else "reports fused,\nmean")
    style.counts(axes)


# --- how often --------------------------------------------------------------------------------------------------------


def distribution(run: Run) -> Figure | None:
    """For a long run, the share of its steps at which the error of each tracker was no larger than x."""
    known = [track for track in run.tracks if track.scored.any()]
    if not known or not run.long:
        return None
    figure, (axes,) = style.blank(2.7)
    errors = np.concatenate([track.error_m[track.scored] for track in known])
    wide = errors.max() > WIDE * max(float(np.median(errors)), 1e-9)
    for track in known:
        steps = int((track.expected & ~track.interpolated).sum())
        own = np.sort(track.error_m[track.scored])
        shares = 100 * np.arange(len(own) + 1) / max(steps, len(own))
        curve = style.thinned(np.concatenate([own[:1], own]), shares)
        axes.step(*curve, where="post", **style.look(run, track), lw=1.8)
    lost_m = run.scenario.lost_beyond_m
    if lost_m < errors.max():
        axes.axvline(lost_m, color=style.DEAD, lw=0.9, ls=":", label=f"{lost_m:g} m: beyond it a track is lost")
    axes.set(ylim=(0, 102), xlabel="position error [m]", ylabel="share of the steps [%]")
    if wide:
        axes.set_xscale("log")
    else:
        axes.set_xlim(left=0.0)
    style.legend(axes)
    return figure


FIGURES: Final[style.Figures] = {"error": error, "distribution": distribution}
