"""Figures 13 to 16 of Yang et al.: successes, and errors over speed, errors of places, and area."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.colours import PALETTE
from launcher.report.style import INK, SOFT
from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.published import PUBLISHED
from launcher.reproduce.papers.yang.scores import KINDS, mean_error, share_of
from launcher.reproduce.papers.yang.solved.solving import BOUND, ECPA, ECPA_ALL, ML, PLANE
from launcher.reproduce.papers.yang.tables import GROUPS, errors, quantity
from launcher.reproduce.papers.yang.trials.setups import FAIL, HULL, PLACES, RADII, SPEEDS

SHOWN: Final = (ECPA, ECPA_ALL, PLANE, ML)
_COLOURS: Final = dict(zip(SHOWN, (PALETTE[3], PALETTE[1], PALETTE[2], PALETTE[0]), strict=True))
_DASHES: Final = dict(zip(SHOWN, ("-", "--", "-.", "-"), strict=True))
MEAN_OF_NORMAL: Final = float(np.sqrt(2.0 / np.pi))
"""The mean of a normal error without its sign, in its sd: so the bound is drawn, where means are."""


def fig13(found: Found) -> Figure:
    """How often both algorithms are right, over the errors of times and places."""
    figure = Figure(figsize=(6.4, 3.4), layout="constrained")
    axes = figure.subplots()
    at = np.arange(len(FAIL))
    bars: Sequence[tuple[str, str, str]] = (
        ("cpa right", "CPA, told how the path divides the nodes", PALETTE[6]),
        (f"right {ECPA}", "ECPA", _COLOURS[ECPA]),
        ("ecpa in hull", "ECPA, path through the hull", SOFT),
    )
    for number, (name, label, colour) in enumerate(bars):
        shares = [share_of(found.figures[case][name]) for case in FAIL]
        place = at + 0.27 * (number - 1)
        values = [100 * one.value for one in shares]
        axes.bar(place, values, 0.25, color=colour, label=label, yerr=100 * _whiskers(shares), ecolor=INK, capsize=2)
    axes.axhline(10.0, color=INK, lw=0.9, ls=":", label="published: CPA at most 10 %, ECPA 100 %")
    axes.set_xticks(at, [case.replace(", ", "\n").replace("times ", "times ±") for case in FAIL])
    axes.set(ylabel="runs, %", ylim=(0, 104), title=f"right: within 5 m and 15 deg; {found.runs} runs")
    axes.grid(visible=False, axis="x")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def fig14(found: Found) -> Figure:
    """Errors over the speed."""
    return _sweep(found, GROUPS["velocity"], np.array(SPEEDS), "speed, m/s", "error of times falling with v^-3.3")


def fig15(found: Found) -> Figure:
    """Errors over those of the nodes' places."""
    return _sweep(found, GROUPS["places"], np.array(PLACES), "places off by up to, m", "30 mph, times off by 0.1 s")


def fig16(found: Found) -> Figure:
    """Errors over the area of the field."""
    area = HULL * np.square(RADII)
    return _sweep(
        found, GROUPS["area"], area, "area of the nodes' hull, m²", "error of times growing with the distance"
    )


def _sweep(found: Found, cases: Sequence[str], x: Any, label: str, title: str) -> Figure:
    figure = Figure(figsize=(8.0, 3.5), layout="constrained")
    panels = figure.subplots(1, len(KINDS))
    published = {value: PUBLISHED[case] for case, value in zip(cases, x.tolist(), strict=True) if case in PUBLISHED}
    for column, (axes, kind) in enumerate(zip(panels, KINDS, strict=True)):
        for name in SHOWN:
            if name == ECPA_ALL and kind != "location":
                continue  # that of ECPA
            some = [mean_error(errors(found, case, kind, name)) for case in cases]
            style: dict[str, Any] = {"color": _COLOURS[name], "ls": _DASHES[name], "lw": 1.3, "label": name}
            axes.errorbar(x, [one.value for one in some], _whiskers(some), capsize=2, marker="o", ms=3, **style)
        least = [MEAN_OF_NORMAL * np.sqrt(np.square(errors(found, case, kind, BOUND)).mean()) for case in cases]
        axes.plot(x, least, color=INK, lw=1.6, ls=":", label="bound (of a normal error)")
        told: Mapping[float, Any] = published
        axes.plot(list(told), [means[column] for means in told.values()], "X", color=INK, ms=6, label="published, ECPA")
        _from_zero(axes, label, f"mean error of {quantity(kind)}")
    figure.suptitle(f"{title}; {found.runs} runs")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _from_zero(axes: Axes, x: str, y: str) -> None:
    axes.set(xlabel=x, ylabel=y)
    axes.set_ylim(bottom=0.0)


def _whiskers(some: Sequence[Interval]) -> Any:
    """(2, n): how far the intervals reach below and above the figures."""
    return np.array(
        [
            [one.value - (one.value if one.low is None else one.low) for one in some],
            [(one.value if one.high is None else one.high) - one.value for one in some],
        ]
    )
