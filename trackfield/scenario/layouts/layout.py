"""What all layouts have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import floor

import numpy as np
from pydantic import Field

from trackfield.draw import uniform
from trackfield.errors import ScenarioError
from trackfield.scenario.places import Place, Point
from trackfield.scenario.quantities import MOST_NODES, Distance, Length, Nodes
from trackfield.scenario.section import Section
from trackfield.world.path import Path
from trackfield.world.windows import Array


@dataclass(frozen=True)
class Ground:
    """What a layout may use: the seed, the targets' paths from the first step on, as far as known, the centre's id.

    ``origin()`` returns the latitude and longitude (2,) of (0, 0), or None; a call, as it may have to read a file. A
    ``centre`` without an id (None) may have any.
    """

    seed: int
    paths: tuple[Path, ...]
    centre: str | None
    origin: Callable[[], Array | None]

    def known_paths(self, layout: str) -> tuple[Path, ...]:
        """The paths, for a layout that needs them. Raises ``ScenarioError`` if there are none."""
        if not self.paths:
            what = f"is {layout!r}, and the recording does not say where the target was"
            raise ScenarioError(what, key="field.layout", expected="'file', with the places of the real sensors")
        return self.paths


class LayoutSection(Section):
    """A layout; ``layout`` is its name."""

    layout: str

    def stand(self, ground: Ground) -> tuple[list[Place], Point | None]:
        """The sensors, and where the fusion centre stands if the layout says so (m).

        Raises ``ScenarioError`` if there are no sensors or more than ``MOST_NODES``, or if a file cannot be used.
        """
        raise NotImplementedError


class SpacedSection(LayoutSection):
    """A layout with one sensor to a square of ``spacing_m``."""

    spacing_m: Distance = Field(default=50.0, description="distance between neighbours of the grid")
    nodes: Nodes | None = Field(
        default=None,
        description="approximate number of sensors at the same spacing; the size of the field follows from it",
    )


class SquareSection(SpacedSection):
    """A layout that fills a square."""

    extent_m: Length = Field(default=500.0, description="side of the square")

    def side(self) -> float:
        """The extent in units of the spacing, at most ``MOST_NODES``."""
        return min(self.extent_m / self.spacing_m, MOST_NODES)

    def grid(self) -> Array:
        """(n, 2) places of a square grid, or of a nearly square one of about ``nodes`` places."""
        columns = rows = floor(self.side() + 1e-9) + 1
        if self.nodes is not None:
            columns = max(round(self.nodes**0.5), 1)
            rows = max(round(self.nodes / columns), 1)
        check_number(rows * columns)
        return self.spacing_m * np.indices((rows, columns)).reshape(2, -1).T[:, ::-1].astype(float)


def numbered(points: Array) -> list[Place]:
    """The ``points`` (n, 2), called ``n000``, ``n001`` and so on.

    From the south-west row by row: in a grid of 11 columns, row times 11 plus column.
    """
    return [(id, x, y) for id, (x, y) in zip(ids(len(points)), points.tolist(), strict=True)]


def ids(number: int) -> Iterable[str]:
    """The ids of this many sensors."""
    width = max(3, len(str(number - 1)))
    return [f"n{i:0{width}}" for i in range(number)]


def offset(seed: int, id: str) -> Point:
    """Uniform in the square from (-1, -1) to (1, 1), drawn for each sensor."""
    x, y = (uniform(seed, id, 0, "place", axis) for axis in ("x", "y"))
    return 2.0 * x - 1.0, 2.0 * y - 1.0


def check_number(places: int, most: int = MOST_NODES, key: str = "field.spacing_m") -> None:
    """Raise ``ScenarioError`` if there are more ``places`` than ``most``; ``key`` is the one that decides it."""
    if places > most:
        raise ScenarioError(
            f"the field has {places} places or more",
            key=key,
            expected=f"a value that gives at most {most}",
        )
