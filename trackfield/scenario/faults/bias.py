"""The fault ``bias``."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.faults.fault import SensorFault
from trackfield.scenario.quantities import Number
from trackfield.scenario.section import wrong


class Bias(SensorFault):
    """A sensor's readings are off by a constant."""

    kind: Literal["bias"] = Field(default="bias", description="a sensor's readings are off by a constant")
    bias_deg: float = Field(default=0.0, ge=-180, le=180, description="added to the direction of arrival")
    bias_db: float = Field(default=0.0, ge=-100, le=100, description="added to the level")

    by: tuple[Number, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=26,
        description="added to each number of a reading, in its kind's units; instead of the other two",
    )

    @model_validator(mode="after")
    def _is_off(self) -> Self:
        if self.by is not None:
            if self.bias_deg or self.bias_db:
                raise wrong("is given together with bias_deg or bias_db", "one of them", ".by")
            if not any(self.by):
                raise wrong("is 0 throughout", "at least one number other than 0", ".by")
        elif not self.bias_deg and not self.bias_db:
            raise wrong("is 0, and so is bias_db", "at least one of the two other than 0", ".bias_deg")
        return self
