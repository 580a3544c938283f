"""``doa``: an array of microphones that hears from which direction a sound comes, and how loud it is.

Zhai et al. (2009), sec. III: a sensor reports bearing and level while the level exceeds its threshold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import degrees, hypot, log, radians, tau
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Final

from trackfield.files import FAR_M
from trackfield.models.sound import audible_radius, bearing, level_db
from trackfield.sensing.readings import Said
from trackfield.sensing.sensing import Numbers, Point, Scene, Uniform
from trackfield.wire.messages import Doa as DoaMessage

if TYPE_CHECKING:
    from trackfield.filters.types import Array, Gaussian

LOUDEST_DB: Final = 200.0
"""The highest level that an array reads, and that fits into a report (docs/wire.md)."""
STUCK_DB: Final = 3.0
"""How far above its threshold the reading of a sensor is that got stuck while it heard nothing."""
BABBLE_DB: Final = 10.0
"""How far at most the readings of a babbling sensor are above its threshold."""


@dataclass(frozen=True)
class Doa:
    """Bearing (deg, clockwise from north) and level (dB) of the loudest target.

    The source has ``level_db`` at 1 m and decays with ``alpha`` (``trackfield.models.sound``). Nodes report above
    ``threshold`` times that; ``adaptive``: above a level between ``threshold_min`` and ``threshold_max`` times that,
    which whoever tracks sets. They are awake from ``margin_db`` below. The noise has the sds ``doa_sd_deg`` and
    ``level_sd_db``; trackers use the bearing alone, levels are the sensors' weights.
    """

    level_db: float = 70.0
    alpha: float = 2.0
    threshold: float | str = 0.75
    threshold_min: float = 0.70
    threshold_max: float = 0.80
    doa_sd_deg: float = 3.0
    level_sd_db: float = 0.0
    margin_db: float = 1.0

    message: ClassVar[type] = DoaMessage
    draws: ClassVar = ("doa", "level")
    units: ClassVar = ("deg", "dB")
    resolution: ClassVar = (0.01, 0.01)
    fix_sensors: ClassVar = 2
    layer: ClassVar = "rays"
    bearings: ClassVar = True

    @property
    def summary(self) -> str:
        """See ``Full``."""
        return f"bearing (sd {self.doa_sd_deg:g}°) and level"

    # --- in nodes ---

    @cached_property
    def thresholds(self) -> tuple[float, float]:
        """See ``Full``."""
        if self.threshold == "adaptive":
            return self.threshold_min * self.level_db, self.threshold_max * self.level_db
        return float(self.threshold) * self.level_db, float(self.threshold) * self.level_db

    @cached_property
    def audible_db(self) -> float:
        """The level above which a sensor hears anything."""
        return self.thresholds[0] - self.margin_db

    @property
    def range_m(self) -> float:
        """See ``Sensing``; no sensor is farther away than a field is large."""
        return min(audible_radius(self.level_db, self.alpha, self.audible_db), FAR_M)

    @property
    def report_m(self) -> float:
        """See ``Full``."""
        return min(audible_radius(self.level_db, self.alpha, self.thresholds[0]), FAR_M)

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """See ``Sensing``; of equally loud targets the first."""
        ways = [(state[0] - place[0], state[1] - place[1]) for state in scene.at(t_ns)]
        levels = [level_db(hypot(dx, dy), self.level_db, self.alpha) for dx, dy in ways]
        if not levels or (level := max(levels)) < self.audible_db:
            return None
        angle = degrees(bearing(*ways[levels.index(level)])) + self.doa_sd_deg * normals[0]
        return angle, level + self.level_sd_db * normals[1]

    def reading(self, values: Numbers) -> Said:
        """See ``Full``: any angle as one from 0 to below 360 deg, the level as what a report holds at most."""
        turned, level = values[0] % 360.0, min(values[1], LOUDEST_DB)
        return Said(DoaMessage, (0.0 if turned == 360.0 else turned, level), level)  # a tiny negative angle rounds up

    def invented(self, fault: str, threshold: float, uniform: Uniform) -> Numbers:
        """See ``Full``: a sound from a random direction, somewhat above the threshold."""
        above_db = STUCK_DB if fault == "stuck" else BABBLE_DB * uniform("level")
        return 360.0 * uniform("bearing"), threshold + above_db

    # --- where they are used ---

    @property
    def sd(self) -> tuple[float, ...]:
        """See ``Sensing``: that of the bearing (rad)."""
        return (radians(self.doa_sd_deg),)

    def values(self, message: Any) -> Numbers:
        """See ``Full``."""
        return message.bearing_deg, message.level_db

    def z(self, values: Array) -> Array:
        """See ``Full``: columns that lie in one piece, bearings in rad."""
        import numpy as np

        return np.array((np.radians(values[:, 0]), values[:, 1])).T

    def h(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        found: Array = _arrays().measure(x, at)[..., None]
        return found

    def jacobian(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        found: Array = _arrays().jacobian(x, at)[..., None, :]
        return found

    def residual(self, difference: Array) -> Array:
        """See ``Full``."""
        found: Array = _arrays().wrap(difference)
        return found

    def log_clutter(self, z: Array, at: Array) -> Array:
        """See ``Full``: any direction is as likely."""
        import numpy as np

        return np.full(len(z), -log(tau))

    def fix(self, z: Array, at: Array, anywhere: Array) -> Gaussian | None:
        """See ``Full``: the bearings that agree, if their geometry gives a place."""
        from trackfield.filters.fix import first_fix
        from trackfield.filters.types import Model, of_bearings
        from trackfield.sensing.complete import Kind

        reports = of_bearings(0, tuple(map(str, range(len(z)))), at, *z.T)
        return first_fix(reports, Model({"doa": Kind("doa", self)}), anywhere)

    def loudness(self, z: Array) -> Array:
        """See ``Full``."""
        return z[..., 1]

    def longest(self) -> DoaMessage:
        """See ``Full``."""
        return DoaMessage(step=65535, bearing_deg=359.99, level_db=70.0)

    def words(self, message: Any) -> str:
        """See ``Full``."""
        return f"DOA {message.bearing_deg:.1f} deg {message.level_db:.1f} dB"


@cache
def _arrays() -> ModuleType:
    """The formulas for arrays: imported late, as a node has no numpy, and once, as trackers call them often."""
    from trackfield.models import doa

    return doa
