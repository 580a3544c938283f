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
from launcher.report.tracks import Array, Track

Figures = Mapping[str, Callable[[Run], Figure | None]]
"""How each figure is drawn, by the name of its file; None where there is nothing to show."""
WIDTH: Final = 8.6
"""Of every figure, in inches; its height is its own."""
INK: Final = "#1f2733"
SOFT: Final = "#6b7585"
TRUTH: Final = "#7c8796"
DEAD: Final = "#c8102e"
GAP: Final = "#c04f9b"
BAND: Final = "#e4eef7"
_DASHES: Final = ("-", "--", "-.", ":")
"""Of several targets."""
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
    "font.size": 8.5,
    "axes.edgecolor": "#9aa4b2",
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#edf0f4",
    "grid.linewidth": 0.8,
    "legend.fontsize": 8,
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


def over_time(axes: Axes, run: Run) -> None:
    """The time of the run as x axis, with what planned faults and deaths happened when."""
    axes.set_xlim(0.0, run.end_s)
    axes.set_xlabel("emulated time [s]")


def line(axes: Axes, run: Run, track: Track, values: Array) -> None:
    """What a track has at each of its steps, in the colour of its tracker and the dashes of its target."""
    targets = list(dict.fromkeys(other.target for other in run.tracks))
    label = track.tracker if len(targets) == 1 else f"{track.tracker}, {track.target}"
    dash = _DASHES[targets.index(track.target) % len(_DASHES)]
    axes.plot(track.t_s, values, dash, color=colour(run, track.tracker), lw=width(len(values)), label=label)


def counts(axes: Axes) -> None:
    """Whole numbers on the y axis."""
    axes.yaxis.set_major_locator(MaxNLocator("auto", integer=True))


def width(points: int) -> float:
    """How wide a line of so many points is drawn, so that it does not become a surface."""
    return float(np.clip(1.8 - points / 1200, 0.5, 1.8))


ROW: Final = 130
"""Characters of a legend that fit into one row, with the lines before them."""


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
