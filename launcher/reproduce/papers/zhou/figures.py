"""Figures 1 to 4 of Zhou et al. (2011), under their numbers, and four of our own, drawn from our runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from launcher.colours import PALETTE
from launcher.report.style import INK, SOFT, STYLE, TRUTH
from launcher.reproduce.kernels.draws import generators
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.zhou.costs import swept_error
from launcher.reproduce.papers.zhou.experiments import FILTERS, SWEEPS
from launcher.reproduce.papers.zhou.setups import DT, SETUPS, neighbours, world
from launcher.reproduce.papers.zhou.tables import PUBLISHED, bound, bound_over_time, errors
from launcher.reproduce.scores import rmse_over_time

_COLOURS: Final = dict(zip(FILTERS, (*PALETTE[2:5], PALETTE[0], PALETTE[1], PALETTE[6], PALETTE[5]), strict=True))
_DASHES: Final = dict(zip(FILTERS, ("--", "-.", "-", "-", "-", (0, (1, 1)), "--"), strict=True))
FEW_TICKS: Final = 5.0
"""Axes that reach less far than this ratio may have only one or two of 1, 2 and 5."""
LOOKS: Final[dict[Any, Any]] = {**STYLE, "axes.titlesize": 9, "figure.titlesize": 9, "legend.fontsize": 8}


def look(name: str) -> dict[str, Any]:
    """How a filter's line looks."""
    return {"color": _COLOURS[name], "ls": _DASHES[name], "lw": 1.3, "label": name}


def draw(folder: Path, found: Found) -> None:
    """Write all of them into ``folder``."""
    with mpl.rc_context(LOOKS):
        for column, name in enumerate(("x, m", "y, m", "vx, m/s", "vy, m/s")):
            over_time(found, column, name).savefig(folder / f"fig{column + 1:02}.png")
        setups(found).savefig(folder / "setups.png")
        particles(found).savefig(folder / "particles.png")
        track().savefig(folder / "track.png")
        runs(found).savefig(folder / "runs.png")


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def logarithmic(axes: Axes) -> None:
    """A logarithmic scale with plain numbers at 1, 2 and 5 of each decade, or at each digit if these are too few."""
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high > FEW_TICKS * low else range(1, 10)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")


