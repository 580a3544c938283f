"""How the figures of a report look: one set of colours, sizes and axes for all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from launcher.colours import tracker_colours
from launcher.report.folder import Run
from launcher.report.outages import broken_at
from launcher.report.tracks import Array, Track

Figures = Mapping[str, Callable[[Run], Figure | None]]
"""The function that draws each figure, by the name of its file; it returns None if there is nothing to show."""
WIDTH: Final = 8.0
"""The width of every figure, in inches."""
INK: Final = "#1f2733"
SOFT: Final = "#6b7585"
TRUTH: Final = "#7c8796"
DEAD: Final = "#c8102e"
GAP: Final = "#c04f9b"
BAND: Final = "#e4eef7"
PALE: Final = 0.35
"""The opacity of values that do not count."""
POINTS: Final = 400
"""The most points of a curve: more cannot be seen."""
_DASHES: Final = ("-", "--", "-.", ":")
"""The line styles of several targets."""
OUTCOMES: Final[Mapping[str, str]] = {
    "delivered": "#dbe1e9",
    "late": "#f0c75e",
    "ignored": "#a9b4c2",
    "radio": "#d55e00",
    "partition": "#cc79a7",
    "in_flight": "#8c6d4f",
    "asleep": "#56b4e9",
    "frozen": "#0072b2",
    "dead": "#1f2733",
    "overflow": "#009e73",
}
"""What becomes of a frame, those that arrive first."""
STYLE: Final[Mapping[Any, Any]] = {
    "figure.dpi": 170,
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.edgecolor": "#9aa4b2",
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#edf0f4",
    "grid.linewidth": 0.8,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "text.color": INK,
    "xtick.color": "#9aa4b2",
    "ytick.color": "#9aa4b2",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "path.simplify": True,
    "agg.path.chunksize": 20_000,
}


def colour(run: Run, tracker: str) -> str:
    """The colour of a tracker, wherever it is shown."""
    return tracker_colours(run.trackers)[tracker]


def blank(height: float, rows: int = 1, *, ratios: Sequence[float] = ()) -> tuple[Figure, list[Axes]]:
    """A figure of ``rows`` plots above each other that share their x axis."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=ratios or [1.0] * rows)
    return figure, list(grid[:, 0])


def over_time(axes: Axes, run: Run, *, named: bool = True) -> None:
    """The time of the run as x axis, with gaps in the data, faults and deaths; ``named`` in the legend, or not."""
    for index, gap in enumerate(run.gaps):
        label = "truth interpolated" if named and not index else None
        axes.axvspan(*gap, color=GAP, alpha=0.12, lw=0, label=label, zorder=0)
    for index, t_s in enumerate(broken_at(run)):
        label = "fault or death" if named and not index else None
        axes.axvline(t_s, color=DEAD, lw=0.9, ls=":", label=label)
    axes.set_xlim(0.0, max(min(run.end_s, run.metrics["ended_s"]), run.step_s))
    axes.set_xlabel("emulated time [s]")


def look(run: Run, track: Track) -> dict[str, Any]:
    """The look of a line: the colour of its tracker, the dashes of its target, and its name."""
    targets = list(dict.fromkeys(other.target for other in run.tracks))
    label = track.tracker if len(targets) == 1 else f"{track.tracker}, {track.target}"
    dash = _DASHES[targets.index(track.target) % len(_DASHES)]
    return {"color": colour(run, track.tracker), "ls": dash, "label": label}


def line(axes: Axes, run: Run, track: Track, values: Array, *, pale: bool = False) -> None:
    """Draw the values of a track at its steps; the line breaks at NaN, and single steps are dots."""
    drawn = look(run, track) | ({"label": None, "alpha": PALE} if pale else {})
    axes.plot(track.t_s, values, lw=1.4 if run.long else width(len(values)), **drawn)
    if run.long:
        return
    there = np.concatenate([[False], np.isfinite(values), [False]])
    alone = there[1:-1] & ~there[:-2] & ~there[2:]
    if alone.any():
        axes.plot(track.t_s[alone], values[alone], ".", ms=3.5, **drawn | {"ls": "", "label": None})


def rolling(values: Array, window: int) -> Array:
    """(T,) the mean over a ``window`` around each value, without NaN; NaN where the value itself is NaN."""
    if window <= 1:
        return values
    there = np.isfinite(values)
    kernel = np.ones(min(window, len(values)))
    sums, counts = (np.convolve(one, kernel, "same") for one in (np.where(there, values, 0.0), there.astype(float)))
    return np.where(there, sums / np.maximum(counts, 1.0), np.nan)


def rolling_rms(values: Array, window: int) -> Array:
    """(T,) the root mean square over a window, as ``rolling``."""
    return np.abs(values) if window <= 1 else np.sqrt(rolling(np.square(values), window))


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """As many points of a curve as can be seen."""
    chosen = np.unique(np.linspace(0, len(x) - 1, min(POINTS, len(x))).round().astype(int))
    return x[chosen], y[chosen]


def counts(axes: Axes) -> None:
    """Whole numbers on the y axis."""
    axes.yaxis.set_major_locator(MaxNLocator("auto", integer=True))


def width(points: int) -> float:
    """The line width for so many points; many points need a thin line to stay legible."""
    return float(np.clip(1.8 - points / 1200, 0.5, 1.8))


def size(sensors: int) -> float:
    """The size of the dots of so many sensors on a map; many sensors need small dots to stay apart."""
    return float(np.clip(70 / max(sensors, 1) ** 0.5, 1.0, 5.0))


ROW: Final = 105
"""Characters of a legend that fit into one row, including its lines."""


def legend(axes: Axes, columns: int = 4) -> None:
    """Above the plot, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if sum(len(label) + 8 for label in labels) < ROW:
        columns = max(len(labels), 1)
    if handles:
        drawn = axes.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(-0.01, 1.0),
            ncols=columns,
            borderaxespad=0.2,
            handlelength=1.6,
            columnspacing=1.4,
        )
        for line in drawn.get_lines():
            line.set_linewidth(1.8)  # whatever the plot needs
