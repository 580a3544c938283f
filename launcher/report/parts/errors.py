"""How far off the trackers were: a sentence and a line of a table for each, and their errors over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.report import style
from launcher.report.cells import Table, number
from launcher.report.folder import Run
from launcher.report.parts.consistency import in_words

WIDE: Final = 30.0
"""Errors whose largest is so many times their median are shown on a logarithmic scale."""

NEAREST: Final = "With several targets, each step is scored against the nearest one."


@dataclass(frozen=True)
class Verdict:
    """What became of one tracker, in a sentence; ``good`` unless it lost the target or never had it."""

    tracker: str
    colour: str
    state: str
    good: bool
    text: str


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"verdicts": verdicts(run), "trackers": trackers(run), "targets": targets(run)}


# --- words and tables -------------------------------------------------------------------------------------------------


def verdicts(run: Run) -> list[Verdict]:
    """One for each tracker."""
    return [_verdict(run, name, m) for name, m in run.metrics["trackers"].items()]


def _verdict(run: Run, name: str, m: dict[str, Any]) -> Verdict:
    colour = style.colour(run, name)
    if not m["steps"]:
        text = f"It never had a track of {'a' if run.several else 'the'} target."
        return Verdict(name, colour, "no track", False, text)
    of = sum(int(np.isfinite(track.truth[:, 0]).sum()) for track in run.tracks if track.tracker == name)
    steps = f"all {of} steps" if m["steps"] == of else f"{m['steps']} of {of} steps"
    blind = sum(int(track.coasting.sum()) for track in run.tracks if track.tracker == name)
    steps += f", {blind} of them without a report" if blind else ""
    rmse, bound = m["rmse"]["position"], _bound(run, name)
    error = f"RMSE {number(rmse, 'm')}, median error {number(m['median_error'], 'm')}, over {steps}"
    if bound:
        error += f"; {rmse / bound:.2f} times the bound of {number(bound, 'm')}"
    text = " ".join(filter(None, [f"{error}.", NEAREST if m["association"] else "", in_words(m)]))
    return Verdict(name, colour, "lost" if m["lost"] else "followed", not m["lost"], text)


def _bound(run: Run, name: str) -> float | None:
    """What this tracker's error is measured by, m; a smoothed track knows of later reports, so it has none."""
    return run.bound_m if any(np.isfinite(t.bound).any() for t in run.tracks if t.tracker == name) else None


def trackers(run: Run) -> Table:
    """How far off every tracker was; the bound only where there is one."""
    lines = [_line(_bound(run, name), name, m) for name, m in run.metrics["trackers"].items()]
    head = [column for column in lines[0] if run.bound_m or column != "/ bound"] if lines else []
    return Table(head, [[line[column] for column in head] for line in lines])


def _line(bound_m: float | None, name: str, m: dict[str, Any]) -> dict[str, str]:
    rmse = m["rmse"]
    return {
        "tracker": name,
        "RMSE [m]": number(rmse["position"]),
        "/ bound": number(rmse["position"] / bound_m if bound_m and rmse["position"] is not None else None),
        "east [m]": number(rmse["x"]),
        "north [m]": number(rmse["y"]),
        "median [m]": number(m["median_error"]),
        "velocity [m/s]": number(rmse["velocity"]),
        "steps": number(m["steps"]),
        "lost": "yes" if m["lost"] else "no",
    }


def targets(run: Run) -> Table:
    """Of several targets, how far off every tracker was while this one was the nearest."""
    rows = [
        [name, target, number(own["rmse"]), number(own["steps"])]
        for name, m in run.metrics["trackers"].items()
        for target, own in m["targets"].items()
    ]
    return Table(["tracker", "nearest target", "RMSE [m]", "steps"], rows)


# --- the figure -------------------------------------------------------------------------------------------------------


def error(run: Run) -> Figure | None:
    """The distance of each track from the truth over time, the bound, and how many reports each step had."""
    known = [track for track in run.tracks if np.isfinite(track.error_m).any()]
    if not run.tracks:
        return None
    figure, (above, below) = style.blank(4.3, 2, ratios=[3.2, 1.0])
    for track in known:
        style.line(above, run, track, track.error_m)
    bounded = [track for track in run.tracks if np.isfinite(track.bound).any()]  # smoothed ones are not
    for track in {track.target: track for track in bounded}.values():
        above.plot(track.t_s, track.bound, "--", color=style.INK, lw=1.3, label="bound for these reports (rms)")
    errors = np.concatenate([track.error_m[np.isfinite(track.error_m)] for track in known] or [np.ones(1)])
    if errors.max() > WIDE * max(float(np.median(errors)), 1e-9):
        above.set_yscale("log")
    else:
        above.set_ylim(bottom=0.0)
    above.set_ylabel("error to nearest target [m]" if run.several else "position error [m]")
    _events(above, run)
    style.legend(above)
    _reports(below, run)
    style.over_time(below, run)
    return figure


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
    """Stretches without data of a target, and when something broke."""
    gaps = [gap for path in run.site.paths.values() for gap in path.gaps]
    blind = f"no data of {'a' if run.several else 'the'} target"
    for index, (begin, end) in enumerate(gaps):
        span = begin - run.origin_s, end - run.origin_s
        axes.axvspan(*span, color=style.GAP, alpha=0.12, lw=0, label=None if index else blind)
    for index, t_s in enumerate(broken_at(run)):
        axes.axvline(t_s, color=style.DEAD, lw=0.9, ls=":", label=None if index else "fault or death")


def broken_at(run: Run) -> list[float]:
    """When a fault began or somebody died or stood still, s; each instant once."""
    unplanned = [one["t"] for name in ("died", "stopped") for one in run.metrics["processes"][name] or []]
    empty = [one["t"] for one in run.metrics["lifetime_s"].get("empty") or []]
    return sorted({t_s for t_s, *_ in run.marks} | {t for t in (*unplanned, *empty) if t is not None})


FIGURES: Final[style.Figures] = {"error": error}
