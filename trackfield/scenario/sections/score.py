"""``[score]``: what counts as success."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from trackfield.scenario.paths import MAX_STEPS
from trackfield.scenario.section import Positive, Section, wrong


class Lost(Section):
    """A track is lost that was too far off, or not there, for ``steps`` in a row among the last ``within``."""

    beyond_m: Positive | None = Field(
        default=None, description="a step in which a track is further off is bad; unset: fusion.lost_m"
    )
    steps: int = Field(default=1, ge=1, le=MAX_STEPS, description="so many bad steps in a row lose a track")
    within: int | None = Field(
        default=None, ge=1, le=MAX_STEPS, description="looked for in so many last steps; unset: in all"
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
        description="error above beyond_m, or no track, for that many steps in a row, in the last steps looked at",
    )
