"""The layout ``jittered``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, SquareSection, numbered, offset
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Share


class Jittered(SquareSection):
    """A square grid whose sensors are displaced a little at random."""

    layout: Literal["jittered"] = Field(
        default="jittered", description="a square grid, with each sensor displaced at random"
    )
    jitter: Share = Field(default=0.25, description="largest displacement east and north, as a share of the spacing")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """See ``LayoutSection``."""
        reach = self.jitter * self.spacing_m
        places = [(*place, *offset(ground.seed, place[0])) for place in numbered(self.grid())]
        return [(id, x + reach * dx, y + reach * dy) for id, x, y, dx, dy in places], None
