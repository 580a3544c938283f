"""The path ``waypoints``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.paths.legs import LEGS, Legs
from trackfield.scenario.paths.path import Course, PathSection, whole_steps
from trackfield.world import targets
from trackfield.world.path import Path


class Waypoints(PathSection):
    """Straight legs at constant speed."""

    path: Literal["waypoints"] = Field(default="waypoints", description="straight legs at constant speed")
    waypoints: Legs = Field(
        json_schema_extra=LEGS, description="the target's positions over time, in metres east and north"
    )

    def run(self, course: Course) -> tuple[int, Path]:
        """See ``PathSection``."""
        return whole_steps(targets.waypoints(self.waypoints), course)
