"""``[fusion]``: the centre and its trackers."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from trackfield.scenario.nearest import suggestion
from trackfield.scenario.options import EXPECTED, Options, tables
from trackfield.scenario.paths.legs import LEGS, Legs
from trackfield.scenario.quantities import Acceleration, Coordinate, Distance, Duration, Speed
from trackfield.scenario.section import Section, Word, wrong
from trackfield.words import quoted


class Fusion(Section):
    """The fusion centre and its trackers, all of which get the same reports."""

    options: Options = Field(
        default=(),
        json_schema_extra={"expected": EXPECTED},
        description='options of single trackers; with tracker = "...", a new name is a variant of that tracker',
    )
    trackers: tuple[Word, ...] = Field(
        default=("imm-ukf",), min_length=1, max_length=100, description="which trackers run side by side"
    )
    deadline_s: Duration = Field(default=0.3, description="how long a step waits for its reports; at most step_s")
    max_age_s: float = Field(
        default=0.0,
        ge=0,
        le=3600,
        description="late reports up to this age are still fused, by going back to their step; 0: none",
    )
    smooth_lag: int = Field(
        default=0, ge=0, le=100, description="also publish smoothed tracks, this many steps later; 0: none"
    )
    smooth_rts: bool = Field(
        default=False,
        strict=True,
        description="the base also publishes each track smoothed as a whole, when it has ended",
    )
    target_sd_m: Distance = Field(
        default=3.0, description="standard deviation of the position that an adaptive threshold aims at"
    )
    x_m: Coordinate | None = Field(
        default=None, description="where the centre stands, east; unset: the middle of the field"
    )
    y_m: Coordinate | None = Field(
        default=None, description="where the centre stands, north; unset: the middle of the field"
    )
    path: Legs | None = Field(
        default=None,
        json_schema_extra=LEGS,
        description="positions of a moving centre over time, in metres east and north; unset: it does not move",
    )
    sigma_v: Acceleration = Field(
        default=0.1, description="standard deviation of the acceleration, m/s^2, for trackers with one motion model"
    )
    lost_m: Distance = Field(
        default=50.0,
        description="a track with a larger error is lost; one without a prior is restarted if its sd exceeds this",
    )
    assumed_noise: float = Field(
        default=1.0,
        ge=0.01,
        le=100,
        description="trackers take the standard deviation of readings to be so many times what it is",
    )
    speed_sd: Speed = Field(
        default=10.0,
        description="standard deviation of a target's velocity, each way, where a track starts from reports alone, m/s",
    )
    prior: Literal["paper", "none"] = Field(
        default="none",
        description="start around the true state (paper), or from the first reports alone (none)",
    )
    prior_sd: tuple[Distance, Distance, Speed, Speed] = Field(
        default=(20.0, 20.0, 4.0, 4.0),
        description="standard deviations of the paper's prior: x, y in m, vx, vy in m/s",
    )

    @field_validator("trackers")
    @classmethod
    def _known(cls, trackers: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        known = (info.context or {}).get("trackers")
        for name in trackers:
            if trackers.count(name) > 1:
                raise wrong(f"{quoted(name)} is given twice", "each tracker once")
            if (
                known is not None
                and tables(info.data.get("options", ())).get(name, {}).get("tracker", name) not in known
            ):
                raise wrong(
                    f"unknown tracker {quoted(name)}{suggestion(name, known)}", f"one of {', '.join(sorted(known))}"
                )
        return trackers

    @model_validator(mode="after")
    def _stands_or_drives(self) -> Self:
        for name, value in (("x_m", self.x_m), ("y_m", self.y_m)):
            if self.path is not None and value is not None:
                raise wrong(
                    f"is {value:g}, but fusion.path also gives the centre's place", "one of the two", f".{name}"
                )
        return self
