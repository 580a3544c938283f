"""What the layouts have in common that are laid out only where a target comes near."""

from __future__ import annotations

from math import ceil, floor
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from trackfield.errors import ScenarioError
from trackfield.scenario.layouts.layout import Ground, SpacedSection, check_number, numbered
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Distance
from trackfield.world.path import Path
from trackfield.world.windows import Array, distances

MOST_PLACES: Final = 2_000_000
"""Places of the grid that are looked at, to find those near a path."""

Cells = NDArray[np.int64]
"""(n, 2): columns and rows of squares of ``spacing_m``; (0, 0) has its south-west corner at (0, 0)."""


class NearPathSection(SpacedSection):
    """A layout without an end, of which only the places near the targets' paths have a sensor.

    ``enough`` is the part of ``spacing_m`` from which on ``within_m`` has some sensor near any path, in words.
    """

    enough: ClassVar[str]

    within_m: Distance = Field(default=150.0, description="a place has a sensor if a path comes within this distance")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """The places within reach of a path, or the ``nodes`` places nearest to one."""
        within, paths = self.within_m, ground.known_paths(self.layout)
        points, far = self._near(paths, within, ground.seed)
        if self.nodes is not None:
            while len(points) < self.nodes:
                within *= 2.0
                points, far = self._near(paths, within, ground.seed)
            points = points[np.argsort(far, kind="stable")[: self.nodes]]
        if not len(points):
            raise ScenarioError(
                "no sensors: the path comes near none of the grid's places",
                key="field.within_m",
                expected=f"more than {self.enough} of {self.spacing_m:g} m",
            )
        check_number(len(points))
        return numbered(points[np.lexsort(points.T)]), None  # by y, then x

    def near(self, cells: Cells, path: Path, within: float, seed: int) -> tuple[Array, Array]:
        """The places in ``cells`` (n, 2) within reach of a path, (m, 2) in order, and their distances (m,)."""
        raise NotImplementedError

    def _near(self, paths: tuple[Path, ...], within: float, seed: int) -> tuple[Array, Array]:
        """The places within reach of a path, (n, 2) by y, then x, and their distances (n,)."""
        found = [self.near(self._around(path, within), path, within, seed) for path in paths]
        points, far = np.vstack([one for one, _ in found]), np.concatenate([one for _, one in found])
        order = np.lexsort([far, *points.T])
        points, far = points[order], far[order]
        new = np.append(True, (points[1:] != points[:-1]).any(axis=1))[: len(points)]
        return points[new], far[new]

    def _around(self, path: Path, within: float) -> Cells:
        """All cells of the rectangle around a path and what is within reach of it."""
        spacing = self.spacing_m
        axes = [
            (floor((min(c) - within) / spacing) - 1, ceil((max(c) + within) / spacing) + 1) for c in (path.x, path.y)
        ]
        check_number((axes[0][1] - axes[0][0]) * (axes[1][1] - axes[1][0]), MOST_PLACES)
        columns, rows = (np.arange(*axis) for axis in axes)
        return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def within_reach(points: Array, path: Path, within: float) -> tuple[Array, Array]:
    """Those of ``points`` (n, 2) that a path comes within this distance of, and their distances."""
    far = distances(points, path, within)
    return points[np.isfinite(far)], far[np.isfinite(far)]
