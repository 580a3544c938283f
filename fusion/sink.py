"""The sink: the base of a field that hears targets pass. It wants fixes, and predicts the last one to each step.

It spreads an interest in the fixes of the whole field, and whoever leads a cluster there answers (``head/hearing``). Of
several fixes the latest holds. Its clock is the reference of all others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import dist
from typing import Any, Final, NamedTuple

import msgpack

from fusion.fixes import Ended, Fix, ended_of, read
from fusion.splines import Kept, Splines
from trackfield.protocols.association.admitting import Admitting, Members
from trackfield.protocols.interest.interests import Wanted
from trackfield.protocols.interest.piece import TIMERS as DIFFUSION
from trackfield.protocols.interest.piece import Diffusion
from trackfield.protocols.interest.state import Spread
from trackfield.protocols.timesync import Timekeeping, TimeSync
from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Publish,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    TrackPoint,
    Transitions,
    check_transition,
)
from trackfield.tracking.bank import Bank
from trackfield.wire.codec import encode
from trackfield.wire.interests import Arrived, Interest
from trackfield.wire.messages import SyncRequest
from trackfield.wire.passes import FIXES, FixReport

ASK: Final = "ask"
NUMBERS: Final = 1 << 16
MOST: Final = 32
"""So many ends of events are published with a step at most, and so many of the last ones are known."""


class Phase(Enum):
    """The phase of the sink: whether it was told of a fix."""

    NEW = "new"
    WAITING = "waiting"
    TRACKING = "tracking"


_LIVING: Final = frozenset({Phase.WAITING, Phase.TRACKING})

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, Timer): frozenset({phase}) for phase in _LIVING},
    **{(phase, Received): frozenset({phase, Phase.TRACKING}) for phase in _LIVING},
}


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The state of the sink: its last ``fix``, and the last step ``done``.

    ``ended`` are the events that it was told of since then, for each tracker that solves. ``known`` are the last ones
    of all: head, step, and the head's number. ``kept`` are the events of the tracks that are not published whole yet.
    ``wishes`` are the numbers of the interests that the gateway asked for, by its numbers.
    """

    phase: Phase = Phase.NEW
    time: Timekeeping = field(default_factory=Timekeeping)
    spread: Spread = field(default_factory=Spread)
    members: Members = field(default_factory=Members)
    fix: Fix | None = None
    ended: tuple[tuple[str, Ended], ...] = ()
    known: tuple[tuple[str, int, int], ...] = ()
    kept: Kept = ()
    wishes: Mapping[int, int] = field(default_factory=dict)
    done: int = 0


Step = tuple[Memory, tuple[Effect, ...]]


class Interested(NamedTuple):
    """How long its interest lasts if it is not renewed (s), and over how many hops it spreads."""

    interest_s: float
    most_hops: int


