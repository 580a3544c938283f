"""The path ``drifting``."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from trackfield.errors import ScenarioError
from trackfield.scenario.paths.path import NS, Course, PathSection
from trackfield.scenario.quantities import Coordinate, Distance, Exact
from trackfield.world.drift import Drift
from trackfield.world.path import Path

STEPS: Final = 1000
"""As in the paper."""


class Drifting(PathSection):
    """Nearly constant velocity with white acceleration, as in Özfidan et al. (2018), eqs. 5 and 6.

    The noise of place and velocity in a step of dt seconds is q [[dt^3/3, dt^2/2], [dt^2/2, dt]] on each axis.
    """

    path: Literal["drifting"] = Field(
        default="drifting", description="nearly constant velocity: it changes at random, by white acceleration"
    )
    q: Annotated[float, Field(ge=0, le=1_000_000), Exact] = Field(
        default=0.01,
        description="density of the acceleration's noise on each axis, m^2/s^3: in dt seconds the variance of the "
        "velocity grows by q dt",
    )
    speed_m_s: Annotated[float, Field(ge=0, le=100_000), Exact] = Field(default=2.0, description="speed at the start")
    heading_deg: float | None = Field(
        default=None,
        ge=-360,
        le=360,
        description="direction at the start, clockwise from north; unset: any, by the seed",
    )
    start_m: tuple[Coordinate, Coordinate] = Field(
        default=(0.0, 0.0), description="place at the start, in metres east and north"
    )
    half_width_m: Distance = Field(
        default=8000.0,
        description="half the side of the square around its start in which it stays at each step; a path that "
        "leaves it is drawn again",
    )

    def run(self, course: Course) -> tuple[int, Path]:
        """As long as the run, or else as in the paper."""
        steps = course.steps or STEPS
        drift = Drift(self.q, self.speed_m_s, self.heading_deg, self.half_width_m, self.start_m)
        try:
            return steps, drift.path(course.seed, steps, course.step_ns / NS, self.id)
        except ValueError as error:
            what = f"is {self.half_width_m:g} m; {error}"
            expected = "a wider square, or fewer steps, or a lower q or speed_m_s"
            raise ScenarioError(what, key=f"{course.key}.half_width_m", expected=expected) from None
