"""The sensor ``acoustic``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from trackfield.models.sound import audible_radius
from trackfield.scenario.places import Place
from trackfield.scenario.quantities import Share
from trackfield.scenario.section import wrong
from trackfield.scenario.sensors.sensor import SensorSection
from trackfield.sensing.readings import Window
from trackfield.world.acoustic import AcousticSensor
from trackfield.world.path import Path

ACOUSTIC: Final = "acoustic"


class Acoustic(SensorSection):
    """One acoustic array, the same at every node: level and direction of arrival."""

    reach_key: ClassVar[str] = "sensor.threshold"

    kind: Literal["acoustic"] = Field(default=ACOUSTIC, description="an array of microphones: level and bearing")
    level_db: float = Field(default=70.0, ge=0.001, le=200, description="the target's level at 1 m")
    alpha: float = Field(
        default=2.0,
        ge=0.5,
        le=20,
        description="decay: the level falls by 5 alpha dB for each tenfold distance",
    )
    threshold: Share | Literal["adaptive"] = Field(
        default=0.75,
        json_schema_extra={"expected": 'a number from 0 to 1, or "adaptive"'},
        description="a sensor reports above this share of level_db; adaptive: above the level that the centre sets",
    )
    threshold_min: Share = Field(default=0.70, description="lower bound of an adaptive threshold")
    threshold_max: Share = Field(default=0.80, description="upper bound of an adaptive threshold")
    doa_sd_deg: float = Field(
        default=3.0, ge=0.001, le=180, description="standard deviation of the direction of arrival"
    )
    level_sd_db: float = Field(default=0.0, ge=0, le=100, description="standard deviation of the measured level")
    margin_db: float = Field(
        default=1.0, ge=0, le=100, description="a sensor is awake from this far below its threshold"
    )

    @model_validator(mode="after")
    def _bounds_in_order(self) -> Self:
        if self.threshold_min > self.threshold_max:
            least = f"at least threshold_min, which is {self.threshold_min:g}"
            raise wrong(f"is {self.threshold_max:g}", least, ".threshold_max")
        return self

    @property
    def adaptive(self) -> bool:
        """Whether the fusion centre sets the sensors' threshold."""
        return self.threshold == "adaptive"

    @property
    def thresholds_db(self) -> tuple[float, float]:
        """The lowest and the highest level that may be the threshold."""
        if self.threshold == "adaptive":
            return self.threshold_min * self.level_db, self.threshold_max * self.level_db
        return self.threshold * self.level_db, self.threshold * self.level_db

    @property
    def threshold_db(self) -> float:
        """The level above which a sensor reports, until the centre sets another."""
        return sum(self.thresholds_db) / 2

    @property
    def audible_db(self) -> float:
        """The level above which a sensor hears anything."""
        return self.thresholds_db[0] - self.margin_db

    def reach_m(self) -> tuple[float, float]:
        """See ``SensorSection``."""
        awake_m, report_m = (
            audible_radius(self.level_db, self.alpha, db) for db in (self.audible_db, self.thresholds_db[0])
        )
        return awake_m, report_m

    def plain(self, place: Place, paths: Sequence[Path], windows: Sequence[Window], seed: int) -> dict[str, Any]:
        """See ``SensorSection``."""
        return self.placed(place, paths, windows, seed).to_plain()

    def placed(
        self, place: Place, paths: Sequence[Path], windows: Sequence[Window], seed: int, incarnation: int = 0
    ) -> AcousticSensor:
        """The sensor at a ``place``."""
        id, x, y = place
        return AcousticSensor(
            id=id,
            position=(x, y),
            paths=tuple(paths),
            windows=tuple(windows),
            source_db=self.level_db,
            alpha=self.alpha,
            audible_db=self.audible_db,
            doa_sd_deg=self.doa_sd_deg,
            level_sd_db=self.level_sd_db,
            seed=seed,
            incarnation=incarnation,
        )
