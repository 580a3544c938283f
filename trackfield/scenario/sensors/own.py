"""A user's own sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from pydantic import ConfigDict, Field

from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Option
from trackfield.scenario.sensors.sensor import SensorSection
from trackfield.sensing.kinds import make_sensor
from trackfield.sensing.readings import Window
from trackfield.world.own import PlacedSensor, plain
from trackfield.world.path import Path


class OwnSensor(SensorSection):
    """A kind of sensor that a user adds (docs/extending.md); further keys are its options, checked by its class."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Option]

    reach_key: ClassVar[str] = "sensor.range_m"

    kind: str = Field(
        min_length=1, max_length=100, description="a sensor of your own; its options are further keys of this section"
    )

    @property
    def options(self) -> dict[str, bool | int | float | str]:
        """The arguments of its class."""
        return dict(self.__pydantic_extra__)

    def reach_m(self) -> tuple[float, float]:
        """See ``SensorSection``; it is awake as far as it measures."""
        range_m = make_sensor(self.kind, self.options).range_m
        return range_m, range_m

    def plain(self, place: Place, paths: Sequence[Path], windows: Sequence[Window], seed: int) -> dict[str, Any]:
        """See ``SensorSection``."""
        id, x, y = place
        made = make_sensor(self.kind, self.options)
        placed = PlacedSensor(id, (x, y), tuple(paths), tuple(windows), made, seed)
        return plain(placed, self.kind, self.options)