class Sink:
    """Publishes each step ``deadline_ns`` after its instant; the rest are the arguments of a ``Bank``.

    It stands at ``x_m``, ``y_m``, and announces that, by the other arguments of an ``Admitting`` for no slave
    (``association``). ``diffusion`` are the arguments of its ``Diffusion`` besides the id and the place, ``interest``
    the fields of ``Interested``; it asks from the start of the field on.

    With ``spline`` it also publishes whole tracks through the reports of several events (``splines``): when the track
    has ended, or with the step ``last_step``, the last of the run (0: it does not know it). No message is sent for
    that. A next life knows of the events that it was told of itself only.

    With ``gateway`` another role of its process is given all that comes for it, and may want more (``gateway/``).
    """

    def __init__(
        self,
        *,
        id: str,
        x_m: float,
        y_m: float,
        deadline_ns: int,
        association: Mapping[str, Any],
        diffusion: Mapping[str, Any],
        interest: Mapping[str, Any],
        spline: bool = False,
        last_step: int = 0,
        gateway: bool = False,
        **bank: Any,
    ) -> None:
        self.id, self.place, self.deadline_ns = id, (x_m, y_m), deadline_ns
        self.bank, self.sync, self.interest = Bank(**bank), TimeSync(), Interested(**interest)
        self.announcing = Admitting(id=id, x_m=x_m, y_m=y_m, sensors=(), seed=self.bank.seed, **association)
        self.splines, self.last_step = Splines(self.bank) if spline else None, last_step
        self.gateway = gateway
        self.diffusion = Diffusion(id=id, x_m=x_m, y_m=y_m, **diffusion)
        self.kinds = self.diffusion.kinds | self.sync.kinds

    def begin(self) -> Memory:
        """A sink that has not started."""
        return Memory(spread=self.diffusion.begin())

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        after = replace(after, phase=Phase.TRACKING if after.fix else Phase.WAITING)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Received(message=SyncRequest()):
                time, effects = self.sync.handle(memory.time, event)
                return replace(memory, time=time), effects
            case Received(now, Interest() as wish, self.id) if self.gateway:
                return self._wish(memory, now, wish)
            case Received(medium=medium) if medium != "field":
                return memory, (Ignored("unexpected"),)
            case Received():
                return self._diffuse(memory, event)
            case Timer():
                return self._ring(memory, event)
        raise IllegalEvent(f"a sink cannot handle {event}")

    def _ring(self, memory: Memory, event: Timer) -> Step:
        match event:
            case Timer(_, "announce"):
                members, effects = self.announcing.handle(memory.members, event)
                return replace(memory, members=members), effects
            case Timer(now, "ask"):
                return self._ask(memory, now)
            case Timer(_, "step"):
                return self._publish(replace(memory, done=memory.done + 1))
            case Timer(name=name) if name in DIFFUSION:
                return self._diffuse(memory, event)
        raise IllegalEvent(f"a sink has no timer {event.name!r}")

    def _start(self, memory: Memory, start: Started) -> Step:
        time, effects = self.sync.handle(memory.time, start)
        members, announces = self.announcing.handle(memory.members, start)
        announces = tuple(one for one in announces if getattr(one, "name", "") != "roster")
        spread, timers, _ = self.diffusion.handle(memory.spread, start)
        last = max(self.bank.step_at(time.corrected(start.now) - self.deadline_ns), 0)
        memory = replace(memory, time=time, members=members, spread=spread, done=last)
        memory, notes = self._restored(memory, start.stored)
        asks = SetTimer(ASK, max(start.now, self.bank.origin_ns))
        return memory, (*effects, *announces, *timers, *notes, asks, self._next(memory))

    def _next(self, memory: Memory) -> SetTimer:
        """The timer of the coming step."""
        return SetTimer("step", self.bank.at_ns(memory.done + 1) + self.deadline_ns)

    # --- diffusion -----------------------------------------------------------------------------------------------

    def _ask(self, memory: Memory, now: int) -> Step:
        """Want the fixes of the whole field; the interest of each life has a number of its own."""
        number = self._number(memory, now)
        radius_m = max((dist(self.place, place) for place in self.bank.positions.values()), default=0.0) + 1.0
        wanted = Wanted(number, FIXES, *self.place, radius_m, 0.0, *self.interest)
        spread, effects, _ = self.diffusion.ask(memory.spread, now, wanted)
        return replace(memory, spread=spread), effects

    def _number(self, memory: Memory, now: int) -> int:
        """That of a new interest: the step, or the next that no other has."""
        number = max(self.bank.step_at(now), 0) % NUMBERS
        while number in memory.spread.timed.own:
            number = (number + 1) % NUMBERS
        return number

    def _wish(self, memory: Memory, now: int, wish: Interest) -> Step:
        """The gateway of the process wants data, or no more of it (0 s).

        All fixes of the field come anyway; for another class there is an interest of its own, until it is withdrawn.
        """
        wishes, effects = dict(memory.wishes), tuple[Effect, ...]()
        if (before := wishes.pop(wish.number, None)) is not None:
            spread, effects, _ = self.diffusion.withdraw(memory.spread, before)
            memory = replace(memory, spread=spread)
        if wish.lasts_s and wish.task != FIXES:
            number = wishes[wish.number] = self._number(memory, now)
            wanted = Wanted(number, wish.task, wish.x_m, wish.y_m, wish.radius_m, wish.interval_s, *self.interest)
            spread, more, _ = self.diffusion.ask(memory.spread, now, wanted)
            memory, effects = replace(memory, spread=spread), (*effects, *more)
        return replace(memory, wishes=wishes), effects

    def _diffuse(self, memory: Memory, event: Received | Timer) -> Step:
        spread, effects, arrived = self.diffusion.handle(memory.spread, event)
        memory = replace(memory, spread=spread)
        for one in arrived:
            memory, more = self._learn(memory, event.now, one.message, one.sender)
            effects = (*effects, *more)
        return memory, effects

    # --- what it is told -----------------------------------------------------------------------------------------

    def _learn(self, memory: Memory, now: int, message: Any, head: str) -> Step:
        """A head tells of an event; a fix holds unless there is a later one."""
        if not isinstance(message, FixReport) or head not in self.bank.positions:
            return memory, (Ignored("unexpected"), *self._handed(message, head))
        if message.step > self.bank.step_at(now) + 1:
            return memory, (Ignored("from the future"),)
        try:
            fix = read(message, head, self.bank)
        except ValueError:
            return memory, (Ignored("unusable fix"),)
        key, before = (head, fix.step, fix.number), memory.fix
        if key in memory.known:
            return memory, (Ignored("repeated"),)
        ended = (*memory.ended, *ended_of(fix, self.bank).items())
        kept = self.splines.learn(memory.kept, fix) if self.splines else ()
        after = replace(memory, ended=ended[-MOST:], known=(*memory.known, key)[-MOST:], kept=kept)
        if not fix.beliefs or (before is not None and fix.step < before.step):
            return after, self._handed(message, head)
        told = (message.number, message.step, head, message.belief, message.raw)
        stored: bytes = msgpack.packb((*told, after.known))
        return replace(after, fix=fix), (Store(stored), *self._handed(message, head))

    def _handed(self, message: Any, head: str) -> tuple[Effect, ...]:
        """What the gateway of its process is given, which decides whether that leaves the field."""
        return (Send(Arrived(head.encode(), encode(message)), self.id),) if self.gateway else ()

    def _restored(self, memory: Memory, stored: bytes) -> Step:
        if not stored:
            return memory, ()
        try:
            number, step, head, belief, raw, known = msgpack.unpackb(stored)
            fix = read(FixReport(number, step, 0, belief, raw), head, self.bank)
            keys = tuple((str(by), int(at), int(one)) for by, at, one in known)
        except (ValueError, TypeError, msgpack.UnpackException) as error:
            return memory, (Note(f"What an earlier life stored cannot be used: {error}"),)
        return replace(memory, fix=fix, known=keys[-MOST:]), ()

    # --- what it says --------------------------------------------------------------------------------------------

    def _publish(self, memory: Memory) -> Step:
        """The last fix, predicted to this step, and how events ended of which it was told since the one before."""
        points = self._live(memory.fix, memory.done) if memory.fix else []
        live = {point.tracker: point for point in points}
        said = [
            replace(live.get(name, self._none(name, memory.done)), event_ns=at_ns, refused=refused)
            for name, (at_ns, refused) in memory.ended
        ]
        quiet = [point for name, point in live.items() if name not in {one.tracker for one in said}]
        after, whole = self._whole(replace(memory, ended=()), points)
        return after, (*map(Publish, (*quiet, *said, *whole)), self._next(after))

    def _whole(self, memory: Memory, live: Sequence[TrackPoint]) -> tuple[Memory, list[TrackPoint]]:
        """The whole tracks that end with this step, of which the ``live`` points are given."""
        if self.splines is None or not (memory.done == self.last_step or self.splines.ended(memory.kept, live)):
            return memory, []
        return replace(memory, kept=()), self.splines.points(memory.kept, memory.done)

    def _live(self, fix: Fix, step: int) -> list[TrackPoint]:
        """What it was told last, predicted to this step."""
        if fix.step > step:
            return []
        points = self.bank.resume(fix.beliefs, fix.step, step).points if fix.step < step else fix.points(self.bank)
        return [replace(one, term=fix.step, origin=fix.head, known_step=fix.step) for one in points]

    def _none(self, tracker: str, step: int) -> TrackPoint:
        return TrackPoint(tracker, self.bank.target, self.bank.at_ns(step), "waiting", step=step)
