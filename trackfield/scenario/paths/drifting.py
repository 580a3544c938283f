"""The path ``drifting``."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, JsonValue

from trackfield.errors import ScenarioError
from trackfield.scenario.paths.path import NS, Course, PathSection
from trackfield.scenario.quantities import SHORT_S, Coordinate, Distance, Exact, Instant, LaterInstant, Length
from trackfield.scenario.section import wrong
from trackfield.world.drift import Drift
from trackfield.world.path import Path

STEPS: Final = 1000
"""As in the paper."""
MOST_TURNS: Final = 100
MOST_DEG: Final = 1_000_000.0
"""In all turns together: the path has a knot for every 45 degrees."""
TURNS: Final[dict[str, JsonValue]] = {
    "expected": "a list of [from_s, until_s, deg_s], one after the other, up to 1e9 s and 360 degrees a second"
}
Turn = tuple[Instant, LaterInstant, Annotated[float, Field(ge=-360, le=360), Exact]]
"""(from_s, until_s, deg_s)"""


def _in_order(turns: tuple[Turn, ...]) -> tuple[Turn, ...]:
    for since, until, _ in turns:
        if round(until - since, 9) < SHORT_S:
            raise wrong(f"a turn goes from {since:g} s to {until:g} s", f"an end {SHORT_S:g} s later or more")
    for (_, end, _), (begin, *_) in pairwise(turns):
        if begin < end:
            raise wrong(f"a turn begins at {begin:g} s, and the one before it ends at {end:g} s", "turns in order")
    if (turned := sum(abs(rate) * (until - since) for since, until, rate in turns)) > MOST_DEG:
        raise wrong(f"turns by {turned:g} degrees in all", f"at most {MOST_DEG:g}")
    return turns


Turns = Annotated[tuple[Turn, ...], Field(max_length=MOST_TURNS), AfterValidator(_in_order)]
Sd = Length
"""Metres, or m/s."""


class Drifting(PathSection):
    """Nearly constant velocity with white acceleration, as in Özfidan et al. (2018), eqs. 5 and 6.

    The noise of place and velocity in a step of dt seconds is q [[dt^3/3, dt^2/2], [dt^2/2, dt]] on each axis; with an
    acceleration that is ``held``, as in Zhou et al. (2011), q [[dt^3/4, dt^2/2], [dt^2/2, dt]].
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
    start_sd: tuple[Sd, Sd, Sd, Sd] = Field(
        default=(0.0, 0.0, 0.0, 0.0),
        description="standard deviations of what is drawn and added to the start: x, y in m, vx, vy in m/s",
    )
    held: bool = Field(
        default=False,
        description="the acceleration is drawn for each step, with a variance of q / step_s, and constant in it",
    )
    turns: Turns = Field(
        default=(),
        json_schema_extra=TURNS,
        description="when the target also turns: from and until (s), at which rate (degrees a second, positive to the "
        "left)",
    )
    half_width_m: Distance = Field(
        default=8000.0,
        description="half the side of the square around its start in which it stays at each step; a path that "
        "leaves it is drawn again; 1e7: it may go anywhere",
    )

    def run(self, course: Course) -> tuple[int, Path]:
        """As long as the run, or else as in the paper."""
        steps = course.steps or STEPS
        drift = Drift(
            self.q,
            self.speed_m_s,
            self.heading_deg,
            self.half_width_m,
            self.start_m,
            self.held,
            self.start_sd,
            self.turns,
        )
        try:
            return steps, drift.path(course.seed, steps, course.step_ns / NS, self.id)
        except ValueError as error:
            what = f"is {self.half_width_m:g} m; {error}"
            expected = "a wider square, or fewer steps, or a lower q or speed_m_s"
            raise ScenarioError(what, key=f"{course.key}.half_width_m", expected=expected) from None
