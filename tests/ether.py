"""Roles that hear each other without I/O: a test may lose, repeat or delay their frames, kill and freeze them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import hypot
from typing import Any, Final, Self

from tests.puppet import MS
from trackfield.drivers.engine.receiver import Receiver, Windows
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    Listen,
    Note,
    Publish,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    Store,
    Timer,
    TrackPoint,
)
from trackfield.sensing.readings import Said
from trackfield.wire.codec import decode, encode, kind_name
from trackfield.wire.messages import Range

FRAME, TIMER = 0, 1
DELAY_NS: Final = 20 * MS
ORIGIN_NS: Final = 20 * NS
"""Step 0; steps last a second."""
Place = tuple[float, float]
Target = Callable[[float], Place | None]
"""Where the target is, so many seconds after step 0; None: nowhere."""


@dataclass(frozen=True)
class Heard:
    """A message on its way: sent at ``t_ns`` (true time), to one process or all; and as it was received."""

    t_ns: int
    src: str
    dst: str
    kind: str
    message: Any


@dataclass
class Rule:
    """What befalls frames of a ``kind`` between two processes (None: any), at most ``count`` of them, after ``skip``.

    ``delays`` are when they arrive, later than usual: none if they are lost, two if they come twice.
    """

    kind: str | None
    sender: str | None
    receiver: str | None
    delays: tuple[int, ...]
    count: float
    skip: int
    from_ns: int
    hits: int = 0

    def befalls(self, t_ns: int, kind: str, src: str, dst: str) -> bool:
        pairs = ((self.kind, kind), (self.sender, src), (self.receiver, dst))
        if t_ns < self.from_ns or any(given not in (None, is_) for given, is_ in pairs):
            return False
        if self.skip:
            self.skip -= 1
            return False
        if self.hits >= self.count:
            return False
        self.hits += 1
        return True


@dataclass
class Actor:
    """A process: its role and state, timers (local time), receiver, clock (local = true + ``ahead_ns``), and fate."""

    role: Any
    place: Place
    state: Any = None
    timers: dict[str, tuple[int, int]] = field(default_factory=dict)
    receiver: Receiver = field(default_factory=Receiver)
    ahead_ns: int = 0
    alive: bool = True
    thaws_ns: int = 0
    stored: bytes = b""


class Net:
    """Roles that hear each other ``DELAY_NS`` after they send. ``t_ns`` is the time; everything that happens is kept.

    ``target`` is what sensors range, up to ``range_m``. ``reaches`` says whose frames come to whom.
    """

    def __init__(self, target: Target = lambda _: None, range_m: float = 1e4) -> None:
        self.target, self.range_m, self.t_ns = target, range_m, 0
        self.actors: dict[str, Actor] = {}
        self.rules: list[Rule] = []
        self.reaches: Callable[[str, str], bool] = lambda src, dst: True
        self.sent, self.heard = list[Heard](), list[Heard]()
        self.ignored, self.notes = list[tuple[int, str, str]](), list[tuple[int, str, str]]()
        self.points = list[tuple[int, str, TrackPoint]]()
        self._due: list[tuple[int, int, int, tuple[Any, ...]]] = []
        self._order = 0

    # --- what a test does ----------------------------------------------------------------------------------------

    def add(self, id: str, role: Any, place: Place, ahead_ns: int = 0) -> None:
        self.actors[id] = Actor(role, place, ahead_ns=ahead_ns)

    def start(self, id: str) -> None:
        """Its life begins now, with what the one before it stored."""
        actor = self.actors[id]
        actor.state, actor.timers, actor.receiver, actor.alive = actor.role.begin(), {}, Receiver(), True
        self._give(id, Started(self.local(id), actor.stored))

    def kill(self, *ids: str) -> None:
        for id in ids:
            self.actors[id].alive = False

    def freeze(self, id: str, until_ns: int) -> None:
        self.actors[id].thaws_ns = until_ns

    def jump(self, id: str, by_ns: int) -> None:
        """Its clock jumps; its timers stay where they are by that clock."""
        actor = self.actors[id]
        actor.ahead_ns += by_ns
        for name, (at, _) in list(actor.timers.items()):
            self._set(id, SetTimer(name, at))

    def rule(
        self,
        kind: str | None = None,
        sender: str | None = None,
        receiver: str | None = None,
        *,
        delays: tuple[int, ...] = (),
        count: float = float("inf"),
        skip: int = 0,
    ) -> Rule:
        """From now on; without ``delays`` such frames are lost."""
        made = Rule(kind, sender, receiver, delays, count, skip, self.t_ns)
        self.rules.append(made)
        return made

    def inject(self, dst: str, message: Any, sender: str) -> None:
        """It receives this now, whoever sent it."""
        self._give(dst, Received(self.local(dst), decode(encode(message)), sender))

    def run(self, until_ns: int) -> Self:
        while self._due and self._due[0][0] <= until_ns:
            self.t_ns, _, _, (what, *rest) = heappop(self._due)
            (self._arrive if what == "frame" else self._ring)(*rest)
        self.t_ns = until_ns
        return self

    def to_step(self, step: int, into_ns: int = 999 * MS) -> Self:
        """Up to so long after the instant of a step, by default almost all of it."""
        return self.run(ORIGIN_NS + step * NS + into_ns)

    # --- what a test asks ----------------------------------------------------------------------------------------

    @property
    def step(self) -> int:
        return (self.t_ns - ORIGIN_NS) // NS

    def local(self, id: str) -> int:
        return self.t_ns + self.actors[id].ahead_ns

    def state(self, id: str) -> Any:
        return self.actors[id].state

    def frames(self, kind: str, src: str | None = None, dst: str | None = None, since: int = 0) -> list[Heard]:
        """What was sent, from the instant of a step on."""
        from_ns = ORIGIN_NS + since * NS if since else 0
        found = (one for one in self.sent if one.kind == kind and one.t_ns >= from_ns)
        return [one for one in found if src in (None, one.src) and dst in (None, one.dst)]

    def leaders(self) -> list[str]:
        """Those that live and lead, frozen ones too."""
        return [id for id, one in self.actors.items() if one.alive and getattr(one.state, "leads", None)]

    def leader(self) -> str:
        (found,) = self.leaders()
        return found

    def members(self, id: str) -> tuple[str, ...]:
        return tuple(sorted(self.state(id).members.list))

    def owner(self, id: str) -> str:
        return str(self.state(id).search.master)

    def track(self, step: int, by: str | None = None) -> TrackPoint | None:
        """The point of a step that counts: of the highest term, and of one term the last; or that of a process."""
        told = ((i, p) for i, (_, id, p) in enumerate(self.points) if by == id or (by is None and not p.origin))
        mine = [(p.term, i) for i, p in told if p.step == step]
        return self.points[max(mine)[1]][2] if mine else None

    def error_m(self, step: int) -> float:
        """How far the track is off at a step; infinite if there is none."""
        point, place = self.track(step), self.target(float(step))
        if point is None or not point.mean or place is None:
            return float("inf")
        return hypot(point.mean[0] - place[0], point.mean[1] - place[1])

    def reasons(self, id: str) -> list[str]:
        return [why for _, who, why in self.ignored if who == id]

    # --- how it goes ---------------------------------------------------------------------------------------------

    def _push(self, t_ns: int, rank: int, *what: Any) -> None:
        self._order += 1
        heappush(self._due, (t_ns, rank, self._order, what))

    def _set(self, id: str, timer: SetTimer) -> None:
        actor = self.actors[id]
        self._push(max(timer.at - actor.ahead_ns, self.t_ns), TIMER, "timer", id, timer.name, self._order)
        actor.timers[timer.name] = (timer.at, self._order - 1)

    def _ring(self, id: str, name: str, number: int) -> None:
        actor = self.actors[id]
        if not actor.alive or actor.timers.get(name, (0, -1))[1] != number:
            return
        if self.t_ns < actor.thaws_ns:
            return self._push(actor.thaws_ns, TIMER, "timer", id, name, number)
        at, _ = actor.timers.pop(name)
        self._give(id, Timer(max(at, self.local(id)), name))

    def _arrive(self, sent: Heard, dst: str, preamble_ns: int) -> None:
        actor = self.actors[dst]
        hears = actor.alive and self.t_ns >= actor.thaws_ns and kind_name(sent.message) in actor.role.kinds
        if hears and actor.receiver.hears_from(self.t_ns, 0, preamble_ns) is not None:
            self.heard.append(Heard(self.t_ns, sent.src, dst, sent.kind, sent.message))
            self._give(dst, Received(self.local(dst), sent.message, sent.src))

    def _give(self, id: str, event: Event) -> None:
        actor = self.actors[id]
        actor.state, effects = actor.role.handle(actor.state, event)
        for effect in effects:
            self._do(id, actor, effect)

    def _do(self, id: str, actor: Actor, effect: Effect) -> None:
        match effect:
            case Send():
                self._send(id, effect)
            case SetTimer():
                self._set(id, effect)
            case CancelTimer(name):
                actor.timers.pop(name, None)
            case Sample(sensor):
                value = self.reading(id) if sensor == "sound" else self._wakes(id)
                self._give(id, Sampled(self.local(id), sensor, value))
            case Radio(on):
                actor.receiver = actor.receiver.changed(on, self.t_ns)
            case Listen(every, opened, from_ns, detect, spare):
                windows = Windows(every, opened, from_ns - actor.ahead_ns, detect, spare)
                actor.receiver = actor.receiver.changed(windows, self.t_ns)
            case Publish(point):
                self.points.append((self.t_ns, id, point))
            case Ignored(reason):
                self.ignored.append((self.t_ns, id, reason))
            case Note(text):
                self.notes.append((self.t_ns, id, text))
            case Store(data):
                actor.stored = data

    def _send(self, id: str, send: Send) -> None:
        message = decode(encode(send.message))
        kind = kind_name(message)
        for to in [send.to] if isinstance(send.to, str) else sorted(send.to):
            frame = Heard(self.t_ns, id, to, kind, message)
            self.sent.append(frame)
            for dst in [one for one in self.actors if one != id] if to == NEIGHBOURHOOD else [to]:
                for delay_ns in self._delays(kind, id, dst):
                    self._push(self.t_ns + DELAY_NS + delay_ns, FRAME, "frame", frame, dst, send.preamble_ns)

    def _delays(self, kind: str, src: str, dst: str) -> tuple[int, ...]:
        if dst not in self.actors or not self.reaches(src, dst):
            return ()
        for rule in self.rules:
            if rule.befalls(self.t_ns, kind, src, dst):
                return rule.delays
        return (0,)

    def reading(self, id: str, t_ns: int | None = None) -> Said | None:
        """The exact distance to the target."""
        at, (x, y) = self.target(((self.t_ns if t_ns is None else t_ns) - ORIGIN_NS) / NS), self.actors[id].place
        away = None if at is None else hypot(at[0] - x, at[1] - y)
        return None if away is None or away > self.range_m else Said(Range, (away,))

    def _wakes(self, id: str) -> int | None:
        """When it next senses the target, by its own clock, within 600 steps, to half a second."""
        half = NS // 2
        later = range(-(-self.t_ns // half) * half, self.t_ns + 600 * NS, half)
        found = next((t for t in (self.t_ns, *later) if self.reading(id, t)), None)
        return None if found is None else found + self.actors[id].ahead_ns
