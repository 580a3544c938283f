"""The fault ``kill``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import FaultSection
from trackfield.scenario.quantities import LaterInstant


class Kill(FaultSection):
    """A process ends, for good."""

    kind: Literal["kill"] = Field(default="kill", description="a process ends for good")
    at_s: LaterInstant = Field(description="when it happens")
