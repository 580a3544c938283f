"""``rss``: a receiver that measures how strong the target's radio signal is; log-distance path loss with shadowing.

Zhou et al. (2011): the level falls by 10 n dB per decade of distance, and obstacles change it by a normal variable in
dB. It is used as it is, in dB: a distance made from it would be biased.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, hypot, log, log10
from typing import TYPE_CHECKING, Any, ClassVar, Final

from trackfield.models.noise import Colour
from trackfield.sensing.readings import Said
from trackfield.sensing.sensing import IMPOSSIBLE_SD, Numbers, Point, Scene, Uniform
from trackfield.wire.messages import Rss as RssMessage

if TYPE_CHECKING:
    from trackfield.filters.types import Array

TAIL_SD: Final = 3.0
"""How far beyond the levels of its range a reading may be, in sds."""
FARTHEST: Final = 20.0
"""The logarithm of the largest distance that is drawn."""


@dataclass(frozen=True)
class Rss:
    """Level (dBm) of the nearest target's signal within ``range_m``.

    ``level_dbm`` is the level at 1 m, ``exponent`` the n of its decay; closer than ``floor_m`` it is as there. Of the
    shadowing's variance, ``shadow_sd_db`` squared, the share ``slow`` changes slowly, and entirely within twice
    ``slow_s`` seconds; the share ``fixed`` is the sensor's own for good. Trackers take all of it to be drawn anew each
    time. A sensor of the ``offsets`` (dB by id) reads so much more than others, which trackers take off; the share
    ``missing`` of all readings is not there.
    """

    range_m: float = 100.0
    level_dbm: float = -40.0
    exponent: float = 3.0
    shadow_sd_db: float = 4.0
    floor_m: float = 0.1
    slow: float = 0.0
    slow_s: float = 10.0
    fixed: float = 0.0
    missing: float = 0.0
    offsets: Mapping[str, float] = field(default_factory=dict)

    message: ClassVar[type] = RssMessage
    units: ClassVar = ("dBm",)
    resolution: ClassVar = (0.01,)
    fix_sensors: ClassVar = 3
    layer: ClassVar = "rings"

    @property
    def colour(self) -> Colour | None:
        """See ``Full``."""
        return Colour(self.slow, self.slow_s, self.fixed) if self.slow or self.fixed else None

    @property
    def summary(self) -> str:
        """See ``Full``."""
        return f"received signal strength (shadowing sd {self.shadow_sd_db:g} dB)"

    @property
    def sd(self) -> tuple[float, ...]:
        """See ``Sensing``."""
        return (self.shadow_sd_db,)

    def _level(self, distance_m: float) -> float:
        return self.level_dbm - 10.0 * self.exponent * log10(max(distance_m, self.floor_m))

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """See ``Sensing``."""
        away = min((hypot(x - place[0], y - place[1]) for x, y, *_ in scene.at(t_ns)), default=self.range_m + 1.0)
        return None if away > self.range_m else (self._level(away) + self.shadow_sd_db * normals[0],)

    def biased(self, values: Numbers, id: str) -> Numbers:
        """See ``Full``."""
        return (values[0] + self.offsets.get(id, 0.0),)

    def corrected(self, values: Numbers, id: str) -> Numbers:
        """See ``Full``."""
        return (values[0] - self.offsets.get(id, 0.0),)

    def possible(self, values: Numbers) -> bool:
        """See ``Full``: no place is nearer than the sensor's own."""
        return values[0] <= self._level(0.0) + IMPOSSIBLE_SD * self.shadow_sd_db

    def reading(self, values: Numbers) -> Said:
        """See ``Full``."""
        return Said.limited(RssMessage, values)

    def invented(self, fault: str, threshold: float, uniform: Uniform) -> Numbers:
        """See ``Full``: the level of a target anywhere on a line through its range."""
        return (self._level(self.range_m * uniform("distance")),)

    def values(self, message: Any) -> Numbers:
        """See ``Full``."""
        return (message.level_dbm,)

    def longest(self) -> RssMessage:
        """See ``Full``."""
        return RssMessage(65535, -300.0)

    # --- where they are used ---

    def h(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        import numpy as np

        from trackfield.models.ranging import distances

        away = np.maximum(distances(x, at), self.floor_m)
        found: Array = self.level_dbm - 10.0 * self.exponent * np.log10(away)[..., None]
        return found

    def jacobian(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        import numpy as np

        from trackfield.models.ranging import distances_and_slopes

        away, slopes = distances_and_slopes(x, at)
        fall = np.where(away > self.floor_m, -10.0 * self.exponent / (log(10.0) * np.maximum(away, self.floor_m)), 0.0)
        found: Array = (fall[..., None] * slopes)[..., None, :]
        return found

    def loudness(self, z: Array) -> Array:
        """See ``Full``."""
        return z[..., 0]

    def log_clutter(self, z: Array, at: Array) -> Array:
        """See ``Full``: any level from that at 1 m to that at the end of its range, or somewhat beyond."""
        import numpy as np

        span = self._level(min(1.0, self.range_m / 2.0)) - self._level(self.range_m) + 2.0 * TAIL_SD * self.shadow_sd_db
        return np.full(len(z), -log(span))

    def drawn(self, values: Numbers) -> float:
        """See ``Full``: the distance that the level stands for, in the mean over the shadowing.

        With the shadowing, 10^((level_dbm - level) / 10 n) is log-normal: e^(s^2 / 2) too far in the mean.
        """
        log_distance = log(10.0) * (self.level_dbm - values[0]) / (10.0 * self.exponent)
        s = self.shadow_sd_db * log(10.0) / (10.0 * self.exponent)
        return max(exp(min(log_distance - s**2 / 2.0, FARTHEST)), self.floor_m)
