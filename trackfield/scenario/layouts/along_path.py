"""The layout ``along-path``."""

from __future__ import annotations

from math import ceil, floor
from typing import Final, Literal

import numpy as np
from pydantic import Field

from trackfield.errors import ScenarioError
from trackfield.scenario.layouts.layout import Ground, SpacedSection, check_number, numbered
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Distance
from trackfield.world.path import Path
from trackfield.world.windows import Array, distances

MOST_PLACES: Final = 2_000_000
"""Places of the grid that are looked at, to find those near a path."""


class AlongPath(SpacedSection):
    """A grid, with only the places near the targets' paths."""

    layout: Literal["along-path"] = Field(
        default="along-path", description="a grid, but only where a target comes near"
    )
    within_m: Distance = Field(default=150.0, description="a place has a sensor if a path comes within this distance")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """The places within reach of a path, or the ``nodes`` places nearest to one.

        The grid is shifted by half its spacing, so that no sensor stands where a path begins.
        """
        within, paths = self.within_m, ground.known_paths(self.layout)
        points, far = self._near(paths, within)
        if self.nodes is not None:
            while len(points) < self.nodes:
                within *= 2.0
                points, far = self._near(paths, within)
            points = points[np.argsort(far, kind="stable")[: self.nodes]]
        if not len(points):
            raise ScenarioError(
                "no sensors: the path comes near none of the grid's places",
                key="field.within_m",
                expected=f"more than half the spacing of {self.spacing_m:g} m",
            )
        check_number(len(points))
        return numbered(points[np.lexsort(points.T)]), None  # by y, then x

    def _near(self, paths: tuple[Path, ...], within: float) -> tuple[Array, Array]:
        """The places of the shifted grid within reach of a path, (n, 2) by y, then x, and their distances (n,)."""
        found = [self._near_one(path, within) for path in paths]
        points, far = np.vstack([one for one, _ in found]), np.concatenate([one for _, one in found])
        order = np.lexsort([far, *points.T])
        points, far = points[order], far[order]
        new = np.append(True, (points[1:] != points[:-1]).any(axis=1))[: len(points)]
        return points[new], far[new]

    def _near_one(self, path: Path, within: float) -> tuple[Array, Array]:
        spacing = self.spacing_m
        axes = [
            (floor((min(c) - within) / spacing) - 1, ceil((max(c) + within) / spacing) + 1) for c in (path.x, path.y)
        ]
        check_number((axes[0][1] - axes[0][0]) * (axes[1][1] - axes[1][0]), MOST_PLACES)
        columns, rows = (np.arange(*axis) for axis in axes)
        points: Array = (
            np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64) + 0.5
        ) * spacing
        far = distances(points, path, within)
        return points[np.isfinite(far)], far[np.isfinite(far)]