def over_time(found: Found, column: int, name: str) -> Figure:
    """Figs. 1 to 4: RMSE(t) of one coordinate, of PF and UPF, and of a sound one."""
    figure = _figure(5.6, 3.3)
    axes = figure.subplots()
    for which in ("bootstrap-100", "upf-paper", "gpf-ukf"):
        curve = rmse_over_time(errors(found, "paperlike", which))[:, column]
        steps = DT * np.arange(1, len(curve) + 1)
        axes.plot(steps, curve, **look(which))
        if which in PUBLISHED:
            value = PUBLISHED[which][column]
            axes.axhline(value, color=_COLOURS[which], lw=0.9, ls=":")
            style: dict[str, Any] = {"ha": "right", "va": "bottom", "fontsize": 7.5, "color": _COLOURS[which]}
            axes.text(1.2 * steps[-1], value, f"published {value:g}", **style)
    axes.set(xlabel="time, s", ylabel=f"RMSE {name}", title=f"paperlike, {found.runs} runs")
    axes.set_xlim(right=1.2 * steps[-1])
    logarithmic(axes)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def setups(found: Found) -> Figure:
    """RMSE(t) of the position, of all filters."""
    figure = _figure(8.0, 3.6)
    panels = figure.subplots(1, len(SETUPS))
    for axes, (case, setup) in zip(panels, SETUPS.items(), strict=True):
        for name in FILTERS:
            curve = np.sqrt(np.square(rmse_over_time(errors(found, case, name))[:, :2]).sum(axis=-1))
            axes.plot(np.arange(1, len(curve) + 1), curve, **look(name))
        least = bound_over_time(found.figures[case], setup)
        axes.plot(np.arange(1, len(least) + 1), least, color=INK, lw=1.6, label="bound")
        axes.set(xlabel="time, s", title=case)
        logarithmic(axes)
    panels[0].set_ylabel("RMSE of the position, m")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def particles(found: Found) -> Figure:
    """The error over the number of particles, with its intervals."""
    figure = _figure(8.0, 3.6)
    panels = figure.subplots(1, len(SETUPS))
    names: Mapping[str, str] = {"bootstrap": "bootstrap-100"}
    for axes, (case, setup) in zip(panels, SETUPS.items(), strict=True):
        for kind, (_, sizes) in SWEEPS.items():
            some = [swept_error(found, case, kind, n) for n in sizes]
            style = {**look(names.get(kind, kind)), "label": kind}
            whiskers = [[one.value - (one.low or one.value), (one.high or one.value) - one.value] for one in some]
            axes.errorbar(
                np.array(sizes), [one.value for one in some], np.array(whiskers).T, capsize=2, marker="o", ms=3, **style
            )
        axes.axhline(bound(found, case, setup), color=INK, lw=1.6, label="bound")
        axes.set(xlabel="particles", title=case, xscale="log")
        axes.xaxis.set_major_formatter("{x:g}")
        logarithmic(axes)
    panels[0].set_ylabel("RMSE of the position, m")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def track(seed: int = 1) -> Figure:
    """A run on walk and on sharp: the nodes, those of a cluster at some time, the path, and estimates of it."""
    figure = _figure(8.0, 4.9)
    panels = figure.subplots(1, 2)
    for axes, case in zip(panels, ("walk", "sharp"), strict=True):
        setup = SETUPS[case]
        told = world(setup, [seed])
        truth = told.truth[0]
        nodes = np.unique(neighbours(setup, [seed], told.truth[..., :2])[0].reshape(-1, 2), axis=0)
        members = np.unique(np.concatenate([some.positions[0] for some in told.reports]), axis=0)
        axes.plot(*nodes.T, "o", color="#c3c8d0", ms=3.5, mew=0, label="nodes")
        axes.plot(*members.T, "o", color="#e8a33d", ms=5, mew=0, label="in a cluster")
        axes.plot(*truth[:, :2].T, color=TRUTH, lw=2.8, alpha=0.75, label="true path")
        for name in ("bootstrap-100", "upf-paper", "gpf-ukf"):
            estimates = FILTERS[name](setup.prior, told.reports, setup.model, generators([seed], name))
            axes.plot(*estimates.mean[0, :, :2].T, **{**look(name), "lw": 1.1})
        _framed(axes, truth[:, :2])
        axes.set(box_aspect=1.0, title=f"{case} (seed {seed})", xlabel="x, m")
    panels[0].set_ylabel("y, m")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _framed(axes: Axes, path: np.ndarray[Any, np.dtype[np.float64]]) -> None:
    """Show a square around the path."""
    low, high = path.min(axis=0), path.max(axis=0)
    centre, half = (low + high) / 2.0, float((high - low).max()) / 2.0 + 15.0
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))


def runs(found: Found) -> Figure:
    """Over each error, the share of runs whose RMSE is below it."""
    figure = _figure(8.0, 3.4)
    panels = figure.subplots(1, len(SETUPS), sharey=True)
    for axes, (case, setup) in zip(panels, SETUPS.items(), strict=True):
        for name in FILTERS:
            each = np.sort(np.sqrt(np.square(errors(found, case, name)[..., :2]).sum(axis=-1).mean(axis=1)))
            axes.step(each, np.arange(1, len(each) + 1) / len(each), where="post", **look(name))
        axes.axvline(setup.sense_m, color=SOFT, lw=0.9, ls=":", label="range of a node")
        axes.set(xlabel="RMSE of a run, m", title=case, xscale="log", ylim=(0, 1))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    panels[0].set_ylabel("share of runs")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
