"""``[score]``: what counts as success."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from trackfield.scenario.paths import MAX_STEPS
from trackfield.scenario.quantities import Distance
from trackfield.scenario.section import Section, wrong


class Lost(Section):
    """A track is lost if it was too far off, or missing, for ``steps`` in a row among the last ``within``."""

    beyond_m: Distance | None = Field(
        default=None, description="a step with a larger position error is bad; unset: fusion.lost_m"
    )
    steps: int = Field(
        default=1, ge=1, le=MAX_STEPS, description="number of bad steps in a row after which a track is lost"
    )
    within: int | None = Field(
        default=None, ge=1, le=MAX_STEPS, description="only this many last steps are examined; unset: all"
    )

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if self.within is not None and self.steps > self.within:
            raise wrong(f"is {self.steps}", f"at most within, which is {self.within}", ".steps")
        return self


class Score(Section):
    """How tracks are judged."""

    lost: Lost = Field(
        default=Lost(within=1),
        json_schema_extra={"expected": "a table, like { beyond_m = 50.0, steps = 3, within = 10 }"},
        description="a target is lost after this many steps in a row, among the last, without a track within beyond_m",
    )
