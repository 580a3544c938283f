"""What all kinds of targets' paths have in common."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from pydantic import Field

from trackfield.scenario.section import FileName, Id, Section
from trackfield.world.path import Path
from trackfield.world.recording import Recording, Start
from trackfield.world.windows import Array

NS: Final = 1_000_000_000
MAX_STEPS: Final = 65535
"""The largest step that fits into a report (docs/wire.md)."""


@dataclass(frozen=True)
class Course:
    """What a target's path may use: the run's seed, its step in ns, and its number of steps if one is given.

    ``origin`` (2,) is the latitude and longitude of (0, 0), None if the target itself decides it; ``key`` is the
    target's key in the scenario, for messages. ``recordings`` are those that the sensors play, and ``heard_s`` is how
    long the sound is that they listen to.
    """

    seed: int
    step_ns: int
    steps: int | None
    origin: Array | None = None
    key: str = "target"
    recordings: tuple[Recording, ...] = ()
    heard_s: float = 0.0


class PathSection(Section):
    """A target; ``path`` is the kind of its path."""

    path: str
    id: Id = Field(default="target", description="the target's id; required in [[targets]]")
    step_s: float = Field(
        default=1.0,
        ge=0.001,
        le=3600,
        description="length of a step, in which sensors report and the centre fuses once; the first target's counts",
    )
    steps: int | None = Field(
        default=None,
        ge=1,
        le=MAX_STEPS,
        description="number of steps; the first target's counts; unset: to the last path's end (s1 60, s2 75, s3 40 s; "
        "drifting 1000 steps)",
    )
    sound: FileName | None = Field(
        default=None,
        description="WAV or FLAC file of a vehicle that passes, which the target sounds like to sensors that listen; "
        "relative to the scenario's own folder; unset: synthesised",
    )

    def run(self, course: Course) -> tuple[int, Path | None]:
        """The number of whole steps in which the target is present, and its path: t=0 is the first step.

        None for a target of which nobody knows where it was. Raises ``ScenarioError`` if its file cannot be used.
        """
        raise NotImplementedError

    def start(self, key: str) -> Start | None:
        """What time of its file the first step is; None if it has no file. Raises ``ScenarioError`` as ``run`` does."""
        return None

    def origin(self, key: str) -> Array | None:
        """(2,) latitude and longitude in degrees of (0, 0); None for a path without geographic coordinates.

        ``key`` is the target's key in the scenario. Raises ``ScenarioError`` if its file cannot be used.
        """
        return None


def whole_steps(path: Path, course: Course) -> tuple[int, Path]:
    """A path with an end of its own, and how many steps it takes."""
    return round(path.end_s * NS) // course.step_ns, path


def origin_of(targets: Iterable[tuple[str, PathSection]]) -> Array | None:
    """(2,) latitude and longitude in degrees of (0, 0), from the first target that has it; None if none has.

    Takes each with its key. Raises ``ScenarioError`` if a file cannot be used.
    """
    return next((origin for key, target in targets if (origin := target.origin(key)) is not None), None)
