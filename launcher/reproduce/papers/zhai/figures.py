"""Figures 3 to 13 of Zhai et al. (2009), under its numbers, drawn from our runs; each tracker has its usual
colour, and a line and a mark of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.colours import tracker_colours
from launcher.report.style import SOFT, STYLE, TRUTH
from launcher.reproduce.intervals import Interval
from launcher.reproduce.papers.zhai.cases import CASES, NOMINALS, PARTICLES, nominals, particles
from launcher.reproduce.papers.zhai.tables import TABLE_1
from launcher.reproduce.realisation import Realisation, realise, typical
from launcher.reproduce.records import Records, errors_by_tracker
from launcher.reproduce.scores import Results, Score, rmse_over_time
from trackfield.filters.types import Array

COLOURS: Final = tracker_colours(("spcpf", "bootstrap", "ekf"))
LOOK: Final[Mapping[str, dict[str, Any]]] = {
    "truth": {"color": TRUTH, "label": "true target", "lw": 2.8, "alpha": 0.75, "zorder": 2},
    "spcpf": {"color": COLOURS["spcpf"], "label": "SP-CPF, 200 particles", "lw": 1.3, "zorder": 4},
    "bootstrap": {
        "color": COLOURS["bootstrap"],
        "label": "bootstrap, 2000 particles",
        "lw": 1.3,
        "ls": (0, (5, 1.5)),
        "zorder": 3,
    },
    "ekf": {"color": COLOURS["ekf"], "label": "EKF", "lw": 1.2, "ls": (0, (1, 1)), "zorder": 3},
}
LOOKS: Final[dict[Any, Any]] = {**STYLE, "axes.titlesize": 9, "figure.titlesize": 9, "legend.fontsize": 8}
BOTH: Final = ("spcpf", "bootstrap")


def draw(folder: Path, records: Records, results: Results[Score]) -> dict[str, int]:
    """Write figNN.png and sweeps.png into ``folder``; the seed of the typical run shown of each case."""
    shown = {"s1": BOTH, "s2": ("spcpf",), "s3": BOTH, "radar": ("spcpf", "bootstrap", "ekf")}
    seeds = {case: 1 + typical(CASES[case], records[case], names) for case, names in shown.items()}
    runs = {case: realise(CASES[case].only(*names), seeds[case]) for case, names in shown.items()}
    figures: dict[str, Callable[[], Figure]] = {
        "fig03": lambda: radar(runs["radar"]),
        "fig04": lambda: activated(seeds["s1"]),
        "fig05": lambda: rmses(records, results, "s1", BOTH),
        "fig06": lambda: locations(runs["s1"], "Scenario 1"),
        "fig07": lambda: motion(runs["s1"], "Scenario 1"),
        "fig08": lambda: rmses(records, results, "s2", ("spcpf",)),
        "fig09": lambda: locations(runs["s2"], "Scenario 2"),
        "fig10": lambda: motion(runs["s2"], "Scenario 2"),
        "fig11": lambda: locations(runs["s3"], "Scenario 3"),
        "fig12": lambda: motion(runs["s3"], "Scenario 3"),
        "fig13": lambda: rmses(records, results, "s3", BOTH),
        "sweeps": lambda: sweeps(results),
    }
    with mpl.rc_context(LOOKS):
        for name, figure in figures.items():
            figure().savefig(folder / f"{name}.png")
    return seeds


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def radar(run: Realisation) -> Figure:
    """Fig. 3: an aircraft, seen by one radar that measures directions only."""
    figure = _figure(7.2, 5.6)
    above, below = figure.subplots(2, 1, height_ratios=[1.15, 1.0])
    km = run.truth / 1e3
    above.plot(km[::3, 0], km[::3, 1], "+", color=TRUTH, ms=7, mew=1.4, label="true locations")
    for (name, estimate), mark in zip(run.estimates.items(), "o^*", strict=True):
        look = LOOK[name]
        above.plot(*estimate[:, :2].T / 1e3, mark, ms=4, ls="-", mfc="none", lw=0.9, color=look["color"],
                   label=look["label"], markevery=3)  # fmt: skip
        misses = np.linalg.norm(estimate[:, :2] - run.truth[1:, :2], axis=-1)
        below.plot(run.times[1:], misses, **look)
    above.plot(0, 0, "s", color="black", ms=6, label="radar")
    above.set(xlabel="east, km", ylabel="north, km", title=f"One radar, bearings only (seed {run.seed})")
    below.set(xlabel="time, s", ylabel="error of the position, m", ylim=(0, None))
    above.legend(ncols=2, loc="center", bbox_to_anchor=(0.5, 0.42))
    return figure


def activated(seed: int) -> Figure:
    """Fig. 4: the grid and the path, and the sensors that report at each threshold."""
    figure = _figure(7.2, 7.4)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).flat
    first = realise(CASES["s1"].only("spcpf"), seed)
    _field(next(panels), first, "(a) sensors and the true path", active=False)
    for letter, case, share in zip("bcd", ("s1-72", "s1", "s1-78"), (72, 75, 78), strict=True):
        run = realise(CASES[case].only("spcpf"), seed)
        title = f"({letter}) threshold {share} %: {len(run.active)} sensors report"
        axes = next(panels)
        _field(axes, run, title)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _field(axes: Axes, run: Realisation, title: str, *, active: bool = True) -> None:
    """Sensors, those among them that reported, and the true path."""
    axes.plot(*run.sensors.T, "o", color="#c3c8d0", ms=4, mew=0, label="sensors", zorder=1)
    if active:
        axes.plot(*run.active.T, "o", color="#e8a33d", ms=6, mew=0, label="reported", zorder=1.5)
    axes.plot(*run.truth[:, :2].T, **LOOK["truth"])
    axes.set(aspect="equal", title=title, xlabel="x, m", ylabel="y, m")
    axes.label_outer()


def locations(run: Realisation, title: str) -> Figure:
    """Figs. 6, 9 and 11: where the target was, and where it was thought to be."""
    figure = _figure(5.6, 6.3)
    axes = figure.subplots()
    _field(axes, run, f"{title}, 75 %, a typical run (seed {run.seed})")
    for name, estimate in run.estimates.items():
        axes.plot(*estimate[:, :2].T, marker=".", ms=3.5, **LOOK[name])
    low, high = run.sensors.min(axis=0) - 25, run.sensors.max(axis=0) + 25
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def motion(run: Realisation, title: str) -> Figure:
    """Figs. 7, 10 and 12: velocity, and acceleration as the difference of successive velocities."""
    figure = _figure(7.4, 5.0)
    panels = figure.subplots(2, 2, sharex=True)
    for column, axis in enumerate("xy"):
        lines = {"truth": run.truth[1:, 2 + column]}
        lines |= {name: estimate[:, 2 + column] for name, estimate in run.estimates.items()}
        for name, velocity in lines.items():
            panels[0, column].plot(run.times[1:], velocity, **LOOK[name])
            panels[1, column].plot(run.times[2:], np.diff(velocity) / run.step_s, **LOOK[name])
        panels[0, column].set(ylabel=f"velocity {axis}, m/s")
        panels[1, column].set(ylabel=f"acceleration {axis}, m/s²", xlabel="time, s")
    figure.suptitle(f"{title}, 75 %, a typical run (seed {run.seed})")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def rmses(records: Records, results: Results[Score], case: str, trackers: Sequence[str]) -> Figure:
    """Figs. 5, 8 and 13: RMSE(t) over all runs; in scenario 1 with the means in Table I."""
    figure = _figure(7.4, 3.3)
    panels = figure.subplots(1, 2, sharey=True)
    errors = errors_by_tracker(CASES[case], records[case])
    for tracker in trackers:
        over_time = rmse_over_time(errors[tracker])
        times: Array = np.arange(1, len(over_time) + 1, dtype=float)
        for column, axes in enumerate(panels):
            axes.plot(times, over_time[:, column], **LOOK[tracker])
            if case == "s1":
                published, colour = TABLE_1[tracker][("mean_x", "mean_y")[column]], LOOK[tracker]["color"]
                axes.axhline(published, color=colour, lw=0.9, ls=":")
                beside = 1.02 * times[-1]  # where no curve is
                axes.text(
                    *(beside, published, f"published\nmean {published:.1f}"),
                    **{"ha": "left", "va": "center", "fontsize": 7.5, "color": colour},
                    bbox={"fc": "white", "ec": "none", "pad": 0.5},
                )
                axes.set_xlim(right=1.25 * times[-1])
    for axis, axes in zip("xy", panels, strict=True):
        axes.set(xlabel="time, s", ylabel=f"RMSE {axis}, m")
        if len(trackers) > 1:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter("{x:g}")
        else:
            axes.set_ylim(0, None)
    figure.suptitle(f"Scenario {case[1]}, 75 %, {results.runs} runs")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def sweeps(results: Results[Score]) -> Figure:
    """The error over the size of the bank and over the number of particles, with its intervals."""
    figure = _figure(7.4, 3.2)
    left, right = figure.subplots(1, 2, sharey=True)
    scores = results.scores["s1"]
    for axes, sizes, name, label in (
        (left, NOMINALS, nominals, "filters in the bank, N"),
        (right, PARTICLES, particles, "particles, Ns"),
    ):
        found = [scores[name(size)] for size in sizes]
        for shift, figure_of, look in (
            (1.0, "position", {"fmt": "o-", "ms": 4, "color": COLOURS["spcpf"], "label": "all runs pooled"}),
            (1.03, "median_run", {"fmt": "s:", "ms": 4, "color": SOFT, "mfc": "none", "label": "median run"}),
        ):
            some = [one.interval(figure_of) for one in found]
            axes.errorbar(
                np.array(sizes) * shift, [one.value for one in some], _whiskers(some), capsize=2, lw=1.2, **look
            )
        axes.set_xlabel(label)
    left.axvspan(10, 20, color="#f3e3c8", zorder=0, label="the paper's range")
    right.set(xscale="log", xticks=PARTICLES[::2], xticklabels=map(str, PARTICLES[::2]))
    right.minorticks_off()
    left.margins(y=0.1)
    left.set(ylabel="RMSE of the position, m", ylim=(0, None))
    left.legend(loc="lower right")
    figure.suptitle(f"SP-CPF in scenario 1, 75 %, {results.runs} runs")
    return figure


def _whiskers(figures: Sequence[Interval]) -> Array:
    """How far each interval reaches below and above its figure (2, n); 0 where there is none."""
    return np.array(
        [
            (0.0, 0.0) if one.low is None or one.high is None else (one.value - one.low, one.high - one.value)
            for one in figures
        ]
    ).T
