"""The summary of a study as a table: for a terminal, a page and a notebook."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from launcher.record.figures.verdict import LOST, TRACKED, WITH_GAPS
from launcher.report.cells import NOTHING
from launcher.study.axes import label
from launcher.study.figures import FIGURES, scale_of
from launcher.study.intervals import FEWEST
from launcher.study.summary import Row, Summary

COLUMNS: Final = {
    "rmse.position": "RMSE",
    "median_error": "median",
    "longest_blackout_s": "blackout",
    "latency_ms.to_track.p95": "latency, 95 %",
    "energy_j.total": "energy",
    "lifetime_s.first_death": "battery empty",
    "frames.lost": "frames lost",
    "camera.in_frame.at_aim": "in picture",
}
"""Figures in the table, if any row has them."""
_WITH_INTERVAL: Final = ("tracked", "RMSE")
"""Columns that have intervals in a terminal."""
_FIRST_TO_GO: Final = (
    *(
        "median",
        "blackout",
        "with gaps",
        "latency, 95 %",
        "frames lost",
        "lost",
        "battery empty",
        "energy",
        "in picture",
    ),
)
"""Columns that are left out in a narrow terminal, in this order."""
_ANY: Final = 10_000
"""Columns of text, more than any table has."""


@dataclass(frozen=True)
class Cell:
    """A figure in words, and its interval if there is one."""

    text: str
    interval: str = ""

    def __str__(self) -> str:
        return f"{self.text} ({self.interval})" if self.interval else self.text


@dataclass(frozen=True)
class Grid:
    """A table: its head, and a row for each combination and tracker; the first ``names`` columns say which."""

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    names: int


def grid(summary: Summary) -> Grid:
    """The table with intervals; a single tracker has no column if any key is varied."""
    shown = [key for key in COLUMNS if summary.told(key)]
    axes, scales = summary.own_axes, {key: _scale(summary, key) for key in shown}
    tracker = not axes or len(summary.trackers) > 1
    head = (
        *(axis.key for axis in axes),
        *(["tracker"] if tracker else []),
        *("tracked", "with gaps", "lost"),
        *(f"{COLUMNS[key]}{f' [{unit}]' if unit else ''}" for key, (_, unit) in scales.items()),
    )
    rows = tuple(
        (
            *(Cell(label(row.values[axis.key])) for axis in axes),
            *([Cell(row.tracker)] if tracker else []),
            *(_share(row, verdict) for verdict in (TRACKED, WITH_GAPS, LOST)),
            *(_cell(row, key, by) for key, (by, _) in scales.items()),
        )
        for row in summary.rows
    )
    return Grid(head, rows, len(axes) + tracker)


def _scale(summary: Summary, key: str) -> tuple[float, str]:
    means = [row.figures[key] for row in summary.rows]
    return scale_of(FIGURES[key].unit, [one.value for one in means if one])


def _share(row: Row, verdict: str) -> Cell:
    share = row.share(verdict)
    if share is None:
        return Cell(NOTHING)
    ends = "" if share.low is None or share.high is None else f"{100 * share.low:.0f}–{100 * share.high:.0f}"
    return Cell(f"{100 * share.value:.0f} %", ends)


def _cell(row: Row, key: str, by: float) -> Cell:
    estimate = row.figures[key]
    if estimate is None:
        return Cell(NOTHING)
    digits = _digits(estimate.value / by)
    value, low, high = (
        None if end is None else f"{end / by:,.{digits}f}" for end in (estimate.value, estimate.low, estimate.high)
    )
    short = f" of {estimate.runs}" if estimate.runs < row.runs else ""
    known = low is not None and high is not None and not low == value == high
    return Cell(f"{value}{short}", f"{low}–{high}" if known else "")


def _digits(value: float) -> int:
    """The decimals with which a figure has about three digits."""
    return int(np.clip(2 - np.floor(np.log10(value)), 0, 4)) if value > 0 else 0


def caption(summary: Summary) -> str:
    """How the intervals are computed, or why there are none."""
    runs = len(summary.seeds)
    if not summary.estimated:
        return f"Means over {runs} run{'s' * (runs != 1)}: too few for intervals, which need {FEWEST}."
    return (
        f"Means over {runs} runs (RMSE: of the runs' own RMSE), with 95 % confidence intervals: Student's t for means, "
        "Wilson's for shares of runs."
    )


def rich_table(summary: Summary, console: Console) -> Table:
    """For a terminal: the columns that fit into its width, with intervals of the share of tracked runs and the RMSE."""
    whole = grid(summary)
    left_out: list[str] = []
    table = _drawn(whole, left_out, caption(summary))
    for name in _FIRST_TO_GO:
        if _width(table, console) <= console.width:
            break
        left_out.append(name)
        table = _drawn(whole, left_out, f"{caption(summary)} study.html has more columns.")
    return table


def _drawn(whole: Grid, left_out: Sequence[str], said: str) -> Table:
    table = Table(caption=said, caption_justify="left", box=box.SIMPLE_HEAD)
    places = [place for place, name in enumerate(whole.head) if name.partition(" [")[0] not in left_out]
    for place in places:
        name = whole.head[place].replace(" [", "\n[").replace(".", ".\n")
        table.add_column(name, justify="left" if place < whole.names else "right", no_wrap=True)
    for row in whole.rows:
        cells = ((row[place], whole.head[place].partition(" [")[0] in _WITH_INTERVAL) for place in places)
        table.add_row(*(str(cell) if ends else cell.text for cell, ends in cells))
    return table


def _width(table: Table, console: Console) -> int:
    return Measurement.get(console, console.options.update(max_width=_ANY), table).maximum


def html_table(summary: Summary) -> str:
    """For a notebook, with all intervals."""
    whole = grid(summary)
    head = "".join(f"<th>{html.escape(name)}</th>" for name in whole.head)
    rows = "".join(f"<tr>{''.join(_html(cell) for cell in row)}</tr>" for row in whole.rows)
    said = html.escape(caption(summary))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table><p><small>{said}</small></p>"


def _html(cell: Cell) -> str:
    ends = f"<br><small>{html.escape(cell.interval)}</small>" if cell.interval else ""
    return f"<td>{html.escape(cell.text)}{ends}</td>"
