"""What passes between the parts of the launcher about a camera beyond a gateway: what its processes told of it.

All times are emulated, in ns since the start of the run; of ``Aim.cpa_ns`` and ``aim_ns`` as camera control has them by
its corrected clock. Angles are in degrees, as in ``trackfield/models/pointing.py``.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Final, NamedTuple

from trackfield.models.pointing import AIM_M, Direction, Motion, Mount, in_view
from trackfield.role import NS
from trackfield.wire import outside as wire
from trackfield.world.path import Path

GATEWAY: Final = "gateway"
FORWARDER: Final = "forwarder"
CONTROL: Final = "camera-control"
CAMERA: Final = "camera"
VIDEO: Final = "video"
SYSTEM: Final = "system"
"""The roles of these processes."""
AIMED: Final = "aimed"
"""The outcome of a fix by which the camera was aimed: a shot."""
OUTCOMES: Final = (AIMED, "out of reach", "repeated", "superseded", "later", "camera lost")
"""What camera control may make of a fix."""
LOST: Final = "lost"
STATES: Final = ("ready", LOST, "moving", "there", "failed")
"""What camera control may know of the camera."""
ANSWERS: Final = (*wire.ANSWERS, "silent")
"""How an order may end; silent: without an answer."""


class Turn(NamedTuple):
    """The camera told that it moves like this from ``t_ns`` on."""

    t_ns: int
    pan0: float
    tilt0: float
    pan1: float
    tilt1: float
    pan_deg_s: float
    tilt_deg_s: float

    @property
    def motion(self) -> Motion:
        """Where it looks in the course of that."""
        start, to = Direction(self.pan0, self.tilt0), Direction(self.pan1, self.tilt1)
        return Motion(start, to, self.pan_deg_s, self.tilt_deg_s)

    @property
    def to(self) -> Direction:
        """Where it looks in the end."""
        return Direction(self.pan1, self.tilt1)


class Aim(NamedTuple):
    """What camera control made of a fix at ``t_ns``: the values of the topic ``aimed``."""

    t_ns: int
    shot: int
    head: str
    step: int
    delay_s: float
    cpa_ns: int
    aim_ns: int
    aim_x_m: float
    aim_y_m: float
    pan_deg: float
    tilt_deg: float
    outcome: str

    @property
    def to(self) -> Direction:
        """Where the camera was told to look."""
        return Direction(self.pan_deg, self.tilt_deg)


class Exposure(NamedTuple):
    """A frame of the video of a shot, exposed at ``t_ns``."""

    t_ns: int
    shot: int
    frame: int


class Counts(NamedTuple):
    """Items that wait in the gateway, and how many it has handed on, refused, dropped, and had nobody for, in a life.

    ``life`` is the number of that life of the gateway's process.
    """

    t_ns: int
    life: int
    waiting: int
    passed: int
    refused: int
    dropped: int
    unwanted: int


class Known(NamedTuple):
    """What camera control knows of the camera from ``t_ns`` on."""

    t_ns: int
    state: str


class Ordered(NamedTuple):
    """An order of system control to the process ``id``, and how it ended, at ``t_ns``."""

    t_ns: int
    number: int
    verb: str
    id: str
    answer: str


class Refusal(NamedTuple):
    """A ``process`` refused an order of somebody."""

    t_ns: int
    process: str
    sender: str
    why: str


class Target(NamedTuple):
    """Where a target truly was (m)."""

    id: str
    x_m: float
    y_m: float


@dataclass(frozen=True)
class Outside:
    """All that processes told of a camera, each in the order of time; ``mount`` is where it stands."""

    mount: Mount
    turns: tuple[Turn, ...] = ()
    aims: tuple[Aim, ...] = ()
    exposures: tuple[Exposure, ...] = ()
    counts: tuple[Counts, ...] = ()
    states: tuple[Known, ...] = ()
    orders: tuple[Ordered, ...] = ()
    refusals: tuple[Refusal, ...] = ()

    @cached_property
    def shots(self) -> tuple[Aim, ...]:
        """The fixes by which the camera was aimed."""
        return tuple(one for one in self.aims if one.outcome == AIMED)

    def turn_at(self, t_ns: int) -> Turn | None:
        """The latest turn that had begun by then; None if none is known."""
        at = bisect_right(self.turns, t_ns, key=lambda one: one.t_ns)
        return self.turns[at - 1] if at else None

    def look_at(self, t_ns: int) -> Direction | None:
        """Where the camera really looked; None if it had not told, as a real one in its place does not."""
        turn = self.turn_at(t_ns)
        return None if turn is None else turn.motion.at((t_ns - turn.t_ns) / NS)

    def shot_at(self, t_ns: int) -> Aim | None:
        """The latest shot by then, whose command the camera has; None before the first."""
        at = bisect_right(self.shots, t_ns, key=lambda one: one.t_ns)
        return self.shots[at - 1] if at else None

    def after(self, shot: Aim) -> Aim | None:
        """The shot after this one."""
        at = bisect_right(self.shots, shot.t_ns, key=lambda one: one.t_ns)
        return self.shots[at] if at < len(self.shots) else None

    def shot_of(self, frame: Exposure) -> Aim | None:
        """The shot that a frame belongs to: the latest of its number before it; numbers on the wire are cyclic."""
        at = bisect_right(self.shots, frame.t_ns, key=lambda one: one.t_ns)
        number = frame.shot % wire.ITEMS
        return next((one for one in reversed(self.shots[:at]) if one.shot % wire.ITEMS == number), None)

    def sees(self, t_ns: int, target: Target | None) -> bool | None:
        """Whether the middle of a target is in the picture then; not if there is none; None if nobody knows."""
        look = self.look_at(t_ns)
        if look is None:
            return None
        return target is not None and in_view(self.mount, look, target.x_m, target.y_m, AIM_M)


def meant(paths: Mapping[str, Path], aim: Aim) -> str | None:
    """The target that a shot is of: the one that is nearest to where it aims, when it aims; None if none is there."""
    found = nearest(paths, aim.aim_ns, aim.aim_x_m, aim.aim_y_m)
    return None if found is None else found.id


def nearest(paths: Mapping[str, Path], t_ns: int, x_m: float, y_m: float) -> Target | None:
    """The target that was nearest to a point; None if none was there."""
    there = [one for id in paths if (one := target_at(paths, id, t_ns))]
    return min(there, key=lambda one: hypot(one.x_m - x_m, one.y_m - y_m), default=None)


def target_at(paths: Mapping[str, Path], id: str | None, t_ns: int) -> Target | None:
    """Where a target was, by the targets' paths in emulated time; None if it was not there."""
    state = paths[id].at(t_ns / NS) if id is not None and id in paths else None
    return None if id is None or state is None else Target(id, state[0], state[1])
