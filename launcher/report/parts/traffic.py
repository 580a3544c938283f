"""Figures of the radio: what became of the frames over time, and how long things took."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from launcher.report import style
from launcher.report.folder import Array, Run

MOST_BARS: Final = 80
POINTS: Final = 400
"""Of a curve: more cannot be seen."""


def losses(run: Run) -> Figure | None:
    """Frames by when they were sent and what became of them, stacked."""
    if not len(run.frames):
        return None
    figure, (axes,) = style.blank(2.9)
    step_s = run.site.step_ns / 1e9
    each = step_s * max(round(run.end_s / step_s / MOST_BARS), 1)
    edges = np.arange(0.0, run.end_s + each, each)
    bottom = np.zeros(len(edges) - 1)
    for outcome, colour in style.OUTCOMES.items():
        counts, _ = np.histogram(run.frames.sent_s[run.frames.where("outcome", outcome)], edges)
        if counts.any():
            label = outcome if outcome in ("delivered", "late", "ignored") else f"lost: {outcome.replace('_', ' ')}"
            axes.bar(edges[:-1], counts, each * 0.92, bottom, align="edge", color=colour, label=label, lw=0)
            bottom += counts
    axes.set_ylabel(f"frames in {each:g} s")
    style.counts(axes)
    style.over_time(axes, run)
    style.legend(axes, columns=5)
    return figure


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
