"""``[target]``: what moves, and how. A kind of path is a file here and a line in the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trackfield.scenario.paths.drifting import Drifting
from trackfield.scenario.paths.from_file import FromFile
from trackfield.scenario.paths.manoeuvre import Manoeuvre
from trackfield.scenario.paths.path import MAX_STEPS, Course, PathSection, origin_of
from trackfield.scenario.paths.recorded import Recorded
from trackfield.scenario.paths.waypoints import Waypoints
from trackfield.scenario.section import one_of

__all__ = [
    "MAX_STEPS",
    "PATHS",
    "Course",
    "Drifting",
    "FromFile",
    "Manoeuvre",
    "PathSection",
    "Recorded",
    "Target",
    "Waypoints",
    "origin_of",
]

PATHS: Final[tuple[type[PathSection], ...]] = (
    Manoeuvre,
    FromFile,
    Waypoints,
    Drifting,
    Recorded,
)

if TYPE_CHECKING:
    Target = PathSection
else:
    Target = one_of(PATHS, "path")
