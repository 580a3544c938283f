"""The fault ``kill``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import FaultSection, Instant


class Kill(FaultSection):
    """A process ends, for good."""

    kind: Literal["kill"] = Field(default="kill", description="a process ends for good")
    at_s: Instant = Field(description="when it happens")
