"""How the pictures of a study look: colours, marks, units, scales."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.report.style import STYLE
from launcher.study.intervals import Estimate

COLOURS: Final = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9")
"""The colours of combinations (Okabe and Ito); where only trackers differ, they have their own."""
MARKERS: Final = "osD^vP"
WIDE: Final = 30.0
"""Values whose largest is at least so many times the least are shown on a logarithmic scale."""


def colour_of(place: int, of: int) -> Any:
    """The colour of the combination at this place of ``of``."""
    return COLOURS[place] if of <= len(COLOURS) else mpl.colormaps["viridis"](place / (of - 1))


class Picture(Figure):
    """A figure that a notebook shows."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()


@contextmanager
def styled() -> Iterator[None]:
    """Figures made inside look like those of reports."""
    with mpl.rc_context():
        mpl.rcParams.update(STYLE)
        yield


def columns(estimates: Sequence[Estimate | None], scale: float) -> tuple[Any, Any, Any]:
    """Values and ends of their intervals, (n,) each; NaN where there is none."""

    def floats(name: str) -> Any:
        found = (getattr(one, name) if one else None for one in estimates)
        return np.array([np.nan if value is None else value / scale for value in found])

    return floats("value"), floats("low"), floats("high")


def wide(values: Sequence[float]) -> bool:
    """Whether a logarithmic scale shows them better."""
    return len(values) > 0 and min(values) > 0 and max(values) >= WIDE * min(values)


def y_scale(axes: Axes, estimates: Sequence[Estimate], scale: float) -> None:
    """From 0 on, or logarithmic, with plain numbers."""
    values = [one.value / scale for one in estimates]
    if wide(values):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        return
    most = max([0.0, *values, *(one.high / scale for one in estimates if one.high is not None)])
    axes.set_ylim(*((-0.04 * most, 1.08 * most) if most else (-0.04, 1.0)))
