"""What the kinds of sensing have in common that are Trackfield's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from trackfield.scenario.quantities import Exact
from trackfield.scenario.sensors.sensor import SensorSection

Reach = Annotated[float, Field(ge=0.001, le=100_000)]
"""Metres that a sensor reaches; readings of more do not fit into a report."""
Near = Annotated[float, Field(ge=0.001, le=1000)]
"""Metres from a sensor within which nothing changes any more."""
Decay = Annotated[float, Field(ge=0.5, le=20)]
"""The power of the distance with which a level falls."""
Variation = Annotated[float, Field(ge=0, le=10), Exact]
"""A standard deviation of a logarithm, or of a factor."""


class BuiltInSensor(SensorSection):
    """A kind of Trackfield's own: its keys are the options of its class."""

    @property
    def options(self) -> Mapping[str, Any]:
        """See ``SensorSection``."""
        own = (name for name in type(self).model_fields if name not in SensorSection.model_fields)
        return {name: dict(one) if isinstance(one := getattr(self, name), tuple) else one for name in own}
