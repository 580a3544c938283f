"""Several runs in one recording: their tracks and errors over each other on one timeline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from launcher.report.folder import Run, read_run
from launcher.report.parts.field import IN_A_STEP
from launcher.study.comparison.lines import MOST_RUNS, Line, colours, lines
from launcher.study.comparison.runs import Compared
from launcher.timeline.overlay import Overlaid, Way, write_overlay


def write_recording(compared: Compared, file: Path) -> None:
    """Write it, over an existing file; of the first ``MOST_RUNS`` runs, as more cannot be told apart."""
    runs, names = [read_run(folder) for folder in compared.folders[:MOST_RUNS]], compared.names[:MOST_RUNS]
    found = lines(runs, names)
    sensors = {place for run in runs for place in run.sensors.values()}
    ways = [way for group in compared.groups if group[0] < MOST_RUNS for way in _ways(compared, runs, group[0])]
    name = " and ".join(names)
    write_overlay(
        file, name, np.array(sorted(sensors)).reshape(-1, 2), ways, [_overlaid(line, found) for line in found]
    )


def _overlaid(line: Line, found: Sequence[Line]) -> Overlaid:
    track, look = line.track, line.look(colours(found), dark=True)
    return Overlaid(
        track.tracker,
        line.name,
        track.t_s,
        track.mean[:, :2],
        track.covariance,
        track.error_m,
        look["color"],
        look["lw"],
    )


def _ways(compared: Compared, runs: Sequence[Run], place: int) -> list[Way]:
    """The paths of the targets of a run, for all runs with the same targets."""
    run, ways = runs[place], []
    for target, path in run.site.paths.items():
        times = np.linspace(path.start_s, path.end_s, IN_A_STEP * run.site.steps + 1)
        states = [(t, *state[:2]) for t in times if (state := path.at(t))]
        t_s, *at = np.array(states).T
        name = target if len(compared.groups) == 1 else f"{target} of {compared.names[place]}"
        ways.append(Way(name, t_s - run.origin_s, np.column_stack(at)))
    return ways
