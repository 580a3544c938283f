"""The sections of a scenario file: keys, units, ranges, defaults.

Units are part of the names. A section that comes in several kinds (a link model, a layout, a kind of target)
is a union told apart by one of its keys. Descriptions become docs/scenarios.md, the schema for editors and
the comments of a written scenario.
"""

from __future__ import annotations

from datetime import date, datetime, time
from itertools import pairwise
from typing import Annotated, Any, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    JsonValue,
    ValidationInfo,
    field_validator,
    model_validator,
)

from trackfield.scenario.faults import Fault
from trackfield.scenario.hardware import Clocks, Energy
from trackfield.scenario.links import Ideal, Link
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.options import EXPECTED, Options, tables
from trackfield.scenario.section import NotNegative, Positive, Section, Share, wrong
from trackfield.scenario.sensing import Acoustic, Sensor

MAX_STEPS: Final = 65535
"""The largest step that fits into a report (docs/wire.md)."""

# --- [field]: where the sensors stand -----------------------------------------------------------------------


class _Spaced(Section):
    spacing_m: Positive = Field(default=50.0, description="distance between neighbours of the grid")
    nodes: int | None = Field(
        default=None,
        ge=1,
        le=1_000_000,
        description="about so many sensors at the same spacing, instead of the extent given",
    )


class _Square(_Spaced):
    extent_m: NotNegative = Field(default=500.0, description="side of the square")


class Grid(_Square):
    """A square grid with its first corner at (0, 0)."""

    layout: Literal["grid"] = Field(default="grid", description="a square grid with its first corner at (0, 0)")


class Jittered(_Square):
    """A square grid whose sensors stand a little off their places."""

    layout: Literal["jittered"] = Field(
        default="jittered", description="a square grid, but each sensor stands off its place"
    )
    jitter: Share = Field(default=0.25, description="by up to this share of the spacing, east and north")


class Random(_Square):
    """Sensors anywhere in a square, independently of each other."""

    layout: Literal["random"] = Field(default="random", description="anywhere in a square with its corner at (0, 0)")
    spacing_m: Positive = Field(default=50.0, description="there is one sensor to a square of this side")


class Ring(Section):
    """Sensors on a circle, evenly spaced."""

    layout: Literal["ring"] = Field(
        default="ring", description="evenly on a circle, from north clockwise; it touches both axes, as the grid does"
    )
    radius_m: float = Field(default=250.0, gt=0, le=1e7, description="of the circle around (radius_m, radius_m)")
    nodes: int = Field(default=30, ge=1, le=1_000_000, description="so many sensors")


class AlongPath(_Spaced):
    """A grid of which only the part near the target's path is there."""

    layout: Literal["along-path"] = Field(
        default="along-path", description="a grid, but only where the target comes near"
    )
    within_m: Positive = Field(default=150.0, description="how near the path has to come")


class Beside(Section):
    """A single sensor beside the target's path."""

    layout: Literal["beside"] = Field(default="beside", description="one sensor, to the right of the target's path")
    distance_m: float = Field(
        default=15_000.0, gt=0, le=1e7, description="from the target at half time, square to its way from begin to end"
    )


class Surveyed(Section):
    """Sensors where a file says."""

    layout: Literal["file"] = Field(default="file", description="where a file says")
    file: str = Field(
        min_length=1,
        description="CSV file with id and lat,lon or x,y of each sensor, relative to the scenario's own folder",
    )


# --- [target]: what moves -----------------------------------------------------------------------------------


def _text(value: Any) -> Any:
    """TOML has times of its own, and a track may count seconds: all become text."""
    if isinstance(value, time | date | datetime):
        return value.isoformat()
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


_MOMENT: dict[str, JsonValue] = {
    "expected": "HH:MM[:SS], an ISO date and time, or seconds for a file that counts seconds"
}
Moment = Annotated[str, BeforeValidator(_text)]


class _Target(Section):
    step_s: float = Field(
        default=1.0, ge=0.001, le=3600, description="a step: sensors report and the centre fuses once in it"
    )
    steps: int | None = Field(
        default=None,
        ge=1,
        le=MAX_STEPS,
        description="length of the run; unset: as long as the path (s1 60, s2 75, s3 40 s)",
    )


class Manoeuvre(_Target):
    """One of the three paths of Zhai et al. (2009)."""

    path: Literal["s1", "s2", "s3"] = Field(
        default="s1",
        description="straight with random accelerations (s1), two sharp turns (s2), faster, then slower (s3)",
    )


class FromFile(_Target):
    """A recorded track."""

    path: Literal["file"] = Field(default="file", description="a recorded track")
    file: str = Field(min_length=1, description="GPX or CSV file, relative to the scenario's own folder")
    from_: Moment | None = Field(
        default=None,
        alias="from",
        json_schema_extra=_MOMENT,
        description="t=0; unset: the file's first fix",
    )
    to: Moment | None = Field(
        default=None, json_schema_extra=_MOMENT, description="the end; unset: the file's last fix"
    )


