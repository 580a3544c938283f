"""Figures 2 to 6 of Özfidan et al. (2018), under their numbers, and two of our own, drawn from our runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.colours import PALETTE
from launcher.report.style import INK, SOFT, STYLE, TRUTH
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.ozfidan.energies import ledger, spent_mj
from launcher.reproduce.papers.ozfidan.energy import CC2420, REPORTS, SLEEP
from launcher.reproduce.papers.ozfidan.experiments import (
    BOTH,
    FALLBACK,
    FAR_M,
    PAPER,
    PAPERS_POLICY,
    SWEEPS,
    each_rms,
)
from launcher.reproduce.papers.ozfidan.field import NOBODY, T, Truth, drawn
from launcher.reproduce.papers.ozfidan.scheduling import POLICIES
from launcher.reproduce.papers.ozfidan.tables import bound, error, median_run, of
from launcher.reproduce.papers.ozfidan.tracks import Tracks, followed
from trackfield.filters.types import Array

NAMES: Final = {"ukf": "UKF", "pf": "PF"}
COLOURS: Final = {"ukf": PALETTE[1], "pf": PALETTE[4]}
MARKS: Final = {"ukf": "o", "pf": "^"}
STRICT: Final = PALETTE[4]
LOOKS: Final[dict[Any, Any]] = {**STYLE, "axes.titlesize": 9, "figure.titlesize": 9, "legend.fontsize": 8}
_PALE: Final = "#c3c8d0"
_AROUND_M: Final = 400.0


class Run(NamedTuple):
    """One run of the paper's policy: its seed, what is true in it, and the tracks of both filters."""

    seed: int
    truth: Truth
    tracks: dict[str, Tracks]


def draw(folder: Path, found: Found) -> None:
    """Write all of them into ``folder``."""
    with mpl.rc_context(LOOKS):
        run = typical(found)
        path(run, "pf").savefig(folder / "fig02.png")
        path(run, "ukf").savefig(folder / "fig03.png")
        activated(run).savefig(folder / "fig04.png")
        over_time(found, "pf").savefig(folder / "fig05.png")
        over_time(found, "ukf").savefig(folder / "fig06.png")
        against_energy(found).savefig(folder / "energy.png")
        swept(found).savefig(folder / "sweeps.png")


def typical(found: Found) -> Run:
    """The run in which PF has its median error, with the paper's policy."""
    each = each_rms(of(found, PAPERS_POLICY, "pf", "errors"))
    seed = 1 + int(np.argsort(each)[(len(each) - 1) // 2])
    return Run(seed, drawn(PAPER, [seed]), {kind: followed(PAPER, PAPERS_POLICY, kind, [seed]) for kind in BOTH})


def path(run: Run, kind: str) -> Figure:
    """Figs. 2 and 3: true and estimated path; beside it a part of it, as they lie on each other."""
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    true = run.truth.path[0, 1:, :2]
    estimate = true + run.tracks[kind].errors[0, :, :2]
    for axes, steps in zip(figure.subplots(1, 2), (slice(None), slice(0, 60)), strict=True):
        _field(axes, run, kind)
        axes.plot(*true[steps].T, color=TRUTH, lw=3.2, alpha=0.75, label="true path")
        axes.plot(*estimate[steps].T, color=COLOURS[kind], lw=1.1, label=f"estimate of {NAMES[kind]}")
        whole = steps == slice(None)
        _framed(axes, true[steps], _AROUND_M if whole else 10.0)
        axes.set(xlabel="x, m", box_aspect=1.0, title="1000 steps" if whole else "the first 60 steps")
    figure.axes[0].set_ylabel("y, m")
    figure.suptitle(f"{PAPERS_POLICY}, seed {run.seed}, the median of PF's errors")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _field(axes: Axes, run: Run, kind: str) -> None:
    used = run.tracks[kind].awake[0].any(axis=0)
    axes.plot(*run.truth.slaves[0, ~used].T, "o", color=_PALE, ms=3.0, mew=0, label="slave")
    axes.plot(*run.truth.slaves[0, used].T, "o", color="#e8a33d", ms=4.5, mew=0, label="slave, awake at some time")
    axes.plot(*run.truth.masters[0].T, "^", color=SOFT, ms=4.5, mew=0, label="master")


def _framed(axes: Axes, some: Array, around_m: float) -> None:
    """Show a square around these places."""
    low, high = some.min(axis=0), some.max(axis=0)
    centre, half = (low + high) / 2.0, float((high - low).max()) / 2.0 + around_m
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))


