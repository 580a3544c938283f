"""What a fit leaves of each report: against distance, against time, and by sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from launcher.calibrate.samples import Floats, Ints
from launcher.calibrate.sensors import SensorFit
from launcher.colours import PALETTE

_BANDS: Final = 8
"""Bands of distance with equally many reports, of which the mean is drawn."""
_MOST_NAMED: Final = 40
"""Of more sensors only some have their ids below."""
_INK: Final = "#1f2733"
_SOFT: Final = "#7c8796"


def draw(fit: SensorFit, file: Path) -> None:
    """Write the picture of a fit's residuals. Raises ``OSError`` if it cannot be written."""
    with mpl.rc_context({"axes.spines.right": False, "axes.spines.top": False, "font.size": 9}):
        figure = Figure(figsize=(10, 6.2), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplot_mosaic([["near", "late"], ["own", "own"]])
        near, late, own = (panels[name] for name in ("near", "late", "own"))
        _by_distance(near, fit)
        _by_time(late, fit)
        _by_sensor(own, fit)
        most = 1.05 * float(np.abs(fit.residual).max())
        for axes in (near, late, own):
            axes.axhline(0.0, color=_SOFT, lw=0.8, zorder=1)
            axes.set(ylim=(-most, most), ylabel=f"residual, {fit.unit}")
            axes.grid(alpha=0.25)
            axes.set_axisbelow(True)
        figure.savefig(file, format=file.suffix.lstrip(".").lower() or "png")


def _by_distance(axes: Axes, fit: SensorFit) -> None:
    """All, and mean and sd in bands with equally many."""
    away, off = fit.reports.distance_m, fit.residual
    axes.plot(away, off, ".", ms=3, alpha=0.4, mew=0, color=PALETTE[1])
    bands = np.array_split(np.argsort(away, kind="stable"), _BANDS)
    middles = np.array([away[band].mean() for band in bands])
    means, sds = (np.array([getattr(off[band], name)() for band in bands]) for name in ("mean", "std"))
    axes.errorbar(middles, means, sds, fmt="o-", ms=4, lw=1.4, capsize=2, color=_INK, label="mean and sd")
    axes.set(title="by distance", xlabel="distance, m")
    axes.legend(frameon=False, loc="upper right")


def _by_time(axes: Axes, fit: SensorFit) -> None:
    """A colour for each recording, and the mean over all sensors at each instant."""
    reports = fit.reports
    for number, name in enumerate(reports.files):
        mine = reports.recording == number
        colour = PALETTE[(1, 0, 3, 2, 4, 5)[number % 6]]
        t_s, off = reports.t_s[mine], fit.residual[mine]
        axes.plot(t_s, off, ".", ms=3, alpha=0.4, mew=0, color=colour)
        axes.plot(*_means(reports.instant[mine], t_s, off), lw=1.2, color=colour, label=f"{name}, mean of an instant")
    axes.set(title="by time", xlabel="time of the recording, s")
    axes.legend(frameon=False, loc="upper right", fontsize=7.5)


def _means(instant: Ints, t_s: Floats, off: Floats) -> tuple[Floats, Floats]:
    _, number = np.unique(instant, return_inverse=True)
    count = np.bincount(number)
    return np.bincount(number, t_s) / count, np.bincount(number, off) / count


def _by_sensor(axes: Axes, fit: SensorFit) -> None:
    """A box for each sensor: quartiles and median, whiskers to 1.5 times their distance, and what is beyond."""
    ids = fit.reports.ids
    each = [fit.residual[fit.reports.sensor == number] for number in range(len(ids))]
    boxes = axes.boxplot(
        each,
        patch_artist=True,
        flierprops={"marker": ".", "ms": 3, "mew": 0, "mfc": PALETTE[1], "alpha": 0.5},
        medianprops={"color": _INK, "lw": 1.4},
        whiskerprops={"color": _SOFT},
        capprops={"color": _SOFT},
    )
    for box in boxes["boxes"]:
        box.set(facecolor="#e4eef7", edgecolor=_SOFT)
    every = -(-len(ids) // _MOST_NAMED)
    shown = range(0, len(ids), every)
    axes.set_xticks(
        [number + 1 for number in shown], [ids[number] for number in shown], rotation=30 if len(ids) > 8 else 0
    )
    axes.set_title("by sensor")
