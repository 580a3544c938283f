"""What items say of targets: fixes, and which of them are of the same target."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite, sqrt
from typing import Final

import numpy as np

from camera.settings import USEFUL_S, Settings
from trackfield.filters.belief import dimension, moments
from trackfield.role import NS
from trackfield.tracking.plausible import MOST_M, MOST_M_S
from trackfield.tracking.stored import unpack
from trackfield.wire.codec import decoded
from trackfield.wire.outside import Item
from trackfield.wire.passes import FixReport
from trackfield.wire.raw import unpack as unpack_raw

LONG_M: Final = 5.0
"""A vehicle is so long: what is heard of it may be anywhere on it."""
CHANGES_M_S2: Final = 1.0
"""The velocity of a vehicle may change by so much in a second: a comfortable braking, or a bend."""
SDS: Final = 3.0
"""Two fixes are of one target if they differ by no more than so many standard deviations, and the two above."""

Vector = tuple[float, float, float, float]


class NoFixError(ValueError):
    """An item is no use; the reason is for the count of ignored frames."""


@dataclass(frozen=True, slots=True)
class Target:
    """A target as ``head`` fixed it: ``state`` (x, y, vx, vy; m, m/s) at ``at_ns``, the instant of ``step``.

    ``number`` is that of the head's event. The last sensor that it passed did so at ``cpa_ns``, and the fix came at
    ``came_ns``: times of the run, as far as the own clock knows. ``sd_m`` and ``sd_m_s`` are standard deviations of
    place and velocity, both ways together.
    """

    head: str
    number: int
    step: int
    at_ns: int
    cpa_ns: int
    came_ns: int
    state: Vector
    sd_m: float
    sd_m_s: float

    @property
    def key(self) -> tuple[str, int, int]:
        """By which the same fix is known again."""
        return self.head, self.number, self.step

    @property
    def delay_s(self) -> float:
        """From the last pass to its arrival."""
        return (self.came_ns - self.cpa_ns) / NS

    def age_s(self, now_ns: int) -> float:
        """How old ``state`` is at a time of the run."""
        return (now_ns - self.at_ns) / NS

    def at(self, time_ns: int) -> tuple[float, float]:
        """Where it is at a time of the run (m), by its velocity."""
        (x, y, vx, vy), age_s = self.state, self.age_s(time_ns)
        return x + vx * age_s, y + vy * age_s

    def same(self, other: Target) -> bool:
        """Whether both can be of one target: it is where the older one says, as fast, and goes the same way."""
        apart_s = abs(self.at_ns - other.at_ns) / NS
        if apart_s > USEFUL_S:
            return False
        if (self.head, self.number) == (other.head, other.number):
            return True
        x, y = self.at(other.at_ns)
        speed_sd, sd_m = hypot(self.sd_m_s, other.sd_m_s), hypot(self.sd_m, other.sd_m)
        gate_m = LONG_M + SDS * hypot(sd_m, speed_sd * apart_s) + CHANGES_M_S2 * apart_s**2 / 2
        gate_m_s = SDS * speed_sd + CHANGES_M_S2 * (apart_s + 1.0)
        away_m = hypot(x - other.state[0], y - other.state[1])
        faster_m_s = hypot(self.state[2] - other.state[2], self.state[3] - other.state[3])
        return away_m <= gate_m and faster_m_s <= gate_m_s


def read(item: Item, settings: Settings, came_ns: int) -> Target:
    """The fix that an item brings at ``came_ns`` (time of the run). Raises ``NoFixError``."""
    fix = decoded(item.message)
    if not isinstance(fix, FixReport):
        raise NoFixError("unexpected")
    try:
        belief = unpack(fix.belief).beliefs.get(settings.tracker) if fix.belief else None
        raw = unpack_raw(fix.raw)
    except ValueError:
        raise NoFixError("unusable fix") from None
    if belief is None:
        raise NoFixError("no fix")
    if dimension(belief) < 4:
        raise NoFixError("unusable fix")
    with np.errstate(all="ignore"):
        mean, covariance = moments(belief)
        x, y, vx, vy = (float(one) for one in mean[:4])
        place, speed = (float(covariance[i, i] + covariance[i + 1, i + 1]) for i in (0, 2))
    if not _can_be((x, y, vx, vy), place, speed):
        raise NoFixError("unusable fix")
    at_ns = settings.origin_ns + fix.step * settings.step_ns
    cpa_ns = at_ns - round(min((one.early_s for one in raw), default=0.0) * NS)
    head = item.origin.decode("ascii", "replace")
    return Target(head, fix.number, fix.step, at_ns, cpa_ns, came_ns, (x, y, vx, vy), sqrt(place), sqrt(speed))


def _can_be(state: Vector, place: float, speed: float) -> bool:
    """Whether there can be a target with this state and these variances; a NaN is not within anything."""
    x, y, vx, vy = state
    near = max(abs(x), abs(y)) <= MOST_M and max(abs(vx), abs(vy)) <= MOST_M_S and all(map(isfinite, state))
    return near and 0 <= place <= 2 * MOST_M**2 and 0 <= speed <= 2 * MOST_M**2
