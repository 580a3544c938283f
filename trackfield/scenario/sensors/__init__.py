"""``[sensor]``: the sensor of each node. A kind of sensor is a file here and a line in the table.

Any other kind is a user's own sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import Discriminator, Field, Tag

from trackfield.scenario.section import OTHER
from trackfield.scenario.sensors.doa import DoaSensor
from trackfield.scenario.sensors.own import OwnSensor
from trackfield.scenario.sensors.sensor import SensorSection
from trackfield.sensing.kinds import DEFAULT

__all__ = ["SENSORS", "DoaSensor", "OwnSensor", "Sensor", "SensorSection"]

SENSORS: Final[Mapping[str, type[SensorSection]]] = {
    DEFAULT: DoaSensor,
    OTHER: OwnSensor,
}


def _kind_of(sensor: Any) -> str:
    kind = sensor.get("kind", DEFAULT) if isinstance(sensor, Mapping) else getattr(sensor, "kind", DEFAULT)
    return kind if isinstance(kind, str) and kind in SENSORS else OTHER


if TYPE_CHECKING:
    Sensor = SensorSection
else:
    Sensor = Annotated[
        reduce(or_, (Annotated[model, Tag(kind)] for kind, model in SENSORS.items())),
        Field(discriminator=Discriminator(_kind_of)),
    ]
