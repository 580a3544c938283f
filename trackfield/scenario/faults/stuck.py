"""The fault ``stuck``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import SensorFault


class Stuck(SensorFault):
    """A sensor reads the same over and over."""

    kind: Literal["stuck"] = Field(default="stuck", description="a sensor reads the same over and over")
