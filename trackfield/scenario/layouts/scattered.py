"""The layout ``random``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, SquareSection, check_number, ids, offset
from trackfield.scenario.places import Place
from trackfield.scenario.section import Positive


class Scattered(SquareSection):
    """Sensors anywhere in a square, independently of each other."""

    layout: Literal["random"] = Field(default="random", description="anywhere in a square with its corner at (0, 0)")
    spacing_m: Positive = Field(default=50.0, description="there is one sensor to a square of this side")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """As many as squares of ``spacing_m`` have room, or ``nodes`` in a square with as much room for each."""
        number = self.nodes or max(round(self.side() ** 2), 1)
        check_number(number)
        half = (self.extent_m if self.nodes is None else self.spacing_m * self.nodes**0.5) / 2
        places = [(id, *offset(ground.seed, id)) for id in ids(number)]
        return [(id, half + half * dx, half + half * dy) for id, dx, dy in places], None
