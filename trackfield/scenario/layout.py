"""Where the sensors of a scenario stand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import ceil, cos, floor, sin
from pathlib import Path as FilePath
from typing import Final

import numpy as np

from trackfield.draw import normal, uniform
from trackfield.errors import ScenarioError
from trackfield.models.sound import bearing
from trackfield.scenario.places import Place, Point, read_places
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sections import (
    AlongPath,
    Beside,
    FromFile,
    Grid,
    Jittered,
    Manoeuvre,
    Random,
    Ring,
    Surveyed,
    Waypoints,
)
from trackfield.world.path import Path
from trackfield.world.tracks import track_origin
from trackfield.world.windows import Array, distances

LIMIT: Final = 1_000_000
"""The most places that are looked at; more is a mistake in the units."""


def layout(scenario: Scenario, path: Path) -> tuple[list[Place], Point | None]:
    """The sensors, and where the fusion centre stands if the field says so (m).

    A field that is no file calls its sensors ``n000``, ``n001`` and so on, from the south-west row by row: in a
    grid of 11 columns, row times 11 plus column. Raises ``ScenarioError`` if there are none, or more than a
    million, and for a file that cannot be used.
    """
    field, seed = scenario.field, scenario.seed
    match field:
        case Surveyed():
            return read_places(FilePath(field.file), _origin(scenario.target))
        case Random():
            return _scattered(field, seed), None
        case Ring():
            points = _ring(field)
        case AlongPath():
            points = _along(field, path)
        case Beside():
            points = _beside(field, path)
        case _:
            points = _grid(field)
    places = [(id, x, y) for id, (x, y) in zip(_ids(len(points)), points.tolist(), strict=True)]
    if isinstance(field, Jittered):
        reach = field.jitter * field.spacing_m
        places = [(id, x + reach * dx, y + reach * dy) for id, x, y in places for dx, dy in [_offset(seed, id)]]
    return places, None


def believed(scenario: Scenario, sensors: Sequence[Place]) -> Sequence[Place]:
    """The sensors where the fusion centre takes them to stand: off by a Gaussian error, east and north."""
    seed, sd = scenario.seed, scenario.sensor.position_error_m
    if not sd:
        return sensors
    error = partial(normal, seed)
    return [
        (id, x + sd * error(id, 0, "position", "x"), y + sd * error(id, 0, "position", "y")) for id, x, y in sensors
    ]


def _ids(number: int) -> list[str]:
    width = max(3, len(str(number - 1)))
    return [f"n{i:0{width}}" for i in range(number)]


def _offset(seed: int, id: str) -> Point:
    """Uniform in the square from (-1, -1) to (1, 1)."""
    x, y = (uniform(seed, id, 0, "place", axis) for axis in ("x", "y"))
    return 2.0 * x - 1.0, 2.0 * y - 1.0


def _scattered(field: Random, seed: int) -> list[Place]:
    """As many as squares of ``spacing_m`` have room, or ``nodes`` in a square with as much room for each."""
    number = field.nodes or max(round(_side(field) ** 2), 1)
    _check_number(number)
    half = (field.extent_m if field.nodes is None else field.spacing_m * field.nodes**0.5) / 2
    return [(id, half + half * dx, half + half * dy) for id in _ids(number) for dx, dy in [_offset(seed, id)]]


def _ring(field: Ring) -> Array:
    """(n, 2) places on the circle, the first due north of its centre, then clockwise."""
    angle = 2 * np.pi * np.arange(field.nodes) / field.nodes
    return field.radius_m * (1.0 + np.column_stack([np.sin(angle), np.cos(angle)]))


def _origin(target: Manoeuvre | FromFile | Waypoints) -> Array | None:
    """Where (0, 0) lies on the globe, for a target that knows."""
    return track_origin(FilePath(target.file), target.from_, target.to) if isinstance(target, FromFile) else None


def _grid(field: Grid | Jittered) -> Array:
    """(n, 2) places of a square grid, or of a nearly square one of about ``nodes`` places."""
    columns = rows = floor(_side(field) + 1e-9) + 1
    if field.nodes is not None:
        columns = max(round(field.nodes**0.5), 1)
        rows = max(round(field.nodes / columns), 1)
    _check_number(rows * columns)
    return field.spacing_m * np.indices((rows, columns)).reshape(2, -1).T[:, ::-1].astype(float)


def _side(field: Grid | Jittered | Random) -> float:
    """How many spacings the extent has; at most ``LIMIT``, which is far too many."""
    return min(field.extent_m / field.spacing_m, LIMIT)


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
    if not len(points):
        raise ScenarioError(
            "no sensors: the path comes near no place of the grid",
            key="field.within_m",
            expected=f"more than half the spacing of {field.spacing_m:g} m",
        )
    return points[np.lexsort(points.T)]  # by y, then x


def _beside(field: Beside, path: Path) -> Array:
    """(1, 2) the place to the right of the path's middle; of one that ends where it began, as if it led north."""
    half_s = (path.start_s + path.end_s) / 2
    middle = path.clip(half_s, half_s)
    heading = bearing(path.x[-1] - path.x[0], path.y[-1] - path.y[0])
    return np.array([[middle.x[0] + field.distance_m * cos(heading), middle.y[0] - field.distance_m * sin(heading)]])


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
            f"the field has {places} places or more",
            key="field.spacing_m",
            expected=f"so much that there are at most {LIMIT}",
        )