Leg = tuple[Annotated[float, Field(ge=0, le=1e9)], float, float]
"""(t_s, x_m, y_m)"""
_LEGS: dict[str, JsonValue] = {"expected": "a list of at least two [t_s, x_m, y_m], with increasing times"}


def _increasing(points: tuple[Leg, ...] | None) -> tuple[Leg, ...] | None:
    if any(b[0] <= a[0] for a, b in pairwise(points or ())):
        raise wrong("its times do not increase", "increasing times")
    return points


Legs = Annotated[tuple[Leg, ...], Field(min_length=2), AfterValidator(_increasing)]


class Waypoints(_Target):
    """Straight legs at constant speed."""

    path: Literal["waypoints"] = Field(default="waypoints", description="straight legs at constant speed")
    waypoints: Legs = Field(json_schema_extra=_LEGS, description="when the target is where, in metres east and north")


# --- [fusion]: the centre -----------------------------------------------------------------------------------


class Fusion(Section):
    """The fusion centre and its trackers, all of which get the same reports."""

    options: Options = Field(
        default=(),
        json_schema_extra={"expected": EXPECTED},
        description="of single trackers; tracker = says whose variant a name of your own is",
    )
    trackers: tuple[str, ...] = Field(
        default=("fix-imm-ukf",), min_length=1, description="which trackers run side by side"
    )
    deadline_s: float = Field(default=0.3, gt=0, description="how long a step waits for its reports; at most step_s")
    max_age_s: float = Field(
        default=0.0,
        ge=0,
        le=3600,
        description="up to which age a late report is taken in after all, by going back to its step and on from there",
    )
    smooth_lag: int = Field(default=0, ge=0, le=100, description="publish tracks smoothed, too, so many steps later")
    target_sd_m: Positive = Field(
        default=3.0, description="standard deviation of the position that an adaptive threshold aims at"
    )
    x_m: float | None = Field(default=None, description="where the centre stands, east; unset: the middle of the field")
    y_m: float | None = Field(default=None, description="where it stands, north; unset: the middle of the field")
    path: Legs | None = Field(
        default=None,
        json_schema_extra=_LEGS,
        description="when the centre is where, in metres east and north, if it drives; unset: it stands",
    )
    sigma_v: NotNegative = Field(
        default=0.1, description="standard deviation of the acceleration, m/s^2, for trackers with one motion model"
    )
    lost_m: Positive = Field(
        default=50.0,
        description="a track that ends further off counts as lost; one without a prior is begun anew when less certain",
    )
    prior: Literal["paper", "none"] = Field(
        default="none",
        description="start around the true state (paper), or from the first reports alone (none)",
    )
    prior_sd: tuple[Positive, Positive, Positive, Positive] = Field(
        default=(20.0, 20.0, 4.0, 4.0),
        description="standard deviations of the paper's prior: x, y in m, vx, vy in m/s",
    )

    @field_validator("trackers")
    @classmethod
    def _known(cls, trackers: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        known = (info.context or {}).get("trackers")
        for name in trackers:
            if trackers.count(name) > 1:
                raise wrong(f"{name!r} is there twice", "each tracker once")
            if (
                known is not None
                and tables(info.data.get("options", ())).get(name, {}).get("tracker", name) not in known
            ):
                raise wrong(f"unknown tracker {name!r}{suggestion(name, known)}", f"one of {', '.join(sorted(known))}")
        return trackers

    @model_validator(mode="after")
    def _stands_or_drives(self) -> Self:
        for name, value in (("x_m", self.x_m), ("y_m", self.y_m)):
            if self.path is not None and value is not None:
                raise wrong(f"is {value:g}, and fusion.path says where the centre is", "one of the two", f".{name}")
        return self


# --- the whole ----------------------------------------------------------------------------------------------


class Contents(Section):
    """All that a scenario file says."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
        json_schema_extra={"expected": "letters, digits, and _ . - between them"},
        description="what runs of this scenario are called",
    )
    seed: int = Field(default=1, ge=0, description="of every random draw; another seed, another run")
    restart: Literal["never", "on-death"] = Field(
        default="never", description="what becomes of a process that dies unplanned: nothing, or it is started again"
    )
    field: Annotated[Grid | Jittered | Random | Ring | AlongPath | Beside | Surveyed, Field(discriminator="layout")] = (
        Grid()
    )
    sensor: Sensor = Acoustic()
    target: Annotated[Manoeuvre | FromFile | Waypoints, Field(discriminator="path")]
    link: Annotated[Link, Field(discriminator="model")] = Ideal()
    fusion: Fusion = Fusion()
    clock: Clocks = Clocks()
    energy: Energy = Energy()
    faults: tuple[Annotated[Fault, Field(discriminator="kind")], ...] = ()

    @model_validator(mode="after")
    def _deadline_within_step(self) -> Self:
        if self.fusion.deadline_s > self.target.step_s:
            raise wrong(
                f"is {self.fusion.deadline_s:g}",
                f"at most target.step_s, which is {self.target.step_s:g}",
                "fusion.deadline_s",
            )
        return self
