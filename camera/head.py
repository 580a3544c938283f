"""The pan and tilt of the emulated camera: each axis turns at its speed from where it is, and then rests."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

from trackfield.models.pointing import AHEAD, EVI_D30, Direction, Motion, limited
from trackfield.role import NS


@dataclass(frozen=True, slots=True)
class Head:
    """Its motion, and when that began (local time, ns)."""

    motion: Motion = Motion(AHEAD, AHEAD, EVI_D30.pan_s, EVI_D30.tilt_s)  # noqa: RUF009  a value
    since_ns: int = 0

    def at(self, now: int) -> Direction:
        """Where it looks."""
        return self.motion.at((now - self.since_ns) / NS)

    @property
    def rests_ns(self) -> int:
        """When both axes rest."""
        return self.since_ns + ceil(self.motion.lasts_s * NS)

    def turned(self, now: int, to: Direction, pan_s: float = EVI_D30.pan_s, tilt_s: float = EVI_D30.tilt_s) -> Head:
        """It turns from where it is now, at speeds in deg/s, to there, or as far as it can."""
        return Head(Motion(self.at(now), limited(to), pan_s, tilt_s), now)

    def stopped(self, now: int) -> Head:
        """It rests where it is now, if it turned."""
        return self if now >= self.rests_ns else self.turned(now, self.at(now))


REST: Final = Head()
"""At rest, and looking ahead."""
