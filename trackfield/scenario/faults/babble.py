"""The fault ``babble``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import SensorFault


class Babble(SensorFault):
    """A sensor gives random readings all the time."""

    kind: Literal["babble"] = Field(default="babble", description="a sensor gives a random, loud reading in every step")
