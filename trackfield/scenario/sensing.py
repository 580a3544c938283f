"""The section ``[sensor]``: an acoustic array, or a sensor of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from trackfield.scenario.section import Section, Share, wrong

ACOUSTIC: Final = "acoustic"
OTHER: Final = "any other"
"""Stands for all kinds of sensors that users bring."""


class _Sensor(Section):
    kind: str
    position_error_m: float = Field(
        default=0.0,
        ge=0,
        le=10_000,
        description="standard deviation, east and north, of where the centre believes a sensor to stand",
    )


class Acoustic(_Sensor):
    """One acoustic array, the same at every node: level and direction of arrival."""

    kind: Literal["acoustic"] = Field(default=ACOUSTIC, description="an array of microphones: level and bearing")
    level_db: float = Field(default=70.0, gt=0, le=200, description="the target's level at 1 m")
    alpha: float = Field(
        default=2.0,
        ge=0.5,
        le=20,
        description="decay: the level falls by 5 alpha dB for each tenfold distance",
    )
    threshold: Share | Literal["adaptive"] = Field(
        default=0.75,
        json_schema_extra={"expected": 'a number from 0 to 1, or "adaptive"'},
        description="a sensor reports above this share of level_db; adaptive: above what the centre tells it",
    )
    threshold_min: Share = Field(default=0.70, description="the lowest that an adaptive threshold may be")
    threshold_max: Share = Field(default=0.80, description="the highest that an adaptive threshold may be")
    doa_sd_deg: float = Field(default=3.0, ge=0, le=180, description="standard deviation of the direction of arrival")
    level_sd_db: float = Field(default=0.0, ge=0, le=100, description="standard deviation of the measured level")
    margin_db: float = Field(default=1.0, ge=0, le=100, description="a sensor is awake from so far below its threshold")

    @model_validator(mode="after")
    def _bounds_in_order(self) -> Self:
        if self.threshold_min > self.threshold_max:
            least = f"at least threshold_min, which is {self.threshold_min:g}"
            raise wrong(f"is {self.threshold_max:g}", least, ".threshold_max")
        return self

    @property
    def adaptive(self) -> bool:
        """Whether the fusion centre tells the sensors their threshold."""
        return self.threshold == "adaptive"

    @property
    def thresholds_db(self) -> tuple[float, float]:
        """The lowest and the highest level from which a sensor may come to report."""
        if self.threshold == "adaptive":
            return self.threshold_min * self.level_db, self.threshold_max * self.level_db
        return self.threshold * self.level_db, self.threshold * self.level_db

    @property
    def threshold_db(self) -> float:
        """The level above which a sensor reports, until it is told otherwise."""
        return sum(self.thresholds_db) / 2

    @property
    def audible_db(self) -> float:
        """The level above which a sensor hears anything."""
        return self.thresholds_db[0] - self.margin_db


class OwnSensor(_Sensor):
    """A kind of sensor that a user brings (docs/extending.md); further keys are its options, checked by its class."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, bool | int | float | str]

    kind: str = Field(min_length=1, description="a sensor of your own, whose options stand beside this")

    @property
    def options(self) -> dict[str, bool | int | float | str]:
        """What its class is made with."""
        return dict(self.__pydantic_extra__)


def _kind_of(sensor: Any) -> str:
    kind = sensor.get("kind", ACOUSTIC) if isinstance(sensor, Mapping) else getattr(sensor, "kind", ACOUSTIC)
    return ACOUSTIC if kind == ACOUSTIC else OTHER


Sensor = Annotated[
    Annotated[Acoustic, Tag(ACOUSTIC)] | Annotated[OwnSensor, Tag(OTHER)],
    Field(discriminator=Discriminator(_kind_of)),
]
