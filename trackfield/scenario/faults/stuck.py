"""The fault ``stuck``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import SensorFault


class Stuck(SensorFault):
    """A sensor repeats the same reading."""

    kind: Literal["stuck"] = Field(default="stuck", description="a sensor repeats the same reading")
