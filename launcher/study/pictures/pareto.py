"""A Pareto front: two figures of each combination, and which of them no other dominates.

One dominates another if it is no worse in either figure and better in one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.record.figures.verdict import LOST
from launcher.report.style import INK, SOFT, WIDTH
from launcher.study.axes import ARCHITECTURE, label, overlap
from launcher.study.figures import BASE_ERROR, COST, ERROR, FIGURES, LIFE, scale_of
from launcher.study.pictures.look import COLOURS, MARKERS, Picture, columns, styled, wide, y_scale
from launcher.study.summary import Row, Summary

MOST_NAMES: Final = 14
"""The most points that are all labelled; of more, only those of the front are."""
GREY: Final = "#9aa4b2"


@dataclass(frozen=True)
class Front:
    """Rows by two figures; ``best`` are the places of those that no other dominates, ``out`` of those that cannot be
    among them, as half of their runs or more were lost."""

    x: str
    y: str
    rows: tuple[Row, ...]
    best: tuple[int, ...]
    out: tuple[int, ...]

    @property
    def empty(self) -> str:
        """What is to be said if no row has both figures; empty if one has."""
        return "" if self.rows else f"no run has both figures, {self.x} and {self.y}"

    @property
    def worth_it(self) -> bool:
        """Whether the figures differ between rows at all."""
        values = [{_value(row, key) for row in self.rows} for key in (self.x, self.y)]
        return all(len(some) > 1 for some in values)


def default_pair(summary: Summary) -> tuple[str, str]:
    """The cost of a field, and its error; of architectures, how long the field lasts, and the error at its base."""
    if summary.told(LIFE) and any(overlap(axis.sets, ARCHITECTURE) for axis in summary.axes):
        return LIFE, BASE_ERROR
    return next((key for key in COST if summary.told(key)), COST[-1]), ERROR


def front_of(summary: Summary, x: str, y: str) -> Front:
    """The front of the rows that have both figures."""
    rows = [row for row in summary.rows if row.figures[x] and row.figures[y]]
    out = [place for place, row in enumerate(rows) if (lost := row.share(LOST)) and lost.value >= 0.5]
    signs = [1.0 if FIGURES[key].better == "less" else -1.0 for key in (x, y)]
    points = np.array([[_value(row, key) for key in (x, y)] for row in rows], float).reshape(-1, 2) * signs
    able = [place for place in range(len(rows)) if place not in out]
    best = [
        place
        for place in able
        if not any((points[o] <= points[place]).all() and (points[o] < points[place]).any() for o in able)
    ]
    return Front(x, y, tuple(rows), tuple(sorted(best, key=lambda place: tuple(points[place]))), tuple(out))


def _value(row: Row, key: str) -> float:
    estimate = row.figures[key]
    return float("nan") if estimate is None else estimate.value


def pareto_picture(front: Front) -> Picture:
    """Both figures of each combination and tracker with their intervals, and the line of the best."""
    with styled():
        figure = Picture(figsize=(WIDTH, 4.6), layout="constrained")
        axes = figure.subplots()
        trackers = list(dict.fromkeys(row.tracker for row in front.rows))
        (xs, x_unit, _), (ys, y_unit, y_by) = (_ends(front, key) for key in (front.x, front.y))
        for place, row in enumerate(front.rows):
            best, out = place in front.best, place in front.out
            colour = COLOURS[0] if best else COLOURS[4] if out else GREY
            marker = "x" if out else MARKERS[trackers.index(row.tracker) % len(MARKERS)]
            (x, x_bar), (y, y_bar) = ((some[0][place], some[1][:, [place]]) for some in (xs, ys))
            axes.errorbar(x, y, y_bar, x_bar, marker=marker, color=colour, ms=7 if best else 5.5, elinewidth=0.9,
                          capsize=2, mec=colour if out else "white", mew=1.5 if out else 0.6,
                          zorder=5 if best else 3)  # fmt: skip
            if best or len(front.rows) <= MOST_NAMES:
                name = ", ".join(map(label, row.values.values())) or row.tracker
                axes.annotate(name, (x, y), (6, 5), textcoords="offset points", fontsize=7.5,
                              color=INK if best else SOFT, zorder=6)  # fmt: skip
        at = list(front.best)
        axes.plot(xs[0][at], ys[0][at], "-", color=COLOURS[0], lw=1.2, alpha=0.6, zorder=2)
        for set_label, key, unit in ((axes.set_xlabel, front.x, x_unit), (axes.set_ylabel, front.y, y_unit)):
            figure_of = FIGURES[key]
            set_label(f"{figure_of.name}{f' [{unit}]' if unit else ''}   ({figure_of.better} is better)")
        axes.margins(0.12)
        if wide(xs[0]):
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
        y_scale(axes, [one for row in front.rows if (one := row.figures[front.y])], y_by)
        _key(figure, axes, front, trackers)
    return figure


def _ends(front: Front, key: str) -> tuple[tuple[Any, Any], str, float]:
    """((values, bars below and above them), unit, its size in the figure's own unit) of the rows."""
    estimates = [row.figures[key] for row in front.rows]
    scale, unit = scale_of(FIGURES[key].unit, [one.value for one in estimates if one])
    value, low, high = columns(estimates, scale)
    return (value, np.nan_to_num(np.vstack([value - low, high - value]))), unit, scale


def _key(figure: Figure, axes: Axes, front: Front, trackers: Sequence[str]) -> None:
    """The legend of colours and marks."""
    axes.plot([], [], "o-", color=COLOURS[0], label="Pareto front")
    axes.plot([], [], "o", color=GREY, label="dominated: another is no worse in either and better in one")
    if front.out:
        axes.plot([], [], "x", color=COLOURS[4], mew=1.5, label="half of the runs lost, or more")
    if len(trackers) > 1:
        for k, tracker in enumerate(trackers):
            axes.plot([], [], MARKERS[k % len(MARKERS)], color=SOFT, label=tracker)
    figure.legend(loc="outside upper left", ncols=2 if len(trackers) > 1 else 3)
