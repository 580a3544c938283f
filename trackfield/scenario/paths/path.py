"""What all kinds of targets' paths have in common."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from pydantic import Field

from trackfield.scenario.section import Id, Section
from trackfield.world.path import Path
from trackfield.world.windows import Array

NS: Final = 1_000_000_000
MAX_STEPS: Final = 65535
"""The largest step that fits into a report (docs/wire.md)."""


@dataclass(frozen=True)
class Course:
    """What a target's path may go by: the run's seed, its step in ns, and its number of steps if it says one.

    ``origin`` (2,) is the latitude and longitude of (0, 0), None if the target itself decides; ``key`` is the
    target's own in the scenario, for messages.
    """

    seed: int
    step_ns: int
    steps: int | None
    origin: Array | None = None
    key: str = "target"


class PathSection(Section):
    """A target; ``path`` is the kind of its path."""

    path: str
    id: Id = Field(default="target", description="what the target is called; each of [[targets]] says it")
    step_s: float = Field(
        default=1.0,
        ge=0.001,
        le=3600,
        description="a step of the run, as the first target has it: sensors report and the centre fuses once in it",
    )
    steps: int | None = Field(
        default=None,
        ge=1,
        le=MAX_STEPS,
        description="of the run, as the first target has it; unset: till the last path ends (s1 60, s2 75, s3 40 s)",
    )

    def run(self, course: Course) -> tuple[int, Path]:
        """How many whole steps the target is there for, and its path: t=0 is the first step.

        Raises ``ScenarioError`` if its file cannot be used.
        """
        raise NotImplementedError

    def origin(self, key: str) -> Array | None:
        """(2,) latitude and longitude in degrees of (0, 0); None for a path that has no place on the globe.

        ``key`` is the target's own in the scenario. Raises ``ScenarioError`` if its file cannot be used.
        """
        return None


def whole_steps(path: Path, course: Course) -> tuple[int, Path]:
    """A path that ends by itself, and how many steps it takes."""
    return round(path.end_s * NS) // course.step_ns, path


def origin_of(targets: Iterable[tuple[str, PathSection]]) -> Array | None:
    """(2,) latitude and longitude in degrees of (0, 0), by the first of the targets that knows; None if none does.

    Takes each with its key. Raises ``ScenarioError`` if a file cannot be used.
    """
    return next((origin for key, target in targets if (origin := target.origin(key)) is not None), None)
