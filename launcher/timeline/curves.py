"""Curves over time: where they break, and the axis that keeps them clear of the legend."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from launcher.records import FieldInfo
from launcher.timeline import rows
from launcher.timeline.look import path as entity
from launcher.timeline.scene import Add
from trackfield.role import NS

GAP: Final = 1.5
"""A curve breaks where it has no value for this many of its intervals."""
BINS: Final = 100
PLOT: Final = (320.0, 140.0)
"""Width and height of a plot in a window of normal size."""
HIGHEST: Final = 0.65
"""The share of a plot that a legend may take."""
_ENTRY: Final = (45.0, 5.5, 14.0, 22.0)
"""The size of a legend: width, plus width per letter; height, plus height per entry."""


@dataclass(frozen=True, slots=True)
class Axis:
    """The y axis of a plot, from 0 to ``top``, and where its legend is; one of many entries is not shown."""

    top: float
    left: bool = False
    legend: bool = True


def axis_of(highest: npt.NDArray[np.float64], labels: Sequence[str], size: tuple[float, float] = PLOT) -> Axis:
    """How to draw a plot of this width and height; ``highest`` (n,) is of its curves, in equal parts of the time."""
    width = (_ENTRY[0] + _ENTRY[1] * max(map(len, labels))) / size[0]
    height = (_ENTRY[2] + _ENTRY[3] * len(labels)) / size[1]
    some = math.ceil(width * len(highest))
    whole = 1.05 * float(np.max(highest)) or 1.0
    if height > HIGHEST:
        return Axis(whole, legend=False)
    tops = [max(whole, float(np.max(beside)) / (1 - height)) for beside in (highest[-some:], highest[:some])]
    return Axis(min(tops), left=tops[1] < tops[0])


class Curves:
    """Hands values of curves to ``add`` as they come; those of a curve come in order of time."""

    def __init__(self, info: FieldInfo, add: Add) -> None:
        self._info, self._add = info, add
        self._last: dict[str, tuple[int, tuple[float, ...]]] = {}
        self._highest: dict[str, npt.NDArray[np.float64]] = {}

    def value(self, parts: tuple[str, ...], t_ns: int, values: tuple[float, ...], every_ns: int) -> None:
        """Add values of a plot (or of one curve in it, whose name follows that of the plot), expected ``every_ns``."""
        path, limit_ns = entity("plots", *parts), round(GAP * every_ns)
        since_ns, before = self._last.get(path, (t_ns, values))
        if t_ns - since_ns > limit_ns:
            self._add(path, rows.scalars, since_ns + limit_ns, (math.nan,) * len(values))
            since_ns, before = t_ns, values
        self._last[path] = (t_ns, values)
        self._add(path, rows.scalars, t_ns, values)
        highest = self._highest.setdefault(parts[0], np.zeros(BINS))
        some = slice(self._bin(min(since_ns, t_ns)), self._bin(t_ns) + 1)
        highest[some] = np.maximum(highest[some], max(*before, *values))

    def axis(self, plot: str, labels: Sequence[str]) -> Axis | None:
        """How to draw a plot whose legend has these labels; None of one without values."""
        return axis_of(self._highest[plot], labels) if plot in self._highest else None

    def _bin(self, t_ns: int) -> int:
        whole_ns = self._info.origin_ns + self._info.end_s * NS
        return min(max(int(t_ns / max(whole_ns, 1.0) * BINS), 0), BINS - 1)
