"""Figure 12 of Yang et al.: the paths that were computed in eight runs, beside the true ones."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.colours import PALETTE
from launcher.report.style import INK, TRUTH
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.trials.field import Setup
from launcher.reproduce.papers.yang.whole.roles import DIRECTIONS, WAYS
from launcher.reproduce.papers.yang.whole.tables import BEST, PUBLISHED
from trackfield.filters.types import Array

SEEDS: Final = 2
HALF_M: Final = 38.0
_TRUE: Final = (((0.0, 0.0), 87.0), ((0.0, -13.0), 128.0))
"""A point (m) and the heading (deg) of A to C and of B to D, from the point (3608558, 641359) of Table 1."""


def fig12(found: Found) -> Figure:
    """Two passes in each direction: as the paper computes them, and by the fit and maximum likelihood."""
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, way in zip(panels, (PUBLISHED, BEST), strict=True):
        for through, heading in _TRUE:
            e = np.array([np.sin(np.radians(heading)), np.cos(np.radians(heading))])
            line = np.array(through)[:, None] + np.outer(e, [-2 * HALF_M, 2 * HALF_M])
            axes.plot(*line, color=TRUTH, lw=3.0, alpha=0.6, label="true path")
        case, tracker = WAYS[way]
        means = found.figures[case][f"fix {tracker}"][:SEEDS]
        for number, direction in enumerate(DIRECTIONS):
            for mean in means[:, number]:
                if not np.isnan(mean).any():
                    _path(axes, mean, PALETTE[number], direction)
        axes.plot(*Setup().places.T, "o", color=INK, ms=4, label="nodes", ls="")
        axes.set(title=way, xlabel="east, m", xlim=(-HALF_M, HALF_M), ylim=(-HALF_M, HALF_M), box_aspect=1.0)
    panels[0].set_ylabel("north, m")
    unique: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        unique |= dict(zip(labels, handles, strict=True))
    figure.legend(list(unique.values()), list(unique), loc="outside lower center", ncols=6)
    return figure


def _path(axes: Axes, mean: Array, colour: str, label: str) -> None:
    """A dashed line along a fix, with an arrow at its end."""
    e = mean[2:] / np.linalg.norm(mean[2:])
    middle = mean[:2] - (mean[:2] @ e) * e
    begin, end = middle - 26.0 * e, middle + 26.0 * e
    style: dict[str, Any] = {"color": colour, "lw": 1.2, "ls": "--"}
    axes.plot(*np.stack([begin, end], axis=-1), label=label, **style)
    before = end - 2.0 * e
    axes.annotate("", (end[0], end[1]), (before[0], before[1]), arrowprops={"arrowstyle": "->", "color": colour})
