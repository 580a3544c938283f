"""The sensor ``rss``."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.quantities import Duration, Share
from trackfield.scenario.section import wrong
from trackfield.scenario.sensors.built_in import BuiltInSensor, Decay, Near, Reach
from trackfield.scenario.sensors.by_sensor import Decibels


class RssSensor(BuiltInSensor):
    """A receiver that measures the strength of the target's radio signal, the same at every node."""

    kind: Literal["rss"] = Field(
        default="rss", description="a receiver that measures how strong the target's signal is"
    )
    range_m: Reach = Field(default=100.0, description="beyond this distance nothing is measured")
    level_dbm: float = Field(default=-40.0, ge=-150, le=100, description="the signal's level at 1 m")
    exponent: Decay = Field(
        default=3.0, description="decay: the level falls by 10 times this, in dB, for each tenfold distance"
    )
    shadow_sd_db: float = Field(
        default=4.0, ge=0.001, le=30, description="standard deviation of the shadowing, which is added to the level"
    )
    floor_m: Near = Field(default=0.1, description="nearer than this the level is as at this distance")
    slow: Share = Field(default=0.0, description="share of the shadowing's variance that changes slowly")
    slow_s: Duration = Field(default=10.0, description="after twice this time nothing of the slow share is left")
    fixed: Share = Field(default=0.0, description="share of the shadowing's variance that is a sensor's own for good")
    missing: Share = Field(default=0.0, description="share of all readings that are not there, wherever the target is")
    offsets: Decibels = Field(
        default=(),
        description="dB by which single sensors read more than others; trackers know them, and take them off",
    )

    @model_validator(mode="after")
    def _shares_of_a_whole(self) -> Self:
        if self.slow + self.fixed > 1.0:
            raise wrong(f"is {self.fixed:g}, and slow is {self.slow:g}", "shares that are at most 1 together", ".fixed")
        return self
