"""The layout ``jittered``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, SquareSection, numbered, offset
from trackfield.scenario.places import Place
from trackfield.scenario.section import Share


class Jittered(SquareSection):
    """A square grid whose sensors stand a little off their places."""

    layout: Literal["jittered"] = Field(
        default="jittered", description="a square grid, but each sensor stands off its place"
    )
    jitter: Share = Field(default=0.25, description="by up to this share of the spacing, east and north")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """See ``LayoutSection``."""
        reach = self.jitter * self.spacing_m
        places = [(*place, *offset(ground.seed, place[0])) for place in numbered(self.grid())]
        return [(id, x + reach * dx, y + reach * dy) for id, x, y, dx, dy in places], None
