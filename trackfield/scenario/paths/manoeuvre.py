"""The paths ``s1``, ``s2`` and ``s3``."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from trackfield.errors import ScenarioError
from trackfield.scenario.paths.path import NS, Course, PathSection
from trackfield.world import targets
from trackfield.world.path import Path

LONGEST_S: Final = 200_000.0
"""Over two days at some metres a second, on the flat; the paper's paths last a minute."""
_LENGTH_S: Final = {"s1": 60, "s2": 75, "s3": 40}


class Manoeuvre(PathSection):
    """One of the three paths of Zhai et al. (2009)."""

    path: Literal["s1", "s2", "s3"] = Field(
        default="s1",
        description="straight with random accelerations (s1), two sharp turns (s2), faster, then slower (s3)",
    )

    def run(self, course: Course) -> tuple[int, Path]:
        """As long as the run, or else as in the paper."""
        steps = course.steps or _LENGTH_S[self.path] * NS // course.step_ns
        end_s = steps * course.step_ns / NS
        if end_s > LONGEST_S:
            what = f"{self.path} would go on for {end_s:g} s"
            raise ScenarioError(what, key=f"{course.key}.steps", expected=f"at most {LONGEST_S:g} s in all")
        match self.path:
            case "s1":
                return steps, targets.s1(course.seed, steps, course.step_ns / NS, self.id)
            case "s2":
                return steps, targets.s2(end_s)
            case "s3":
                return steps, targets.s3(end_s)
