"""Processes that do nothing but directed diffusion: in a ``Net`` (``tests/ether.py``), and one by itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from math import dist
from typing import Any, Final

from tests.ether import Net
from tests.puppet import MS
from trackfield.protocols.interest.interests import Known, Wanted
from trackfield.protocols.interest.piece import Diffusion
from trackfield.protocols.interest.state import Spread, Step
from trackfield.role import NS, CancelTimer, Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire import Doa, encode
from trackfield.wire.interests import Interest

Place = tuple[float, float]
TASK: Final = 1
PATIENCE_NS: Final = 50 * MS
"""More than two frames of ``Net`` take."""
REACH_M: Final = 40.0
CHAIN: Final = {"base": (0.0, 0.0), "a": (30.0, 0.0), "b": (60.0, 0.0), "c": (90.0, 0.0)}
DIAMOND: Final = {"base": (0.0, 0.0), "a": (30.0, 15.0), "b": (30.0, -15.0), "c": (60.0, 0.0)}
DETOUR: Final = {
    "base": (0.0, 0.0),
    "r": (35.0, 0.0),
    "c": (70.0, 0.0),
    "w": (70.0, 35.0),
    "x": (35.0, 50.0),
    "y": (5.0, 36.0),
}
"""``c`` sends over ``r``; round that there is only a way away from the base at first: ``w``, ``x``, ``y``."""
FLOW: Final = (("base", 1), "c")
WANTED: Final = Wanted(1, TASK, 0.0, 0.0, 100.0, 0.0, 9.0, 8)
REPORT: Final = encode(Doa(1, 90.0, 60.0))


class Talker:
    """A role that is nothing but the piece, and keeps what ``arrived``."""

    def __init__(self, id: str, place: Place, **arguments: Any) -> None:
        given = {"seed": 1, "sources": (TASK,), "patience_ns": PATIENCE_NS, **arguments}
        self.piece = Diffusion(id=id, x_m=place[0], y_m=place[1], **given)
        self.kinds, self.arrived = self.piece.kinds, list[Received]()

    def begin(self) -> Spread:
        return self.piece.begin()

    def handle(self, state: Spread, event: Event) -> tuple[Spread, tuple[Effect, ...]]:
        return self.took(self.piece.handle(state, event))

    def took(self, step: Step) -> tuple[Spread, tuple[Effect, ...]]:
        self.arrived += step.arrived
        return step.state, step.effects


class Field(Net):
    """Processes at ``places`` that hear each other up to ``reach_m``; all have started."""

    def __init__(self, places: Mapping[str, Place], reach_m: float, **arguments: Any) -> None:
        super().__init__()
        for id, place in places.items():
            self.add(id, Talker(id, place, **arguments), place)
        self.reaches = lambda src, dst: dist(places[src], places[dst]) <= reach_m
        for id in places:
            self.start(id)

    def ask(self, sink: str, number: int = 1, **changes: Any) -> None:
        """Everybody is to say what it hears, for 9 s, spread anew every 3 s."""
        wanted = Wanted(number, TASK, 0.0, 0.0, 1000.0, 0.0, 9.0, 16)._replace(**changes)
        self._take(sink, self.actors[sink].role.piece.ask(self.state(sink), self.local(sink), wanted))

    def withdraw(self, sink: str, number: int = 1) -> None:
        self._take(sink, self.actors[sink].role.piece.withdraw(self.state(sink), number))

    def known(self, id: str) -> tuple[Known, ...]:
        piece: Diffusion = self.actors[id].role.piece
        return piece.live(self.state(id), self.local(id), TASK)

    def tell(self, id: str, step: int) -> int:
        """It sends the report of a step to all that want it; returns to how many."""
        for known in self.known(id):
            piece: Diffusion = self.actors[id].role.piece
            self._take(id, piece.tell(self.state(id), self.local(id), Doa(step, 90.0, 60.0), known))
        return len(self.known(id))

    def got(self, id: str, origin: str = "") -> list[int]:
        """The steps whose reports arrived."""
        return [one.message.step for one in self.actors[id].role.arrived if origin in ("", one.sender)]

    def wait(self, seconds: float) -> Field:
        self.run(self.t_ns + int(seconds * NS))
        return self

    def _take(self, id: str, step: Step) -> None:
        actor = self.actors[id]
        actor.state, effects = actor.role.took(step)
        for effect in effects:
            self._do(id, actor, effect)


def asked(places: dict[str, Place] = CHAIN, **arguments: Any) -> Field:
    """A second after the base asked everybody for what it hears."""
    field = Field(places, REACH_M, **arguments)
    field.ask("base")
    return field.wait(1)


def hops(field: Field) -> list[tuple[str, str]]:
    """The hops that reports made, without those that were spread."""
    return [(one.src, one.dst) for one in field.frames("data") if one.message.message and not one.message.spread]


def way(field: Field, start: str = "c") -> list[str]:
    """By whom data of ``c`` is to go from there, as far as its path is reinforced."""
    found = [start]
    while (next := field.state(found[-1]).paths.onward.get(FLOW, "")) and found[-1] != "base":
        found.append(next)
    return found


@dataclass
class Station:
    """A process under test: its state, its time and timers, what it sent and why it ignored frames."""

    queue: int = 4
    now: int = 0
    state: Spread = dataclasses.field(default_factory=Spread)
    timers: dict[str, int] = dataclasses.field(default_factory=dict)
    sent: list[Send] = dataclasses.field(default_factory=list)
    arrived: list[Received] = dataclasses.field(default_factory=list)
    ignored: list[str] = dataclasses.field(default_factory=list)

    def __post_init__(self) -> None:
        self.piece = Diffusion(id="me", x_m=0.0, y_m=0.0, seed=1, sources=(TASK,), queue=self.queue)
        self.does(self.piece.handle(self.piece.begin(), Started(0)))

    def does(self, step: Step) -> list[Any]:
        self.state = step.state
        self.arrived += step.arrived
        for effect in step.effects:
            match effect:
                case SetTimer(name, at):
                    self.timers[name] = at
                case CancelTimer(name):
                    self.timers.pop(name, None)
                case Ignored(reason):
                    self.ignored.append(reason)
        sent = [effect for effect in step.effects if isinstance(effect, Send)]
        self.sent += sent
        for one in sent:
            encode(one.message)
        return [one.message for one in sent]

    def hears(self, message: Any, sender: str) -> list[Any]:
        return self.does(self.piece.handle(self.state, Received(self.now, message, sender)))

    def until(self, now: int) -> None:
        while due := [(at, name) for name, at in self.timers.items() if at <= now]:
            at, name = min(due)
            del self.timers[name]
            self.now = max(at, self.now)
            self.does(self.piece.handle(self.state, Timer(self.now, name)))
        self.now = now

    def asks(self, number: int) -> None:
        self.does(self.piece.ask(self.state, self.now, WANTED._replace(number=number)))

    def tells(self) -> None:
        for known in self.piece.live(self.state, self.now, TASK):
            self.does(self.piece.tell(self.state, self.now, Doa(1, 90.0, 60.0), known))


def interest(sink: bytes = b"base", number: int = 1, refresh: int = 0, **changes: Any) -> Interest:
    given = {"interval_s": 0.0, "lasts_s": 9.0, "hops": 0, "most_hops": 8, **changes}
    return Interest(sink, number, refresh, TASK, 0.0, 0.0, 100.0, **given)
