"""Camera control and the camera, joined by a serial line in virtual time, which can be cut or lose packets."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from typing import Any, Final

import numpy as np

from camera.control import Control
from camera.ptz import Camera
from trackfield.filters.types import Gaussian
from trackfield.models.pointing import Direction, Motion
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    Note,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Tell,
    Timer,
)
from trackfield.tracking.stored import pack
from trackfield.wire.codec import decoded, encode
from trackfield.wire.outside import Item, ItemAck, Visca
from trackfield.wire.passes import FIXES, FixReport
from trackfield.wire.raw import Raw
from trackfield.wire.raw import pack as pack_raw

BAUD: Final = 9600
STEP_NS: Final = NS // 2
MOUNT: Final = {"x_m": 30.0, "y_m": -25.0, "z_m": 2.0, "heading_deg": 90.0}
"""North."""
WANTED: Final = {"task": FIXES, "x_m": 0.0, "y_m": 0.0, "radius_m": 30.0, "lasts_s": 60.0}
Lose = Callable[[str, bytes, int], bool]
"""Whether a packet of ``control`` or ``camera`` is lost, the how many-th of its kind (the same bytes)."""


def control(**changes: Any) -> Control:
    """The control of a camera at (30, -25) that looks north; steps of half a second begin at 0."""
    config: dict[str, Any] = {
        **{"id": "camera-control", "gateway": "base", "camera": "camera", "video": "video", "mount": MOUNT},
        **{"origin_ns": 0, "step_ns": STEP_NS, "tracker": "ml", "predict": True, "shot_s": 4.0},
        **{"patience_ns": NS // 2, "wanted": WANTED, "baud": BAUD},
    }
    return Control(**{**config, **changes})


def belief(x: float, y: float, vx: float, vy: float, sd_m: float = 0.3, sd_m_s: float = 0.1) -> Gaussian:
    """Of a target."""
    return Gaussian(np.array([x, y, vx, vy]), np.diag(np.square([sd_m, sd_m, sd_m_s, sd_m_s])))


def fix(
    step: int, *state: float, number: int = 0, early_s: float = 1.0, known: dict[str, Any] | None = None
) -> FixReport:
    """What a head tells after a step; the last sensor heard the target ``early_s`` before."""
    beliefs = {"ml": belief(*state)} if known is None else known
    raw = pack_raw([Raw(1, early_s + 2.0, -20.0, 1.0), Raw(0, early_s, -20.0, 1.0)])
    return FixReport(number, step, 0, pack(step, None, beliefs), raw)


def item(message: Any, number: int = 0, life: int = 0, head: str = "n000") -> Item:
    """As the gateway passes it on."""
    return Item(number, life, FIXES, head.encode(), message if isinstance(message, bytes) else encode(message))


class Joined:
    """Both roles from 0 s on, the camera first. ``sent``, ``said`` and ``packets`` are what came of it, with times."""

    def __init__(self, role: Control | None = None, lose: Lose = lambda who, packet, count: False) -> None:
        self.roles: dict[str, Any] = {"camera": Camera(id="camera", peer="control"), "control": role or control()}
        self.states = {who: role.begin() for who, role in self.roles.items()}
        self.lose, self.plugged, self.now, self._number = lose, True, 0, 0
        self.sent: list[tuple[int, Any, str]] = []
        self.said: list[tuple[int, str, Effect]] = []
        self.packets: list[tuple[int, str, bytes]] = []
        self.stored = b""
        self._heap: list[tuple[int, int, str, Event, int]] = []
        self._timers: dict[tuple[str, str], int] = {}
        self._lives = dict.fromkeys(self.roles, 0)
        self._free = dict.fromkeys(self.roles, 0)
        self._counts: defaultdict[tuple[str, bytes], int] = defaultdict(int)
        for who in self.roles:
            self._push(0, who, Started(0))

    # --- what happens ----------------------------------------------------------------------------------------------

    def run(self, until_s: float) -> Joined:
        """Up to and with this instant."""
        while self._heap and self._heap[0][0] <= round(until_s * NS):
            at_ns, number, who, event, life = heappop(self._heap)
            if life != self._lives[who]:
                continue
            if isinstance(event, Timer):
                if self._timers.get((who, event.name)) != number:
                    continue
                del self._timers[who, event.name]
            self.now = at_ns
            self._handle(who, event)
        self.now = round(until_s * NS)
        return self

    def give(self, message: Any, sender: str = "base", medium: Any = "backbone") -> tuple[Effect, ...]:
        """Camera control receives a message now."""
        return self._handle("control", Received(self.now, message, sender, medium))

    def restart(self) -> None:
        """Camera control dies, and begins its next life at once."""
        self._lives["control"] += 1
        self.states["control"] = self.roles["control"].begin()
        self._timers = {key: at for key, at in self._timers.items() if key[0] != "control"}
        self._push(self.now, "control", Started(self.now, self.stored))

    def power_cycle(self) -> None:
        """The camera loses its power, and gets it again."""
        self._lives["camera"] += 1
        self.states["camera"] = self.roles["camera"].begin()
        self._timers = {key: at for key, at in self._timers.items() if key[0] != "camera"}
        self._push(self.now, "camera", Started(self.now))

    # --- what came of it -------------------------------------------------------------------------------------------

    def told(self, topic: str, who: str = "control") -> list[tuple[Any, ...]]:
        """The values of each ``Tell``."""
        found = [one for _, by, one in self.said if by == who and isinstance(one, Tell)]
        return [one.values for one in found if one.topic == topic]

    @property
    def outcomes(self) -> list[tuple[int, str]]:
        """The step and the outcome of each fix."""
        return [(values[2], values[-1]) for values in self.told("aimed")]

    @property
    def news(self) -> list[str]:
        """What camera control knew of the camera, one after the other."""
        return [str(values[0]) for values in self.told("camera")]

    @property
    def notes(self) -> list[str]:
        """What camera control noted."""
        return [one.text for _, who, one in self.said if who == "control" and isinstance(one, Note)]

    @property
    def states_said(self) -> list[str]:
        """The states of camera control."""
        return [one.name for _, who, one in self.said if who == "control" and isinstance(one, State)]

    @property
    def acks(self) -> list[tuple[int, int]]:
        """The numbers and lives of items that were acknowledged."""
        return [(one.number, one.life) for _, one, _ in self.sent if isinstance(one, ItemAck)]

    def written(self, who: str = "control") -> list[str]:
        """The packets that were sent, in hexadecimal."""
        return [packet.hex() for _, by, packet in self.packets if by == who]

    def look(self, at_ns: int) -> Direction:
        """Where the camera looked at an instant."""
        motions = [
            (when, one.values)
            for when, who, one in self.said
            if who == "camera" and isinstance(one, Tell) and one.topic == "motion" and when <= at_ns
        ]
        began_ns, (pan0, tilt0, pan1, tilt1, pan_s, tilt_s) = motions[-1]
        motion = Motion(Direction(pan0, tilt0), Direction(pan1, tilt1), pan_s, tilt_s)
        return motion.at((at_ns - began_ns) / NS)

    # --- how -------------------------------------------------------------------------------------------------------

    def _push(self, at_ns: int, who: str, event: Event) -> int:
        self._number += 1
        heappush(self._heap, (at_ns, self._number, who, event, self._lives[who]))
        return self._number

    def _handle(self, who: str, event: Event) -> tuple[Effect, ...]:
        self.states[who], effects = self.roles[who].handle(self.states[who], event)
        for effect in effects:
            match effect:
                case Send(Visca(packet), medium="serial"):
                    self._line(who, packet)
                case Send(message, to):
                    self.sent.append((self.now, decoded(encode(message)), str(to)))
                case SetTimer(name, at_ns):
                    self._timers[who, name] = self._push(max(at_ns, self.now), who, Timer(max(at_ns, self.now), name))
                case CancelTimer(name):
                    self._timers.pop((who, name), None)
                case Store(data) if who == "control":
                    self.stored = data
                case _:
                    self.said.append((self.now, who, effect))
        return tuple(effects)

    def _line(self, who: str, packet: bytes) -> None:
        """One packet after the other, ten bits for a byte."""
        self.packets.append((self.now, who, packet))
        self._counts[who, packet] += 1
        self._free[who] = max(self._free[who], self.now) + len(packet) * 10 * NS // BAUD
        if not self.plugged or self.lose(who, packet, self._counts[who, packet]):
            return
        other = "camera" if who == "control" else "control"
        sender = "control" if who == "control" else "camera"
        at_ns = self._free[who]
        self._push(at_ns, other, Received(at_ns, Visca(packet), sender, "serial"))


def ignored(effects: tuple[Effect, ...]) -> Iterator[str]:
    """Why frames were ignored."""
    return (one.reason for one in effects if isinstance(one, Ignored))
