"""How long frames, reports and tracks took, in emulated time."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pyarrow.compute as pc
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from launcher.record.figures.hops import CARRIERS
from launcher.record.words import span
from launcher.report import style
from launcher.report.cells import Table, number
from launcher.report.folder import Run
from launcher.report.tracks import Array
from trackfield.role import NS
from trackfield.tracking.smoothing import WHOLE_PATTERN


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"table": table(run), "late": late(run)}


def late(run: Run) -> str:
    """How many reports came after their deadline, and by how much, in a sentence; empty if none did."""
    after = run.frames.late_s(run.site.step_ns, run.scenario.fusion.deadline_s)
    after, of = after[np.isfinite(after)], int(run.frames.reports.sum())
    if not len(after):
        return ""
    by = f"by {span(float(np.median(after)))} in the median, {span(float(after.max()))} at most"
    return f"{len(after):,} of {of:,} reports came after the deadline of their step, {by}."


def table(run: Run) -> Table:
    """The quantiles that metrics.json has."""
    names = {"link": "on the link", "to_filter": "sending of a report to its fusion", "to_track": "step to its track"}
    rows = [
        [text, *(number(run.metrics["latency_ms"][key][q]) for q in ("p50", "p95", "p99", "max"))]
        for key, text in names.items()
    ]
    return Table(["emulated time [ms]", "median", "95 %", "99 %", "longest"], rows)


def latency(run: Run) -> Figure | None:
    """The share of frames, reports and track points that took no longer than x."""
    curves = {name: 1e3 * values for name, values in latencies(run).items() if len(values)}
    if not curves:
        return None
    figure, (axes,) = style.blank(2.7)
    looks = (("-", style.INK), ("-", "#0072b2"), ("--", "#d55e00"))
    for (name, values), (dash, colour) in zip(curves.items(), looks, strict=False):
        ordered, shares = np.sort(values), np.linspace(0.0, 100.0, len(values) + 1)
        curve = style.thinned(np.concatenate([ordered[:1], ordered]), shares)
        axes.step(*curve, dash, where="post", color=colour, lw=1.8, label=name)
    deadline_ms = 1e3 * run.scenario.fusion.deadline_s
    axes.axvline(deadline_ms, color=style.DEAD, lw=1.2, ls=":", label=f"deadline, {deadline_ms:g} ms after the step")
    axes.set(xscale="log", ylim=(0, 102), xlabel="emulated time [ms]", ylabel="share that took no longer [%]")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    style.legend(axes)
    return figure


def latencies(run: Run) -> dict[str, Array]:
    """In s, as metrics.json counts them: on the link, from sending to fusion, and from a step to its track."""
    live = run.points.filter(pc.equal(run.points["lag"], 0))
    live = live.filter(pc.invert(pc.match_substring_regex(live["tracker"], WHOLE_PATTERN)))
    to_track = np.asarray(pc.subtract(live["told_ns"], live["at_ns"]).to_numpy(), float) / NS
    found = {"on the link": run.frames.link_s, "sending to fusion": _to_fusion(run), "step to track": to_track}
    return {name: values[np.isfinite(values) & (values > 0)] for name, values in found.items()}


def _to_fusion(run: Run) -> Array:
    """From sending a report to the first track that used it, s; NaN if none did."""
    first = run.first_fused_ns
    reports = run.frames.table.filter(run.frames.where("outcome", "delivered") & ~run.frames.where("kind", *CARRIERS))
    reports = reports.filter(reports["step"].is_valid())
    sent = zip(*(reports[name].to_pylist() for name in ("src", "step", "sent_ns")), strict=True)
    return np.array([first.get((src, step), np.nan) - sent_ns for src, step, sent_ns in sent]) / NS


FIGURES: Final[style.Figures] = {"latency": latency}
