"""The sensor ``doa``."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.quantities import Share
from trackfield.scenario.section import wrong
from trackfield.scenario.sensors.built_in import BuiltInSensor


class DoaSensor(BuiltInSensor):
    """One acoustic array, the same at every node: level and direction of arrival."""

    reach_key: ClassVar[str] = "threshold"

    kind: Literal["doa"] = Field(default="doa", description="an array of microphones: level and bearing")
    level_db: float = Field(default=70.0, ge=0.001, le=200, description="the target's level at 1 m")
    alpha: float = Field(
        default=2.0,
        ge=0.5,
        le=20,
        description="decay: the level falls by 5 alpha dB for each tenfold distance",
    )
    threshold: Share | Literal["adaptive"] = Field(
        default=0.75,
        json_schema_extra={"expected": 'a number from 0 to 1, or "adaptive"'},
        description="a sensor reports above this share of level_db; adaptive: above the level that the centre sets",
    )
    threshold_min: Share = Field(default=0.70, description="lower bound of an adaptive threshold")
    threshold_max: Share = Field(default=0.80, description="upper bound of an adaptive threshold")
    doa_sd_deg: float = Field(
        default=3.0, ge=0.001, le=180, description="standard deviation of the direction of arrival"
    )
    level_sd_db: float = Field(default=0.0, ge=0, le=100, description="standard deviation of the measured level")
    margin_db: float = Field(
        default=1.0, ge=0, le=100, description="a sensor is awake from this far below its threshold"
    )

    @model_validator(mode="after")
    def _bounds_in_order(self) -> Self:
        if self.threshold_min > self.threshold_max:
            least = f"at least threshold_min, which is {self.threshold_min:g}"
            raise wrong(f"is {self.threshold_max:g}", least, ".threshold_max")
        return self
