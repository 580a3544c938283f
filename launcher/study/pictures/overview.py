"""A run in one picture: the field with the tracks in it, and their errors over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from launcher.report.folder import Run, read_run
from launcher.report.style import TRUTH, WIDTH, colour
from launcher.report.tracks import Array, Track
from launcher.study.pictures.look import Picture, styled, wide
from trackfield.role import NS

POINTS = 400
"""Points of a true path."""


def overview(folder: Path) -> Picture:
    """The picture of a finished run. Raises ``ScenarioError`` for any other folder."""
    run = read_run(folder)
    with styled():
        figure = Picture(figsize=(WIDTH, 3.9), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
        _field(left, run)
        _errors(right, run)
        handles = {name: handle for handle, name in zip(*left.get_legend_handles_labels(), strict=True)}
        figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=len(handles))
    return figure


def _field(axes: Axes, run: Run) -> None:
    axes.plot(*np.array(list(run.sensors.values())).T, "o", ms=2.5, color="#c3cad4", label="sensor")
    for path in run.site.paths.values():
        way = [path.at(t) or (np.nan,) * 4 for t in np.linspace(path.start_s, path.end_s, POINTS)]
        axes.plot(*np.array(way)[:, :2].T, color=TRUTH, lw=5, alpha=0.45, label="true path")
    for track in run.tracks:
        places = _broken(track, run, track.mean[:, :2])
        axes.plot(*places.T, color=colour(run, track.tracker), lw=1.5, label=track.tracker)
    axes.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")


def _errors(axes: Axes, run: Run) -> None:
    for track in run.tracks:
        times, errors = _broken(track, run, np.column_stack([track.t_s, track.error_m])).T
        axes.plot(times, errors, color=colour(run, track.tracker), lw=1.5)
    known = np.concatenate([track.error_m for track in run.tracks] or [np.ones(1)])
    known = known[np.isfinite(known) & (known > 0)]
    if wide(np.quantile(known, [0.05, 1.0]).tolist() if len(known) else []):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
    else:
        axes.set_ylim(bottom=0.0)
    axes.set(xlim=(0.0, run.end_s), xlabel="emulated time [s]", ylabel="position error [m]")


def _broken(track: Track, run: Run, values: Array) -> Array:
    """(T + gaps, 2) the values, with a row of NaN wherever steps are missing, so that a line ends there."""
    after = np.flatnonzero(np.diff(track.t_s) > 1.5 * run.site.step_ns / NS) + 1
    broken: Array = np.insert(values, after, np.nan, axis=0)
    return broken
