"""The layout ``along-path``."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from trackfield.scenario.layouts.near_path import Cells, NearPathSection, within_reach
from trackfield.world.path import Path
from trackfield.world.windows import Array


class AlongPath(NearPathSection):
    """A grid, with only the places near the targets' paths.

    It is shifted by half its spacing, so that no sensor stands where a path begins.
    """

    enough: ClassVar = "half the spacing"

    layout: Literal["along-path"] = Field(
        default="along-path", description="a grid, but only where a target comes near"
    )

    def near(self, cells: Cells, path: Path, within: float, seed: int) -> tuple[Array, Array]:
        """See ``NearPathSection``: the middle of each cell."""
        return within_reach((cells.astype(np.float64) + 0.5) * self.spacing_m, path, within)
