"""``range``: a device that measures the distance to the target, as by the time of flight of radio or ultrasound.

Özfidan, Bayram and Güvenç (2018), eqs. 19-21: the variance of the noise grows with the distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot, log, sqrt
from typing import TYPE_CHECKING, Any, ClassVar

from trackfield.sensing.readings import Said
from trackfield.sensing.sensing import IMPOSSIBLE_SD, Numbers, Point, Scene, Uniform
from trackfield.wire.messages import Range as RangeMessage

if TYPE_CHECKING:
    from trackfield.filters.types import Array


@dataclass(frozen=True)
class Range:
    """Distance (m) to the nearest target within ``range_m``.

    The variance of its noise is ``growth_m`` times the distance, and at least ``floor_sd_m`` squared.
    """

    range_m: float = 100.0
    floor_sd_m: float = 1.0
    growth_m: float = 0.02

    message: ClassVar[type] = RangeMessage
    units: ClassVar = ("m",)
    resolution: ClassVar = (0.001,)
    fix_sensors: ClassVar = 3
    layer: ClassVar = "rings"

    @property
    def summary(self) -> str:
        """See ``Full``."""
        growth = f", or {self.growth_m:g} m x distance as its variance" if self.growth_m else ""
        return f"range (sd {self.floor_sd_m:g} m{growth})"

    def _sd(self, distance_m: float) -> float:
        return sqrt(max(self.growth_m * distance_m, self.floor_sd_m**2))

    @property
    def sd(self) -> tuple[float, ...]:
        """See ``Sensing``: that in the middle of its range."""
        return (self._sd(self.range_m / 2.0),)

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """See ``Sensing``."""
        away = min((hypot(x - place[0], y - place[1]) for x, y, *_ in scene.at(t_ns)), default=self.range_m + 1.0)
        return None if away > self.range_m else (away + self._sd(away) * normals[0],)

    def possible(self, values: Numbers) -> bool:
        """See ``Full``: not farther below 0 than by noise."""
        return values[0] >= -IMPOSSIBLE_SD * self._sd(0.0)

    def reading(self, values: Numbers) -> Said:
        """See ``Full``."""
        return Said.limited(RangeMessage, values)

    def invented(self, fault: str, threshold: float, uniform: Uniform) -> Numbers:
        """See ``Full``: any distance within range."""
        return (self.range_m * uniform("distance"),)

    def values(self, message: Any) -> Numbers:
        """See ``Full``."""
        return (message.range_m,)

    def longest(self) -> RangeMessage:
        """See ``Full``."""
        return RangeMessage(65535, self.range_m)

    # --- where they are used ---

    def h(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        from trackfield.models.ranging import distances

        return distances(x, at)[..., None]

    def jacobian(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        from trackfield.models.ranging import distances_and_slopes

        return distances_and_slopes(x, at)[1][..., None, :]

    @property
    def variance(self) -> Callable[[Array, Array], Array] | None:
        """See ``Full``; None if it does not grow."""
        return self._variance if self.growth_m else None

    def _variance(self, x: Array, at: Array) -> Array:
        import numpy as np

        found: Array = np.maximum(self.growth_m * self.h(x, at), self.floor_sd_m**2)
        return found

    def loudness(self, z: Array) -> Array:
        """See ``Full``: as that of a source whose power falls with the square of the distance."""
        import numpy as np

        found: Array = -20.0 * np.log10(np.maximum(z[..., 0], self.floor_sd_m))
        return found

    def log_clutter(self, z: Array, at: Array) -> Array:
        """See ``Full``: any distance within range is as likely."""
        import numpy as np

        return np.full(len(z), -log(self.range_m))
