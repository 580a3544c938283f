"""The fault ``restart``."""

from __future__ import annotations

from typing import Final, Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.faults.fault import FaultSection, ordered
from trackfield.scenario.quantities import LaterInstant

MIN_DOWN_S: Final = 1.0
"""The shortest time for which a restarted process is down."""


class Restart(FaultSection):
    """A process ends, and is started again with only what it stored."""

    kind: Literal["restart"] = Field(default="restart", description="a process ends and is started again later")
    at_s: LaterInstant = Field(description="when it happens")
    until_s: LaterInstant = Field(
        json_schema_extra={"expected": "a number, at least 1 s after at_s"}, description="when it is started again"
    )

    @model_validator(mode="after")
    def _is_down_for_a_while(self) -> Self:
        return ordered(self, self.at_s, self.until_s, MIN_DOWN_S)
