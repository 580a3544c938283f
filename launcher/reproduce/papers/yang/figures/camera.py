"""Targets in the picture of a camera at (30, -25) over the delay until control has the fix; not in the paper."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from launcher.colours import PALETTE
from launcher.report.style import INK
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.camera import whole
from launcher.reproduce.papers.yang.camera.aimed import ACROSS, ANY, DELAYS, FAST, NEAR, camera_case
from launcher.reproduce.papers.yang.camera.tables import PROTOTYPE, TOLD, share_of_passes, share_seen
from launcher.reproduce.papers.yang.scores import mean_error
from launcher.reproduce.papers.yang.trials.field import SPEED

_CURVES: Final = (
    ("A to C", "with", NEAR, PALETTE[0], "-", "A to C, with prediction"),
    ("A to C", "with", ACROSS, PALETTE[2], "-", "the same, pan 0 is north"),
    (ANY, "with", NEAR, PALETTE[1], "-", "any line, with prediction"),
    ("A to C", "without", NEAR, PALETTE[0], "--", "A to C, without"),
    (ANY, "without", NEAR, PALETTE[1], "--", "any line, without"),
)
_POINTS: Final = {
    SPEED: ((whole.WITH, PALETTE[0]), (whole.WITHOUT, PALETTE[0]), (whole.TWICE, PALETTE[3])),
    FAST: ((whole.FASTER, PALETTE[0]), (whole.FASTER_ACROSS, PALETTE[2])),
}
_LABELS: Final = {whole.WITH: "with roles, A to C", whole.TWICE: "with roles, three slow hops"}


def camera(found: Found) -> Figure:
    """At 30 mph and at 30 m/s: trials as lines, whole runs as squares at their delay, the prototype as crosses."""
    figure = Figure(figsize=(8.6, 4.4), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, speed in zip(panels, (SPEED, FAST), strict=True):
        for line, way, view, colour, dashes, label in _CURVES:
            shares = [share_seen(found, camera_case(line, speed), way, view, delay) for delay in DELAYS]
            axes.plot(DELAYS, [one.value for one in shares], dashes, color=colour, lw=1.4, label=label)
            ends = np.array([(one.low, one.high) for one in shares], float).T
            axes.fill_between(DELAYS, *ends, color=colour, alpha=0.12, lw=0)
        for way, mark in (("with", "x"), ("without", "+")):
            if told := PROTOTYPE.get((way, NEAR, speed)):
                axes.plot(TOLD, told, mark, color=INK, ms=6, label=f"prototype, {way}")
        if whole.done(found):
            _points(axes, found, speed)
        axes.set(title=f"{speed:.3g} m/s, camera at (30, -25)", xlabel="delay from the last CPA, s", ylim=(-0.04, 1.06))
    panels[0].set_ylabel("targets in the picture")
    panels[0].yaxis.set_major_formatter(PercentFormatter(1.0))
    unique: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        unique |= dict(zip(labels, handles, strict=True))
    figure.legend(list(unique.values()), list(unique), loc="outside lower center", ncols=3)
    return figure


def _points(axes: Axes, found: Found, speed: float) -> None:
    for name, colour in _POINTS[speed]:
        share, delay = share_of_passes(found, name), mean_error(found.figures[name]["delay"]).value
        below, above = (abs(share.value - (share.value if end is None else end)) for end in share[1:])
        style: dict[str, Any] = {"color": colour, "mec": INK, "ecolor": INK, "ms": 6, "capsize": 2, "lw": 1.0}
        axes.errorbar([delay], [share.value], [[below], [above]], fmt="s", label=_LABELS.get(name), **style)
