"""The layout ``random``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, SquareSection, check_number, ids, offset
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Distance


class Scattered(SquareSection):
    """Sensors anywhere in a square, independently of each other."""

    layout: Literal["random"] = Field(default="random", description="at random in a square with one corner at (0, 0)")
    spacing_m: Distance = Field(default=50.0, description="side of a square with one sensor on average")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """One sensor for each square of ``spacing_m`` in the extent, or ``nodes`` sensors at the same density."""
        number = self.nodes or max(round(self.side() ** 2), 1)
        check_number(number)
        half = (self.extent_m if self.nodes is None else self.spacing_m * self.nodes**0.5) / 2
        places = [(id, *offset(ground.seed, id)) for id in ids(number)]
        return [(id, half + half * dx, half + half * dy) for id, dx, dy in places], None
