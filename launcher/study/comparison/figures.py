"""The figures of a comparison: errors over time and their distribution, frames by outcome, energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from launcher.record.words import joules
from launcher.report import style
from launcher.report.folder import Run
from launcher.report.parts import energy
from launcher.report.parts.errors import WIDE
from launcher.report.tracks import Array
from launcher.study.comparison.lines import Line, colours, panels

LINE: Final = 110
"""Characters that fit beside each other in a figure."""
_PLAIN: Final = FuncFormatter(lambda value, _: f"{value:g}")
"""Numbers of a logarithmic axis as they are."""


def errors(found: Sequence[Line]) -> Figure | None:
    """The distance of each track from its truth over time; of all its rms over the same window if any run is long.

    A line breaks where there is no track, and in gaps of the truth.
    """
    plots = panels([line for line in found if line.track.scored.any()])
    if not plots:
        return None
    figure, rows = style.blank(0.7 + 2.6 * len(plots), len(plots))
    window_s = _window_s(found)
    for axes, plot in zip(rows, plots, strict=True):
        curves = [(line.track.t_s, _over_time(line, window_s)) for line in plot]
        _draw(axes, plot, curves)
        _scale(axes, np.concatenate([values for _, values in curves]))
        axes.set_ylabel(f"position error [m],\nrms over {window_s:g} s" if window_s else "position error [m]")
    rows[-1].set(xlim=(0.0, max(line.run.end_s for line in found)), xlabel="emulated time [s]")
    return figure


def _window_s(found: Sequence[Line]) -> float:
    """Over how many seconds errors are averaged to be read: the window of the longest run; 0 if none is long."""
    return max((line.run.window * line.run.step_s for line in found if line.run.long), default=0.0)


def _over_time(line: Line, window_s: float) -> Array:
    """(T,) the error, or its rms over so many seconds; NaN where it does not count."""
    track = line.track
    window = max(round(window_s / line.run.step_s), 1)
    return style.rolling_rms(np.where(track.scored, track.error_m, np.nan), window)


def distribution(found: Sequence[Line]) -> Figure | None:
    """The share of the expected steps at which the error of each track was no larger than x."""
    plots = panels([line for line in found if line.track.scored.any()])
    if not plots:
        return None
    figure, rows = style.blank(0.7 + 2.2 * len(plots), len(plots))
    for axes, plot in zip(rows, plots, strict=True):
        _draw(axes, plot, [_distribution(line) for line in plot])
        axes.set(xscale="log", ylim=(0.0, 102.0), ylabel="share of the steps [%]")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(_PLAIN)
        axes.xaxis.set_minor_locator(NullLocator())
    rows[-1].set_xlabel("position error no larger than [m]")
    return figure


def _distribution(line: Line) -> tuple[Array, Array]:
    """Errors in order, and the share of steps up to each; a step without a track counts as an error of infinity."""
    track = line.track
    reached = np.sort(track.error_m[track.scored])
    judged = max(int((track.expected & ~track.interpolated).sum()), len(reached))
    return np.maximum(reached, 1e-3), 100.0 * np.arange(1, len(reached) + 1) / judged


def _draw(axes: Axes, plot: Sequence[Line], curves: Sequence[tuple[Array, Array]]) -> None:
    looks, named = colours(plot), set[str]()
    for line, curve in zip(plot, curves, strict=True):
        axes.plot(*curve, label=None if line.label in named else line.label, **line.look(looks))
        named.add(line.label)
    legend(axes)


def legend(axes: Axes) -> None:
    """Above the plot, with the dashes as they are drawn."""
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(
        handles,
        labels,
        loc="lower left",
        bbox_to_anchor=(-0.01, 1.0),
        ncols=columns(labels),
        borderaxespad=0.2,
        handlelength=3.2,
    )


def columns(labels: Sequence[str]) -> int:
    """How many entries of a legend fit beside each other."""
    return max(min(len(labels), LINE // (max(map(len, labels)) + 8)), 1)


def _scale(axes: Axes, errors_m: Array) -> None:
    known = errors_m[np.isfinite(errors_m)]
    if known.max() > WIDE * max(float(np.median(known)), 1e-9):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(_PLAIN)
    else:
        axes.set_ylim(bottom=0.0)


# --- bars -------------------------------------------------------------------------------------------------------------


def fates(runs: Sequence[Run], names: Sequence[str]) -> Figure | None:
    """What became of the frames of each run, as shares of those that were expected."""
    if not any(len(run.frames) for run in runs):
        return None
    outcomes = [*style.OUTCOMES, "host_lost"]
    counts = [{name: int(run.frames.where("outcome", name).sum()) for name in outcomes} for run in runs]
    shares = [{name: 100.0 * n / max(sum(one.values()), 1) for name, n in one.items()} for one in counts]
    shown = {name: style.OUTCOMES.get(name, style.DEAD) for name in outcomes if any(one[name] for one in counts)}
    ends = [f"{sum(one.values()):,} frames" for one in counts]
    words = {name: _fate(name) for name in shown}
    figure = _bars(
        names, [{words[n]: one[n] for n in shown} for one in shares], {words[n]: c for n, c in shown.items()}, ends
    )
    figure.axes[0].set(xlabel="share of the frames expected at their receivers [%]", xlim=(0.0, 100.0))
    return figure


def spent(runs: Sequence[Run], names: Sequence[str]) -> Figure | None:
    """The energy spent from batteries in each run, and on what."""
    totals = [run.metrics["energy_j"]["total"] or 0.0 for run in runs]
    if not any(totals):
        return None
    bars = [energy.spent(run) for run in runs]
    parts = [{bar.label: bar.share * total for bar in some} for some, total in zip(bars, totals, strict=True)]
    looks = {bar.label: bar.colour for some in bars for bar in some}
    figure = _bars(names, parts, looks, [joules(total) for total in totals])
    figure.axes[0].set(xlabel="energy from batteries [J]", xlim=(0.0, max(totals)))
    return figure


def _fate(name: str) -> str:
    return name if name in ("delivered", "late", "ignored") else f"lost: {name.replace('_', ' ')}"


def _bars(
    names: Sequence[str], parts: Sequence[Mapping[str, float]], looks: Mapping[str, str], ends: Sequence[str]
) -> Figure:
    """A bar for each run, of parts; its total stands at its end."""
    figure = Figure(figsize=(style.WIDTH, 0.95 + 0.34 * len(names)), layout="constrained")
    axes = figure.subplots()
    left = np.zeros(len(names))
    for part, colour in looks.items():
        widths = np.array([some.get(part, 0.0) for some in parts])
        axes.barh(range(len(names)), widths, 0.72, left, color=colour, lw=0, label=part)
        left += widths
    for place, (end, text) in enumerate(zip(left, ends, strict=True)):
        axes.annotate(text, (end, place), (5, 0), textcoords="offset points", va="center", annotation_clip=False)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    style.legend(axes, columns=5)
    return figure
