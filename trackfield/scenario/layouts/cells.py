"""The layout ``cells``."""

from __future__ import annotations

from math import sqrt
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from trackfield.draw import uniform
from trackfield.scenario.layouts.near_path import Cells, NearPathSection, within_reach
from trackfield.scenario.quantities import Distance
from trackfield.world.path import Path
from trackfield.world.windows import Array, distances


class CellsSection(NearPathSection):
    """One sensor anywhere in each square cell, in a field that has no edge, as far as a target comes near.

    Where in its cell a sensor stands is a hash of the seed and the cell. So the path decides which sensors there are,
    and not where they are.
    """

    enough: ClassVar = "the diagonal of a cell"

    layout: Literal["cells"] = Field(
        default="cells",
        description="one anywhere in each square cell, without an edge, but only where a target comes near",
    )
    spacing_m: Distance = Field(default=50.0, description="side of a cell, which has one sensor")

    def near(self, cells: Cells, path: Path, within: float, seed: int) -> tuple[Array, Array]:
        """See ``NearPathSection``: drawn only for the cells that have a part within reach."""
        middles = (cells.astype(np.float64) + 0.5) * self.spacing_m
        reach = 1.01 * (within + self.spacing_m * sqrt(0.5))  # ``distances`` may be too long by a thousandth
        return within_reach(self.places(cells[np.isfinite(distances(middles, path, reach))], seed), path, within)

    def places(self, cells: Cells, seed: int) -> Array:
        """(n, 2) m, of the sensors of ``cells`` (n, 2)."""
        drawn = [[uniform(seed, "cells", i, j, axis) for axis in ("x", "y")] for i, j in cells.tolist()]
        found: Array = (cells + np.array(drawn).reshape(-1, 2)) * self.spacing_m
        return found
