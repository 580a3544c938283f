"""Where the targets were: their paths so far, dotted with where they are now."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import rerun as rr

from launcher.records import FieldInfo, Truth
from launcher.timeline import look, rows
from launcher.timeline.layers.closeup import along
from launcher.timeline.scene import Add
from trackfield.role import NS


class Truths:
    """Hands the targets' paths to ``add`` as far as the run has come."""

    def __init__(self, info: FieldInfo, add: Add) -> None:
        self._add, self._origin_ns = add, info.origin_ns
        self._truths, self._drawn = info.truths, [0] * len(info.truths)
        for truth in info.truths:
            add(look.closeup_path(truth.target), rows.moves, 0, along(truth, 0))

    def until(self, until_s: float) -> None:
        """All up to a time since the first step."""
        for number, truth in enumerate(self._truths):
            while (drawn := self._drawn[number]) < len(truth.points) and truth.points[drawn][0] <= until_s:
                self._draw(truth, drawn)
                self._drawn[number] += 1

    def _draw(self, truth: Truth, index: int) -> None:
        t, x, y = truth.points[index]
        t_ns = self._origin_ns + round(t * NS)
        self._add(look.truth_path(truth.target, "position"), rows.points, t_ns, np.array([(x, y)]))
        self._add(look.closeup_path(truth.target), rows.moves, t_ns, along(truth, index))
        if index:
            before, *start = truth.points[index - 1]
            guessed = any(before < end and t > begin for begin, end in truth.gaps)
            path = look.truth_path(truth.target, "interpolated" if guessed else "path")
            self._add(path, rows.strips, t_ns, np.array([[start, (x, y)]]))


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How they look; several targets have their names beside them."""
    for truth in info.truths:
        yield look.truth_path(truth.target, "path"), look.line_style(look.TRUTH, 4.5, order=10)
        yield look.truth_path(truth.target, "interpolated"), look.line_style(look.INTERPOLATED, 4.5, order=10)
        position = look.point_style(look.TARGET, 3.5, order=60)
        if len(info.truths) == 1:
            yield look.truth_path(truth.target, "position"), position
        else:
            name = rr.Points2D.from_fields(labels=[truth.target], show_labels=True)
            yield look.truth_path(truth.target, "position"), position, name
