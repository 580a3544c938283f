"""The layout ``ring``."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, LayoutSection, numbered
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Distance, Nodes


class Ring(LayoutSection):
    """Sensors on a circle, evenly spaced."""

    layout: Literal["ring"] = Field(
        default="ring", description="evenly on a circle, clockwise from north; the circle touches both axes"
    )
    radius_m: Distance = Field(default=250.0, description="radius of the circle around (radius_m, radius_m)")
    nodes: Nodes = Field(default=30, description="number of sensors")

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """The first due north of the middle, then clockwise."""
        angle = 2 * np.pi * np.arange(self.nodes) / self.nodes
        return numbered(self.radius_m * (1.0 + np.column_stack([np.sin(angle), np.cos(angle)]))), None
