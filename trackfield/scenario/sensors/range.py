"""The sensor ``range``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.quantities import Length
from trackfield.scenario.sensors.built_in import BuiltInSensor, Reach


class RangeSensor(BuiltInSensor):
    """A device that measures distances, the same at every node."""

    kind: Literal["range"] = Field(default="range", description="a device that measures the distance to the target")
    range_m: Reach = Field(default=100.0, description="beyond this distance nothing is measured")
    floor_sd_m: float = Field(
        default=1.0, ge=0.001, le=10_000, description="smallest standard deviation of a measured distance"
    )
    growth_m: Length = Field(
        default=0.02, description="the variance of a measured distance is this times the distance, if that is more"
    )
