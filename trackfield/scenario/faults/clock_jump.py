"""The fault ``clock_jump``."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.faults.fault import FaultSection
from trackfield.scenario.quantities import Instant
from trackfield.scenario.section import wrong


class ClockJump(FaultSection):
    """A clock jumps by a constant."""

    kind: Literal["clock_jump"] = Field(default="clock_jump", description="a process's clock jumps")
    at_s: Instant = Field(description="when it happens")
    jump_ms: float = Field(
        ge=-1e9,
        le=1e9,
        json_schema_extra={"expected": "a number from -1e9 to 1e9, but not 0"},
        description="size of the jump, forward or (below 0) back",
    )

    @model_validator(mode="after")
    def _jumps(self) -> Self:
        if not self.jump_ms:
            raise wrong("is 0", "a number from -1e9 to 1e9, but not 0", ".jump_ms")
        return self
