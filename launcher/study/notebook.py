"""A finished run as a notebook shows it: the verdict on each track, in a table with links to the rest."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path

from launcher.record.figures.measures import RunFigures, TrackerFigures
from launcher.record.figures.verdict import told
from launcher.report.cells import NOTHING, number
from launcher.report.page import PAGE

_HEAD = ("tracker", "verdict", "RMSE [m]", "median [m]", "steps with a track", "blackout [s]")


def run_html(folder: Path, metrics: RunFigures) -> str:
    """The headline figures of a run, and where its report and its files are."""
    head = "".join(f"<th>{escape(name)}</th>" for name in _HEAD)
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in _row(*item))}</tr>" for item in metrics.trackers.items()
    )
    frames = metrics.frames
    link = escape(os.path.relpath(folder / PAGE), quote=True)
    report = f'<a href="{link}" target="_blank">report</a>, ' if (folder / PAGE).exists() else ""
    return (
        f"<p><b>{escape(metrics.scenario)}</b>, seed {metrics.seed}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        f"<p>{frames.delivered} of {frames.expected} frames arrived. {report}"
        f"folder <code>{escape(str(folder))}</code></p>"
    )


def _row(name: str, figures: TrackerFigures) -> tuple[str, ...]:
    return (
        name,
        told(figures.model_dump(include={"verdict"})),
        number(figures.rmse.position),
        number(figures.median_error),
        f"{figures.steps_tracked} of {figures.steps_expected}" if figures.steps_expected else NOTHING,
        number(figures.longest_blackout_s),
    )
