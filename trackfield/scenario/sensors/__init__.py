"""``[sensor]``: the sensor of each node. A kind of sensor is a file here and a line in the table.

Any other kind is a user's own sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from trackfield.scenario.section import OTHER, open_union
from trackfield.scenario.sensors.cpa import CpaSensor
from trackfield.scenario.sensors.doa import DoaSensor
from trackfield.scenario.sensors.energy import EnergySensor
from trackfield.scenario.sensors.own import OwnSensor
from trackfield.scenario.sensors.range import RangeSensor
from trackfield.scenario.sensors.rss import RssSensor
from trackfield.scenario.sensors.sensor import OF_GROUPS, SensorSection
from trackfield.sensing.kinds import DEFAULT

__all__ = ["OF_GROUPS", "SENSORS", "DoaSensor", "OwnSensor", "Sensor", "SensorSection"]

SENSORS: Final[Mapping[str, type[SensorSection]]] = {
    DEFAULT: DoaSensor,
    "range": RangeSensor,
    "rss": RssSensor,
    "energy": EnergySensor,
    "cpa": CpaSensor,
    OTHER: OwnSensor,
}


if TYPE_CHECKING:
    Sensor = SensorSection
else:
    Sensor = open_union(SENSORS, DEFAULT)
