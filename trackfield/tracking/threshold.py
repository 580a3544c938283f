"""The sensors' threshold, set by whoever tracks: as few sensors report as the track's accuracy allows.

After each step the track's standard deviation is compared with a target value. If it is larger, the threshold is
lowered by ``STEP_DB``, so that more sensors report in the coming step; if it is below ``EASY`` times the target
value, the threshold is raised. In between it stays, so that it does not oscillate.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import dist, hypot, sqrt
from typing import Final

from trackfield.role import NS, Send, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.wire.messages import Threshold

LAST_STEP: Final = 65535
"""The highest step that a message can hold."""
STEP_DB: Final = 0.5
EASY: Final = 0.8


@dataclass(frozen=True, slots=True)
class Controller:
    """Holds the position's sd at ``target_sd_m`` (m) by a threshold from ``low_db`` to ``high_db``.

    ``reach_m``: the distance from the target's expected place within which sensors are sent the threshold.
    """

    low_db: float
    high_db: float
    start_db: float
    target_sd_m: float
    reach_m: float

    def adjusted(self, level_db: float, sd_m: float) -> float:
        """The threshold for the coming step, from that of the step before and the track's sd after it."""
        if sd_m > self.target_sd_m:
            level_db -= STEP_DB
        elif sd_m < EASY * self.target_sd_m:
            level_db += STEP_DB
        return self.bounded(level_db)

    def bounded(self, level_db: float) -> float:
        """The allowed threshold nearest to this one."""
        return min(max(level_db, self.low_db), self.high_db)


class Commander:
    """Sets the threshold of the sensors of ``bank`` after each step, as its ``controller`` says.

    Its state is the threshold in dB.
    """

    def __init__(self, controller: Controller, bank: Bank) -> None:
        self.controller, self.bank = controller, bank

    def begin(self, stored_db: float | None = None) -> float:
        """The threshold at the start of a life; ``stored_db`` is that of the life before it."""
        return self.controller.start_db if stored_db is None else self.controller.bounded(stored_db)

    def command(self, level_db: float, point: TrackPoint) -> tuple[float, tuple[Send, ...]]:
        """The threshold for the step after ``point``, and the message to the sensors that will soon hear the target."""
        if not point.mean:
            return level_db, ()
        bank, level = self.bank, self.controller.adjusted(level_db, position_sd(point))
        place, reach = expected_place(point, bank.step_ns / NS), self.controller.reach_m
        near = frozenset(id for id, position in bank.positions.items() if dist(position, place) <= reach)
        step = bank.step_at(point.at_ns) + 1
        if not near or step > LAST_STEP:
            return level, ()
        return level, (Send(Threshold(step, level), near),)


def position_sd(point: TrackPoint) -> float:
    """The largest sd (m) of a track's position over all axes: one bearing leaves the range open."""
    covariance = point.covariance
    xx, xy, yy = covariance[0], covariance[1], covariance[5]
    return sqrt(max((xx + yy) / 2.0 + hypot((xx - yy) / 2.0, xy), 0.0))


def expected_place(point: TrackPoint, seconds: float) -> tuple[float, float]:
    """Where (m) the target will be in this many seconds, at its present velocity."""
    x, y, vx, vy = point.mean
    return x + vx * seconds, y + vy * seconds
