"""The effect of a varied key on the main figures, as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.colours import tracker_colours
from launcher.record.figures.verdict import TRACKED
from launcher.report.style import INK, SOFT, WIDTH
from launcher.study.axes import TRACKER, Axis, in_words, label
from launcher.study.figures import ERROR, FIGURES, scale_of
from launcher.study.intervals import Estimate
from launcher.study.pictures.look import COLOURS, MARKERS, Picture, colour_of, columns, styled, wide, y_scale
from launcher.study.summary import Row, Summary

MOST_LINES: Final = len(COLOURS)
"""The most combinations of the other axes in one picture."""
_PANELS: Final = (
    *(TRACKED, ERROR, "latency_ms.to_track.p95", "energy_j.total", "lifetime_s.first_death", "frames.lost"),
    *("longest_blackout_s", "median_error"),
)
"""The figures that may be shown; the first ones with values are."""
MOST_PANELS: Final = 6


@dataclass(frozen=True)
class Line:
    """A line of a picture: the rows at the values of its axis, in their order; ``None`` where there is none."""

    name: str
    colour: str
    marker: str
    rows: tuple[Row | None, ...]


def lines(summary: Summary, axis: Axis) -> tuple[list[Line], dict[str, Any]]:
    """A line for each combination of other axes and tracker; if too many, some axes are held at their first value."""
    others = [other for other in summary.own_axes if other.key != axis.key]
    held: dict[str, Any] = {}
    while len(others) > 1 and np.prod([len(other.values) for other in others]) > MOST_LINES:
        last = others.pop()
        held[last.key] = last.values[0]
    by_tracker = axis.key == TRACKER and len(summary.own_axes) > 0
    found = {
        (_key(row.values, others), None if by_tracker else row.tracker, label(_at(row, axis))): row
        for row in summary.rows
        if all(row.values[key] == value for key, value in held.items())
    }
    keys, every = [other.key for other in others], product(*(other.values for other in others))
    combinations = [dict(zip(keys, some, strict=True)) for some in every]
    trackers = (None,) if by_tracker else summary.trackers
    made = []
    for i, values in enumerate(combinations):
        for k, tracker in enumerate(trackers):
            rows = tuple(found.get((_key(values, others), tracker, label(value))) for value in axis.values)
            named = tracker if tracker and (len(trackers) > 1 or not values) else ""
            own = tracker_colours(summary.trackers)[tracker] if tracker and not values else None
            name, mark = ", ".join(filter(None, [in_words(values), named])), MARKERS[k % len(MARKERS)]
            if any(rows):
                made.append(Line(name, own or colour_of(i, len(combinations)), mark, rows))
    return made, held


def _key(values: Mapping[str, Any], axes: Sequence[Axis]) -> tuple[str, ...]:
    return tuple(label(values[axis.key]) for axis in axes)


def _at(row: Row, axis: Axis) -> Any:
    return row.tracker if axis.key == TRACKER else row.values[axis.key]


def axis_picture(summary: Summary, axis: Axis) -> Picture:
    """The effect of an axis on the share of tracked runs, error, latency, energy, lifetime and losses."""
    panels = [key for key in _PANELS if key == TRACKED or summary.told(key)][:MOST_PANELS]
    drawn, held = lines(summary, axis)
    with styled():
        height = 2.25 * ((len(panels) + 1) // 2) + 0.55
        figure = Picture(figsize=(WIDTH, height), layout="constrained")
        grid = figure.subplots((len(panels) + 1) // 2, 2, squeeze=False, sharex=True).ravel()
        for axes in grid[len(panels) :]:
            axes.remove()
        for axes, key in zip(grid, panels, strict=False):
            _panel(axes, axis, key, drawn)
        for axes in grid[: len(panels)][-2:]:  # the last of each column
            axes.set_xlabel(axis.key)
            axes.tick_params(labelbottom=True)
        if held or (len(drawn) > 1 and (axis.key != TRACKER or summary.own_axes)):
            _legend(figure, grid[0], held)
    return figure


def _panel(axes: Axes, axis: Axis, key: str, drawn: Sequence[Line]) -> None:
    name, unit, better = ("runs tracked", "%", "more") if key == TRACKED else _words(key)
    estimates = [[_estimate(row, key) for row in line.rows] for line in drawn]
    scale, unit = scale_of(unit, [one.value for some in estimates for one in some if one])
    apart = _apart(axis, drawn)
    for number, (line, some) in enumerate(zip(drawn, estimates, strict=True)):
        at = np.array(axis.values if axis.numeric else range(len(axis.values)), float)
        at += apart * ((number + 0.5) / len(drawn) - 0.5)
        value, low, high = columns(some, scale)
        bars = np.vstack([value - low, high - value])
        style = "-" if axis.numeric else ""
        axes.errorbar(
            at, value, np.nan_to_num(bars), ls=style, marker=line.marker, color=line.colour, label=line.name,
            ms=4.5, lw=1.5, elinewidth=1.1, capsize=2.5, mec="white", mew=0.6,
        )  # fmt: skip
        if axis.numeric and len(drawn) == 1:
            axes.fill_between(at, low, high, color=line.colour, alpha=0.12, lw=0)
    axes.set_title(f"{name} [{unit}]" if unit else name, loc="left", fontsize=9, color=INK)
    axes.set_title(f"{better} is better", loc="right", fontsize=7.5, color=SOFT)
    _scales(axes, axis)
    if key == TRACKED:
        axes.set_ylim(-4.0, 104.0)
    else:
        y_scale(axes, [one for some in estimates for one in some if one], scale)


def _apart(axis: Axis, drawn: Sequence[Line]) -> float:
    """How far apart the lines are drawn at a value of the axis, so that their bars do not cover each other."""
    if all(sum(row is not None for row in rows) < 2 for rows in zip(*(line.rows for line in drawn), strict=True)):
        return 0.0
    if not axis.numeric:
        return 0.5
    values = sorted(axis.values)
    return 0.0 if wide(values) else 0.12 * min(b - a for a, b in pairwise(values))


def _words(key: str) -> tuple[str, str, str]:
    figure = FIGURES[key]
    return figure.name, figure.unit, figure.better


def _estimate(row: Row | None, key: str) -> Estimate | None:
    if row is None:
        return None
    if key != TRACKED:
        return row.figures[key]
    share = row.share(TRACKED)
    if share is None:
        return None
    return Estimate(
        100 * share.value,
        None if share.low is None else 100 * share.low,
        None if share.high is None else 100 * share.high,
        share.runs,
    )


def _scales(axes: Axes, axis: Axis) -> None:
    if not axis.numeric:
        axes.set_xticks(range(len(axis.values)), [label(value) for value in axis.values])
        axes.set_xlim(-0.6, len(axis.values) - 0.4)
        if sum(len(label(value)) for value in axis.values) > 42:
            axes.tick_params(axis="x", labelrotation=20)
        return
    if wide(axis.values):
        axes.set_xscale("log")
    axes.set_xticks(axis.values, [label(value) for value in axis.values])
    axes.minorticks_off()


def _legend(figure: Figure, axes: Axes, held: Mapping[str, Any]) -> None:
    handles, names = axes.get_legend_handles_labels()
    title = f"at {in_words(held)}" if held else None
    columns = max(1, min(len(names), 110 // (max(map(len, names)) + 6)))
    figure.legend(handles, names, loc="outside upper left", ncols=columns, title=title, alignment="left")
