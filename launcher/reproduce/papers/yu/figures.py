"""Figures 2 and 3 of Yu et al. (2009), under its numbers, drawn from our runs, and two targets that cross."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from launcher.colours import tracker_colours
from launcher.report.style import SOFT, STYLE, TRUTH
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yu import messages
from launcher.reproduce.papers.yu.experiments import CROSSING_PARTICLES, SENSORS, crossing
from launcher.reproduce.papers.yu.roles import BASE, R, places_of
from launcher.reproduce.papers.yu.runs import PLAIN
from launcher.reproduce.papers.yu.truth import TURNS, drawn
from trackfield.filters.types import Array

NAMES: Final = ("rbpf", "mrbpf", "jm-rbpf")
COLOURS: Final = tracker_colours(NAMES)
LABELS: Final = {"rbpf": "RBPF", "mrbpf": "MRBPF, Table 1", "jm-rbpf": "JM-RBPF"}
DASHES: Final[Mapping[str, Any]] = {"rbpf": (0, (5, 1.5)), "mrbpf": "-", "jm-rbpf": (0, (1, 1))}
OF: Final = {"": "", R: ", through roles"}
LOOKS: Final[dict[Any, Any]] = {**STYLE, "axes.titlesize": 9, "figure.titlesize": 9, "legend.fontsize": 8}


def draw(folder: Path, found: Found) -> None:
    """Write the figures into a folder."""
    with mpl.rc_context(LOOKS):
        for name, figure in {"fig02": over_time, "fig03": typical_run, "crossing": two_targets}.items():
            figure(found).savefig(folder / f"{name}.png")
        if messages.done(found):
            over_time(found, R).savefig(folder / "fig02-roles.png")
            typical_run(found, R).savefig(folder / "fig03-roles.png")


def over_time(found: Found, among: str = "") -> Figure:
    """Fig. 2: RMSE(t) (12), on a logarithmic scale, since the errors are so different; of runs through roles or not."""
    figure = Figure(figsize=(7.2, 3.8), layout="constrained")
    axes = figure.subplots()
    for name in NAMES:
        errors = found.figures[f"{among}{name}"]["errors"]
        rmse = np.sqrt(np.nanmean(np.square(errors).sum(axis=-1), axis=0))
        axes.plot(_steps(rmse), rmse, color=COLOURS[name], ls=DASHES[name], lw=1.5, label=LABELS[name])
    bounds = found.figures[BASE]["bound"] if among else found.figures["bound"][f"{SENSORS[0]}"]
    least = np.sqrt(np.square(bounds).mean(axis=0))
    axes.plot(_steps(least), least, color=TRUTH, lw=1.0, label="bound, modes known")
    for first, last, _ in TURNS:
        axes.axvspan(first, last, color=SOFT, alpha=0.25, lw=0)
    axes.set(
        xlabel="time, s",
        ylabel="RMSE of the position, m",
        yscale="log",
        title=f"{len(bounds)} runs{OF[among]}; turns shaded",
    )
    axes.legend(ncols=2)
    return figure


def typical_run(found: Found, among: str = "") -> Figure:
    """Fig. 3: the run in which MRBPF has its median error, of those that RBPF loses if it loses any."""
    figure = Figure(figsize=(6.4, 5.6), layout="constrained")
    axes = figure.subplots()
    run = _typical(found, among)
    places = places_of(run + 1) if among else drawn(PLAIN, [run + 1]).places[0]
    truth = found.figures[f"{among}rbpf"]["truth"][run]
    axes.plot(*places.T, ".", color=SOFT, ms=4, label="sensors")
    axes.plot(*truth.T, color=TRUTH, lw=3.0, alpha=0.6, label="true path")
    for name in NAMES:
        track = truth + found.figures[f"{among}{name}"]["errors"][run]
        axes.plot(*track.T, color=COLOURS[name], ls=DASHES[name], lw=1.4, label=LABELS[name])
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal", title=f"Run {run + 1}{OF[among]}")
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def two_targets(found: Found) -> Figure:
    """The run with the median error, with the most particles."""
    figure = Figure(figsize=(6.0, 5.4), layout="constrained")
    axes = figure.subplots()
    most = max(CROSSING_PARTICLES)
    one = found.figures[crossing(most)]
    run = _median(np.square(one["means"] - one["truth"]).mean(axis=(1, 2, 3)))
    for k, colour in enumerate((COLOURS["mrbpf"], COLOURS["jm-rbpf"])):
        axes.plot(*one["truth"][run, k].T, color=TRUTH, lw=3.0, alpha=0.5, label="true paths" if k == 0 else None)
        axes.plot(*one["means"][run, k].T, color=colour, lw=1.4, label=f"track {k + 1}")
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal", title=f"Run {run + 1}, {most} particles")
    axes.legend()
    return figure


def _steps(values: Array) -> Array:
    return np.arange(1.0, len(values) + 1.0)


def _typical(found: Found, among: str) -> int:
    """The index of a run."""
    errors = (found.figures[f"{among}{name}"]["errors"] for name in ("mrbpf", "rbpf"))
    own, other = (np.nanmean(np.square(one), axis=(1, 2)) for one in errors)
    gone = np.flatnonzero(other > np.median(other))
    some = gone if len(gone) else np.arange(len(own))
    return int(some[_median(own[some])])


def _median(values: Array) -> int:
    """Where the median of values (R,) is, the lower one of two."""
    return int(np.argsort(values)[(len(values) - 1) // 2])
