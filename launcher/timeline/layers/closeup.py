"""The close-up of each target: a frame that moves with it, large enough for the estimates of the trackers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import rerun as rr

from launcher.records import FieldInfo, Truth
from launcher.timeline import look, rows
from launcher.timeline.scene import Add, spacing

WIDE: Final = 1.9
"""Width of the close-up over its height."""
_ELLIPSES: Final = 2.0
"""Height of the close-up over the length of the 95 % region of an estimate."""
_LEAST_M: Final = 0.5
ROW: Final = 6
"""Entries in a row of its legend."""


def size(points: np.ndarray[Any, np.dtype[np.float64]], truth: tuple[float, float] | None) -> float:
    """How far from the target a close-up has to reach (m) for the outline (n, 2) of an estimate and the target."""
    if truth is None:
        return _ELLIPSES * float(np.max(np.ptp(points, axis=0))) / 2
    return max(_ELLIPSES * float(np.max(np.ptp(points, axis=0))) / 2, 1.2 * math.dist(points.mean(axis=0), truth))


def zoomed(before: float, needed: float) -> float:
    """From the middle of a close-up to its upper edge (m): powers of two, so that it rarely changes."""
    needed = max(needed, _LEAST_M)
    return before if before / 4 < needed <= before else 2.0 ** math.ceil(math.log2(needed))


class Closeups:
    """Hands to ``add`` how far from the middle of each close-up its edge is, as that changes."""

    def __init__(self, info: FieldInfo, add: Add) -> None:
        self._add = add
        xs, ys = zip(*look.field_points(info), strict=True)
        self._most = max(max(xs) - min(xs), max(ys) - min(ys), 1.0)
        near = spacing(info)
        start = zoomed(math.inf, 0.6 * near if near > 1 else self._most / 8)
        self._halves = dict.fromkeys((truth.target for truth in info.truths), start)
        for target, half in self._halves.items():
            self._draw(target, half, 0)

    def until(self, t_ns: int, sizes: dict[tuple[str, ...], float]) -> int:
        """Adapt close-ups to ``sizes`` (the first of each key is the target): to the median of its trackers."""
        for target, before in self._halves.items():
            known = sorted(size for (of, *_), size in sizes.items() if of == target)
            if not known:
                continue
            half = zoomed(before, min(known[(len(known) - 1) // 2], self._most))
            if half != before:
                self._halves[target] = half
                self._draw(target, half, t_ns)
        return len(self._halves)

    def _draw(self, target: str, half: float, t_ns: int) -> None:
        self._add(look.closeup_path(target, "zoom"), rows.scales, t_ns, half)
        self._add(look.closeup_path(target, "zoom", "scale"), rows.bars, t_ns, scale_bar(half))


def scale_bar(half: float) -> tuple[float, str]:
    """The length of a bar in a close-up whose upper edge is 1 from its middle, and its label."""
    power = 10.0 ** math.floor(math.log10(half))
    metres = max(step * power for step in (0.5, 1, 2, 5) if step * power <= half)
    return metres / half, f"{metres / 1000:g} km" if metres >= 1000 else f"{metres:g} m"


def along(truth: Truth, index: int) -> tuple[float, float]:
    """Where the close-up of a target is at a point of its path; views of the whole have y down."""
    _, x, y = truth.points[index]
    return x, -y


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How its scale and legend look."""
    entries = [("true path", look.TRUTH), *((name, look.tracker_colour(info, name)) for name in info.trackers)]
    wide = min(len(entries), ROW)
    step = min(0.72, 1.95 * WIDE / wide)
    at = [
        (step * (index % ROW + 0.5 - min(wide, len(entries) - index // ROW * ROW) / 2), -0.93 + 0.25 * (index // ROW))
        for index in range(len(entries))
    ]
    names = [name for name, _ in entries]
    for truth in info.truths:
        zoom = look.closeup_path(truth.target, "zoom")
        yield zoom + "/scale", look.line_style(look.INFO, 2.5, order=70)
        yield from look.legend(zoom + "/legend", at, names, [colour for _, colour in entries], 0.03)
