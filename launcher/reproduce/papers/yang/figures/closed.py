"""Figures 2, 3, 4 and 8 of Yang et al., from their closed forms."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from launcher.report.style import INK
from launcher.reproduce.papers.yang.trials.sensitivity import (
    PAPER,
    C,
    angle_error,
    crossing_error,
    distance_error,
)
from trackfield.filters.types import Array

WHITE: Final = 10.0
"""Degrees: within the white regions of fig. 4 the error is smaller."""
RUN: Final = (120.0, 87.0)
"""alpha and phi (deg) of a configuration of the field experiments (sec. 3.2.2)."""
_COLOURS: Final = "viridis"


def fig02() -> Figure:
    """Eq. 22: the error of r over that of the time and the angle between r and r_k."""
    time_s, angle = np.linspace(-0.1, 0.1, 201), np.radians(np.linspace(-90.0, 90.0, 181))
    error = np.abs(distance_error(PAPER.place_m, time_s, angle[:, None], PAPER.speed / C))
    figure, axes = _panel("|error of r|, m", time_s, np.degrees(angle), error, np.arange(0, 60, 5))
    axes.set(xlabel="error of a CPA time, s", ylabel="β - φ, deg", title="Eq. 22: place 2 m off, 10 m/s")
    axes.locator_params(axis="x", nbins=5)
    return figure


def _angles() -> tuple[Array, Array]:
    """Degrees (361,), and the error of phi (deg) for each phi and alpha: (361, 361), at most 150."""
    grid = np.arange(361.0)
    error = np.degrees(np.abs(angle_error(np.radians(grid), np.radians(grid)[:, None])))
    return grid, np.minimum(np.nan_to_num(error, posinf=150.0), 150.0)


def fig03() -> Figure:
    """Eq. 24 as a surface."""
    grid, error = _angles()
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    axes: Any = figure.add_subplot(projection="3d")
    axes.plot_surface(*np.meshgrid(grid, grid), error, cmap=_COLOURS, lw=0, rcount=120, ccount=120)
    axes.set(xlabel="α, deg", ylabel="φ, deg", zlabel="|error of φ|, deg", title="Eq. 24, cut off at 150 deg")
    axes.set_box_aspect(None, zoom=0.88)
    return figure


def fig04() -> Figure:
    """The same as contours, with the white regions and the configuration of a field run."""
    grid, error = _angles()
    figure, axes = _panel("|error of φ|, deg", grid, grid, error, [WHITE, 20, 30, 60, 90, 150], low="white")
    axes.plot(*RUN, "o", color=INK, ms=4)
    told = float(np.degrees(angle_error(*np.radians(RUN))))
    axes.annotate(f"{told:.3f} deg", RUN, (0, 6), textcoords="offset points", ha="center", fontsize=7.5)
    axes.set(xlabel="α, deg", ylabel="φ, deg", title="Eq. 24: white below 10 deg")
    return figure


def fig08() -> Figure:
    """Eq. 37: the bound on the error of r_1 over the distance of the nodes and the error of a strength."""
    apart, strength = np.linspace(0.0, 20.0, 101), np.linspace(0.0, 0.5, 101)
    error = crossing_error(apart, strength[:, None])
    figure, axes = _panel("bound on the error of r₁, m", apart, 100 * strength, error, np.arange(1, 6.5, 0.5))
    for share in (0.5, 0.2):
        value = float(crossing_error(np.array(20.0), np.array(share)))
        axes.annotate(f"{value:g} m", (20.0, 100 * share), (-6, -4), textcoords="offset points", ha="right", va="top")
    axes.set(xlabel="distance of the two nodes, m", ylabel="error of a strength, %", title="Eq. 37: place 2 m off")
    return figure


def _panel(told: str, x: Array, y: Array, z: Array, levels: Any, *, low: str | None = None) -> tuple[Figure, Any]:
    """A figure of filled contours with a colour bar; what is below the lowest level has the colour ``low``."""
    figure = Figure(figsize=(5.2, 3.9), layout="constrained")
    axes = figure.subplots()
    colours = colormaps[_COLOURS].with_extremes(under=low)
    drawn = axes.contourf(x, y, z, levels=levels, cmap=colours, extend="both" if low else "neither")
    figure.colorbar(drawn, ax=axes, label=told)
    axes.grid(visible=False)
    return figure, axes
