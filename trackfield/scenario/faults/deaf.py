"""The fault ``deaf``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import SensorFault


class Deaf(SensorFault):
    """A sensor hears nothing."""

    kind: Literal["deaf"] = Field(default="deaf", description="a sensor hears nothing")
