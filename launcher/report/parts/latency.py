"""How long frames, reports and tracks took, in emulated time."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from launcher.report import style
from launcher.report.cells import Table, number
from launcher.report.folder import Array, Run

POINTS: Final = 400
"""Of a curve: more cannot be seen."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"table": table(run)}


def table(run: Run) -> Table:
    """The quantiles that metrics.json has."""
    names = {"link": "on the link", "to_filter": "sending of a report to its fusion", "to_track": "step to its track"}
    rows = [
        [text, *(number(run.metrics["latency_ms"][key][q]) for q in ("p50", "p95", "p99", "max"))]
        for key, text in names.items()
    ]
    return Table(["emulated, ms", "median", "95 %", "99 %", "longest"], rows)


def latency(run: Run) -> Figure | None:
    """The share of frames, reports and track points that took no longer than so long."""
    curves = {name: 1e3 * values for name, values in latencies(run).items() if len(values)}
    if not curves:
        return None
    figure, (axes,) = style.blank(2.7)
    shares = np.linspace(0.0, 1.0, POINTS)
    looks = (("-", style.INK), ("-", "#0072b2"), ("--", "#d55e00"))
    for (name, values), (dash, colour) in zip(curves.items(), looks, strict=False):
        axes.plot(np.quantile(values, shares), 100 * shares, dash, color=colour, lw=1.8, label=name)
    axes.set(xscale="log", ylim=(0, 102), xlabel="emulated time [ms]", ylabel="share that took no longer [%]")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    style.legend(axes)
    return figure


def latencies(run: Run) -> dict[str, Array]:
    """In s, as metrics.json counts them: on the link, from sending to fusion, and from a step to its track."""
    frames = run.frames
    told: dict[int, float] = {}
    step_s = run.site.step_ns / 1e9
    for track in run.tracks:
        for t_s, told_s in zip(track.t_s, track.told_s, strict=True):
            told.setdefault(round(t_s / step_s), told_s)
    fused = np.array([told.get(int(step), np.nan) if np.isfinite(step) else np.nan for step in frames.step])
    to_filter = np.where(frames.where("outcome", "delivered"), fused - frames.sent_s, np.nan)
    to_track = np.concatenate([track.told_s - track.t_s for track in run.tracks] or [np.empty(0)])
    found = {"on the link": frames.link_s, "sending to fusion": to_filter, "step to track": to_track}
    return {name: values[np.isfinite(values) & (values > 0)] for name, values in found.items()}


FIGURES: Final[style.Figures] = {"latency": latency}
