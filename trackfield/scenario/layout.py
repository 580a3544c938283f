"""Where the sensors of a scenario stand."""

from __future__ import annotations

from math import ceil, floor
from typing import Final

import numpy as np

from trackfield.errors import ScenarioError
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sections import AlongPath, Grid
from trackfield.world.path import Path
from trackfield.world.windows import Array, distances

Place = tuple[str, float, float]
"""(id, metres east, metres north)"""

LIMIT: Final = 1_000_000
"""The most places that are looked at; more is a mistake in the units."""


def layout(scenario: Scenario, path: Path) -> list[Place]:
    """The sensors, row by row from the south-west.

    A grid of 11 columns calls its sensors ``n000`` to ``n120``, row times 11 plus column; along a path they
    are counted through. Raises ``ScenarioError`` if there are none, or more than a million.
    """
    field = scenario.field
    points = _along(field, path) if isinstance(field, AlongPath) else _grid(field)
    if not len(points):
        raise ScenarioError(
            "no sensors: the path comes near no place of the grid",
            key="field.within_m",
            expected=f"more than half the spacing of {field.spacing_m:g} m",
        )
    width = max(3, len(str(len(points) - 1)))
    return [(f"n{i:0{width}}", x, y) for i, (x, y) in enumerate(points.tolist())]


def _grid(field: Grid) -> Array:
    """(n, 2) places of a square grid, or of a nearly square one of about ``nodes`` places."""
    columns = rows = floor(field.extent_m / field.spacing_m + 1e-9) + 1
    if field.nodes is not None:
        columns = max(round(field.nodes**0.5), 1)
        rows = max(round(field.nodes / columns), 1)
    _check_number(rows * columns)
    return field.spacing_m * np.indices((rows, columns)).reshape(2, -1).T[:, ::-1].astype(float)


def _along(field: AlongPath, path: Path) -> Array:
    """(n, 2) places within reach of the path, or the ``nodes`` places nearest to it.

    The grid is shifted by half its spacing, so that no sensor stands where the path begins.
    """
    within = field.within_m
    points, far = _near(path, field.spacing_m, within)
    if field.nodes is not None:
        while len(points) < field.nodes:
            within *= 2.0
            points, far = _near(path, field.spacing_m, within)
        points = points[np.argsort(far, kind="stable")[: field.nodes]]
    return points[np.lexsort(points.T)]  # by y, then x


def _near(path: Path, spacing: float, within: float) -> tuple[Array, Array]:
    """The places of the shifted grid within reach of the path, (n, 2), and how far they are, (n,)."""
    axes = [(floor((min(c) - within) / spacing) - 1, ceil((max(c) + within) / spacing) + 1) for c in (path.x, path.y)]
    _check_number((axes[0][1] - axes[0][0]) * (axes[1][1] - axes[1][0]))
    columns, rows = (np.arange(*axis) for axis in axes)
    points: Array = (np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64) + 0.5) * spacing
    far = distances(points, path, within)
    return points[np.isfinite(far)], far[np.isfinite(far)]


def _check_number(places: int) -> None:
    if places > LIMIT:
        raise ScenarioError(
            f"the grid has {places} places",
            key="field.spacing_m",
            expected=f"so much that there are at most {LIMIT}",
        )