def activated(run: Run) -> Figure:
    """Fig. 4: which slaves were awake, on the map with their masters, and over the steps with either filter."""
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    on_map, over_steps = figure.subplots(1, 2)
    awake, truth = run.tracks["pf"].awake[0], run.truth
    _field(on_map, run, "pf")
    for slave in np.flatnonzero(awake.any(axis=0) & (truth.owner[0] != NOBODY)):
        ends = np.stack((truth.slaves[0, slave], truth.masters[0, truth.owner[0, slave]]))
        on_map.plot(*ends.T, color="#e8a33d", lw=0.9, zorder=1)
    on_map.plot(*truth.path[0, :, :2].T, color=TRUTH, lw=2.0, label="true path")
    on_map.set(xlabel="x, m", ylabel="y, m", box_aspect=1.0, title=f"{PAPERS_POLICY}, seed {run.seed}, PF")
    either = np.any([run.tracks[kind].awake[0] for kind in BOTH], axis=0)
    shown = np.array(sorted(np.flatnonzero(either.any(axis=0)), key=lambda slave: int(either[:, slave].argmax())))
    for kind, size in (("ukf", 5.0), ("pf", 1.6)):
        step, row = np.nonzero(run.tracks[kind].awake[0][:, shown])
        style: dict[str, Any] = {"color": COLOURS[kind], "ms": size, "mew": 0, "label": NAMES[kind]}
        over_steps.plot(T * (step + 1), row, "s", **style)
    over_steps.set(xlabel="time, s", ylabel="slave", title="awake at each step", yticks=range(len(shown)))
    over_steps.set_yticklabels([f"{number}" for number in shown], fontsize=7)
    over_steps.legend(loc="lower left", bbox_to_anchor=(0.0, -0.27), ncols=2, markerscale=2.0)
    on_map.legend(loc="upper left", bbox_to_anchor=(0.0, -0.13), ncols=2)
    return figure


def over_time(found: Found, kind: str) -> Figure:
    """Figs. 5 and 6: rms errors over the runs, in x and in y."""
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    fallback, strict = (of(found, name, kind, "errors") for name in (FALLBACK, PAPERS_POLICY))
    kept = np.linalg.norm(strict, axis=-1).max(axis=1) <= FAR_M
    lines = [(f"{FALLBACK}, {len(fallback)} runs", fallback, COLOURS["ukf"], "-")]
    if kept.any():
        label = f"{PAPERS_POLICY}, {kept.sum()} of {len(kept)} runs: those never over {FAR_M:g} m"
        lines.append((label, strict[kept], STRICT, (0, (4, 1.5))))  # type: ignore[arg-type]
    for axis, axes in enumerate(figure.subplots(1, 2, sharey=True)):
        for label, errors, colour, dash in lines:
            rms = np.sqrt(np.square(errors[..., axis]).mean(axis=0))
            axes.plot(T * np.arange(1, len(rms) + 1), rms, color=colour, ls=dash, lw=0.9, label=label)
        axes.set(xlabel="time, s", title=f"{NAMES[kind]}, error in {'xy'[axis]}")
    figure.axes[0].set_ylabel("rms over the runs, m")
    figure.axes[0].set_ylim(bottom=0.0)  # now that both have their lines
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def against_energy(found: Found) -> Figure:
    """The median run's error over the energy of a step, of each policy and filter."""
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    colours = dict(zip(POLICIES, PALETTE, strict=False))
    for axes, by in zip(panels, (REPORTS, SLEEP), strict=True):
        for name in POLICIES:
            mj = float(spent_mj(ledger(found, name), CC2420, by).mean())
            for kind in BOTH:
                style: dict[str, Any] = {"color": colours[name], "mfc": colours[name] if kind == "ukf" else "none"}
                value = median_run(found, name, kind).value
                axes.plot([mj], [value], MARKS[kind], ms=6, ls="", label=f"{name}, {NAMES[kind]}", **style)
        axes.set(xscale="log", yscale="log", xlabel="mJ in a step", title=f"CC2420, {by}")
        for which in (axes.xaxis, axes.yaxis):
            which.set_major_formatter("{x:g}")
            which.set_minor_formatter("")
        axes.set_yticks([0.5, 1.0, 1.5, 2.0, 2.5])
    panels[1].set_xticks([10.0, 20.0, 50.0])
    panels[0].set_ylabel("error of the median run, m")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def swept(found: Found) -> Figure:
    """The error and the bound over what is swept, with the intervals."""
    figure = Figure(figsize=(8.0, 3.3), layout="constrained")
    panels = figure.subplots(1, len(SWEEPS), sharey=True)
    for axes, (what, (_, sizes)) in zip(panels, SWEEPS.items(), strict=True):
        some = [error(found, f"{what} {n}", "ukf") for n in sizes]
        whiskers = [[one.value - (one.low or one.value), (one.high or one.value) - one.value] for one in some]
        at, values = np.array(sizes, float), [one.value for one in some]
        style: dict[str, Any] = {"color": COLOURS["ukf"], "marker": "o", "ms": 3.5, "capsize": 2, "lw": 1.3}
        axes.errorbar(at, values, np.array(whiskers).T, label=f"UKF, {FALLBACK}", **style)
        axes.plot(at, [bound(found, f"{what} {n}").value for n in sizes], "_", color=INK, ms=9, label="bound")
        axes.set(xlabel={"capacity": "slaves for a master, at most"}.get(what, what), xticks=sizes)
    panels[0].set_ylabel("error, m")
    panels[0].set_ylim(bottom=0.0)  # now that all have their lines
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
