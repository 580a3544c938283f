"""The layout ``beside``."""

from __future__ import annotations

from math import cos, sin
from typing import Literal

import numpy as np
from pydantic import Field

from trackfield.models.sound import bearing
from trackfield.scenario.layouts.layout import Ground, LayoutSection, numbered
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Distance


class Beside(LayoutSection):
    """A single sensor beside the path of the first target."""

    layout: Literal["beside"] = Field(
        default="beside", description="one sensor, to the right of the first target's path"
    )
    distance_m: Distance = Field(
        default=15_000.0,
        description="from the target at half time, at right angles to the line between its ends",
    )

    def stand(self, ground: Ground) -> tuple[list[Place], None]:
        """To the right of the path's middle; a path that ends where it began counts as leading north."""
        path = ground.known_paths(self.layout)[0]
        half_s = (path.start_s + path.end_s) / 2
        middle = path.clip(half_s, half_s)
        heading = bearing(path.x[-1] - path.x[0], path.y[-1] - path.y[0])
        x, y = middle.x[0] + self.distance_m * cos(heading), middle.y[0] - self.distance_m * sin(heading)
        return numbered(np.array([[x, y]])), None
