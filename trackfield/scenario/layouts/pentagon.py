"""The layout ``pentagon``: clusters of five sensors, each a little irregular (Yang et al., section 4)."""

from __future__ import annotations

from math import ceil
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from trackfield.draw import uniform
from trackfield.errors import ScenarioError
from trackfield.scenario.layouts.layout import Ground, LayoutSection, check_number, numbered
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import MOST_NODES, Coordinate, Distance, Length
from trackfield.world.path import Path
from trackfield.world.windows import Array, distances

CORNERS: Final = 5
TRIES: Final = 200
"""So often a cluster is drawn anew, until the target passes no node too close."""
OFFSET: Final = 0.5
"""A cluster's centre is off the path by at most so many radii, east and north."""
APART: Final = 0.5
"""Where the path comes back, a place nearer to a cluster than so many spacings has none of its own."""
POINTS: Final = 200_000
"""Points of a path that are looked at, at most."""
_Shift = Annotated[float, Field(ge=-1, le=1)]
_Jitter = Annotated[tuple[tuple[_Shift, _Shift], ...], Field(min_length=CORNERS, max_length=CORNERS)]
_Centres = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=1, max_length=MOST_NODES // CORNERS)]


class Pentagon(LayoutSection):
    """Sensors at the corners of pentagons: one or more clusters of five."""

    layout: Literal["pentagon"] = Field(
        default="pentagon",
        description="clusters of five at the corners of a pentagon, the first due north of its centre; ids by cluster",
    )
    corner_m: Distance = Field(default=20.0, description="from the centre of a cluster to its corners")
    displaced: Literal[False] | _Jitter = Field(
        default=((0.05, -0.08), (0.10, 0.05), (-0.08, 0.10), (0.06, -0.05), (-0.10, 0.02)),
        json_schema_extra={"expected": "false, or a list of 5 [east, north], each from -1 to 1"},
        description="displacement of each corner, east and north, in radii; false: none",
    )
    centres: _Centres | None = Field(
        default=None,
        json_schema_extra={"expected": "a list of at least one [x_m, y_m], up to 1e7 m"},
        description="where the clusters stand; unset: the first target's path goes through them, every every_m",
    )
    every_m: Distance = Field(default=60.0, description="between clusters along the path, if centres is unset")
    min_pass_m: Length = Field(
        default=2.0, description="such a cluster is placed so that no target passes nearer to any of its sensors"
    )

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """Cluster by cluster, the corners anticlockwise from north."""
        if self.centres is not None:
            return numbered(self._around(np.array(self.centres))), None
        paths = ground.known_paths(self.layout)
        along = places_along(paths[0], self.every_m)
        return numbered(self._drawn(along, paths, ground.seed)), None

    def corners(self) -> Array:
        """(5, 2) m, of a cluster around (0, 0)."""
        angle = np.pi / 2 + 2 * np.pi * np.arange(CORNERS) / CORNERS
        unit = np.column_stack([np.cos(angle), np.sin(angle)])
        found: Array = self.corner_m * (unit + (np.array(self.displaced) if self.displaced else 0.0))
        return found

    def _around(self, centres: Array) -> Array:
        """(5 n, 2) m, of the clusters around ``centres`` (n, 2)."""
        return (centres[:, None, :] + self.corners()).reshape(-1, 2)

    def _drawn(self, along: Array, paths: tuple[Path, ...], seed: int) -> Array:
        """(5 n, 2) m: each cluster at the first drawn offset from its place on the path that leaves room to pass."""
        centres, left = along.copy(), np.arange(len(along))
        for attempt in range(TRIES):
            offsets = [[uniform(seed, "pentagon", i, attempt, axis) for axis in ("x", "y")] for i in left.tolist()]
            centres[left] = along[left] + OFFSET * self.corner_m * (2.0 * np.array(offsets) - 1.0)
            left = left[self._grazed(centres[left], paths)]
            if not len(left):
                return self._around(centres)
        what = f"there is no place near ({', '.join(f'{x:.0f}' for x in along[left[0]])}) m where no target passes"
        expected = f"less than {self.min_pass_m:g}, or larger clusters (corner_m)"
        raise ScenarioError(f"{what} a sensor that closely", key="field.min_pass_m", expected=expected)

    def _grazed(self, centres: Array, paths: tuple[Path, ...]) -> Array:
        """(n,) whether a target passes a sensor of these clusters (n, 2) too closely."""
        if not self.min_pass_m:
            return np.zeros(len(centres), bool)
        places = self._around(centres)
        near = [np.isfinite(distances(places, path, self.min_pass_m)) for path in paths]
        grazed: Array = np.any(near, axis=0).reshape(-1, CORNERS).any(axis=1)
        return grazed


def places_along(path: Path, every_m: float) -> Array:
    """(n, 2) m: points of a path, ``every_m`` apart along it, as many as there is room for, at least one.

    They leave as much at either end. Where the path comes back to one of them, there is none anew.
    """
    number = min(ceil(path.fastest_m_s * (path.end_s - path.start_s)) + 2, POINTS)
    times = np.union1d(path.t, np.linspace(path.start_s, path.end_s, number))
    states = [path.at(t) for t in times.tolist()]
    points = np.array([state[:2] for state in states if state is not None])
    gone = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    check_number(CORNERS * int(gone[-1] / every_m), key="field.every_m")
    count = max(int(gone[-1] / every_m + 1e-9), 1)
    wanted = gone[-1] / 2 + (np.arange(count) - (count - 1) / 2) * every_m
    places = np.column_stack([np.interp(wanted, gone, points[:, axis]) for axis in (0, 1)])
    kept = np.zeros(count, bool)
    for i, place in enumerate(places):
        kept[i] = (np.hypot(*(places[:i][kept[:i]] - place).T) >= APART * every_m).all()
    found: Array = places[kept]
    return found
