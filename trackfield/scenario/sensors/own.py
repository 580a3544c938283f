"""A kind of sensing of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict, Field

from trackfield.scenario.quantities import Option
from trackfield.scenario.sensors.by_sensor import Anything
from trackfield.scenario.sensors.sensor import SensorSection


class OwnSensor(SensorSection):
    """A kind of sensing that a user adds (docs/extending.md); further keys are its options, checked by its class."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Option | Anything]

    kind: str = Field(
        min_length=1, max_length=100, description="a sensor of your own; its options are further keys of this section"
    )

    @property
    def options(self) -> Mapping[str, Any]:
        """See ``SensorSection``."""
        return {name: dict(one) if isinstance(one, tuple) else one for name, one in self.__pydantic_extra__.items()}
