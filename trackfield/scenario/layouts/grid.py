"""The layout ``grid``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, SquareSection, numbered
from trackfield.scenario.places import Place


class Grid(SquareSection):
    """A square grid with its first corner at (0, 0)."""

    layout: Literal["grid"] = Field(default="grid", description="a square grid with its first corner at (0, 0)")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """See ``LayoutSection``."""
        return numbered(self.grid()), None
