"""The base: it is told at times what the leader knows, and predicts that to the steps in between.

Its clock is the reference of all others. It sends nothing but the time: which master leads, and who measures, is
decided in the network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Final

import msgpack

from trackfield.filters.belief import dimension, moments
from trackfield.filters.measurement import STATE
from trackfield.filters.types import Estimate
from trackfield.protocols.association.admitting import Admitting, Members
from trackfield.protocols.timesync import Timekeeping, TimeSync
from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Note,
    Publish,
    Received,
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
from trackfield.tracking.intervals import Closed, Intervals, Kept, Told
from trackfield.tracking.points import track_point
from trackfield.tracking.results import beliefs_of
from trackfield.tracking.stored import unpack
from trackfield.wire.clusters import LedTrack
from trackfield.wire.listed import unpacked
from trackfield.wire.messages import SyncRequest
from trackfield.wire.peers import HeadEstimate, Result


class Phase(Enum):
    """The phase of the base: whether it was told of a track."""

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
    """The state of the base; ``done`` is the last step that it published, ``kept`` what it has still to smooth."""

    phase: Phase = Phase.NEW
    time: Timekeeping = field(default_factory=Timekeeping)
    told: Told | None = None
    done: int = 0
    members: Members = field(default_factory=Members)
    kept: Kept = field(default_factory=Kept)


Step = tuple[Memory, tuple[Effect, ...]]


class Base:
    """Publishes each step ``deadline_ns`` after its instant; the rest are the arguments of a ``Bank``.

    With ``association`` (the other arguments of an ``Admitting`` for no slave) it announces that ``id`` stands at
    ``x_m``, ``y_m``, as masters do, for those that ask it for the time.

    With ``rts`` it also publishes each track smoothed as a whole (``Intervals``), once for each step: when the track
    has ended, or with the step ``last_step``, the last of the run (0: it does not know it). No message is sent for
    that. A next life smooths what it was told itself, and what the one before was told last.
    """

    def __init__(
        self,
        *,
        deadline_ns: int,
        id: str = "",
        x_m: float = 0.0,
        y_m: float = 0.0,
        association: Mapping[str, Any] | None = None,
        rts: bool = False,
        last_step: int = 0,
        **bank: Any,
    ) -> None:
        self.bank, self.deadline_ns, self.sync = Bank(**bank), deadline_ns, TimeSync()
        self.sensors: Sequence[str] = tuple(self.bank.positions)
        self.announcing = (
            None
            if association is None
            else Admitting(id=id, x_m=x_m, y_m=y_m, sensors=(), seed=self.bank.seed, **association)
        )
        self.intervals, self.last_step = Intervals(self.bank) if rts else None, last_step
        self.kinds = frozenset({"led-track", "result", "estimate"}) | self.sync.kinds

    def begin(self) -> Memory:
        """A base that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        after = replace(after, phase=Phase.TRACKING if after.told else Phase.WAITING)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Received():
                return self._receive(memory, event)
            case Timer(_, "announce") if self.announcing:
                members, effects = self.announcing.handle(memory.members, event)
                return replace(memory, members=members), effects
            case Timer(_, "step"):
                return self._publish(replace(memory, done=memory.done + 1))
        raise IllegalEvent(f"a base cannot handle {event}")

    def _start(self, memory: Memory, start: Started) -> Step:
        time, effects = self.sync.handle(memory.time, start)
        last = max(self.bank.step_at(time.corrected(start.now) - self.deadline_ns), 0)
        memory, notes = self._restored(replace(memory, time=time, done=last), start.stored)
        memory, announces = self._announce(memory, start)
        return memory, (*effects, *notes, *announces, *self._next(memory))

    def _receive(self, memory: Memory, event: Received) -> Step:
        match event:
            case Received(now, LedTrack() as message, sender):
                return self._learn(memory, now, message, sender, message.sensors)
            case Received(now, Result() | HeadEstimate() as message, sender):
                told = LedTrack(message.number, message.step, b"", beliefs_of(message, self.bank.trackers))
                return self._learn(memory, now, told, sender)
            case Received(message=SyncRequest()):
                time, effects = self.sync.handle(memory.time, event)
                return replace(memory, time=time), effects
        return memory, (Ignored("unexpected"),)

    def _announce(self, memory: Memory, start: Started) -> Step:
        """Begins to announce itself, if it is to; it has no list of members to tell."""
        if self.announcing is None:
            return memory, ()
        members, effects = self.announcing.handle(memory.members, start)
        effects = tuple(one for one in effects if getattr(one, "name", "") != "roster")
        return replace(memory, members=members), effects

    def _next(self, memory: Memory) -> tuple[SetTimer, ...]:
        """The timer of the coming step."""
        return (SetTimer("step", memory.time.local(self.bank.at_ns(memory.done + 1) + self.deadline_ns)),)

    # --- what it is told -----------------------------------------------------------------------------------------

    def _learn(self, memory: Memory, now: int, message: LedTrack, leader: str, sensors: bytes | None = None) -> Step:
        """Of two reports the one of the higher term counts, and of one term the later; the others are smoothed."""
        before = memory.told
        late = before is not None and (message.number, message.step) <= (before.number, before.step)
        if late and self.intervals is None:
            return memory, (Ignored("outdated"),)
        if message.step > self.bank.step_at(memory.time.corrected(now)) + 1:
            return memory, (Ignored("from the future"),)
        try:
            told = self._told(message.number, message.step, leader, sensors, message.beliefs)
        except ValueError:
            return memory, (Ignored("unusable belief"),)
        after = self._keep(memory, told)
        if late:
            return (memory, (Ignored("outdated"),)) if after.kept is memory.kept else (after, (Late(),))
        kept: bytes = msgpack.packb((message.number, message.step, leader, sensors, message.beliefs))
        return replace(after, told=told), (Store(kept),)

    def _keep(self, memory: Memory, told: Told) -> Memory:
        """Remembers what was told of a step, to be smoothed."""
        return memory if self.intervals is None else replace(memory, kept=self.intervals.learn(memory.kept, told))

    def _told(self, number: int, step: int, leader: str, sensors: bytes | None, beliefs: bytes) -> Told:
        """None: it was not told which sensors were used."""
        ids = () if sensors is None else unpacked(sensors, self.sensors)
        if ids is None:
            raise ValueError("sensors that are not of the field")
        return Told(number, step, leader, ids, unpack(beliefs).beliefs, named=sensors is not None)

    def _restored(self, memory: Memory, stored: bytes) -> Step:
        if not stored:
            return memory, ()
        try:
            told = self._told(*msgpack.unpackb(stored))
        except (ValueError, TypeError, msgpack.UnpackException) as error:
            return memory, (Note(f"What an earlier life stored cannot be used: {error}"),)
        return replace(self._keep(memory, told), told=told), ()

    # --- what it says --------------------------------------------------------------------------------------------

    def _publish(self, memory: Memory) -> Step:
        if memory.told is None:
            return memory, self._next(memory)
        live = self._live(memory.told, memory.done)
        kept, smoothed = self._smoothed(memory, live)
        return replace(memory, kept=kept), (*map(Publish, (*live, *smoothed)), *self._next(memory))

    def _live(self, told: Told, step: int) -> list[TrackPoint]:
        """What it was told last, predicted to this step."""
        if told.step > step:
            return []
        points = self._fresh(told) if told.step == step else self.bank.resume(told.beliefs, told.step, step).points
        return [replace(one, term=told.number, origin=told.leader, known_step=told.step) for one in points]

    def _smoothed(self, memory: Memory, live: Sequence[TrackPoint]) -> Closed:
        """The smoothed points of the tracks that end with this step, of which the ``live`` points are given."""
        if self.intervals is None:
            return Closed(memory.kept, [])
        if memory.done == self.last_step:
            return self.intervals.close(memory.kept, memory.done, memory.done)
        if self.intervals.ended(memory.kept, live, memory.done):
            return self.intervals.close(memory.kept, memory.done - 1, memory.done)
        return self.intervals.relieve(memory.kept, memory.done)

    def _fresh(self, told: Told) -> list[TrackPoint]:
        """The points of the very step that it was told of."""
        n, at_ns = self.bank.model.dimension, self.bank.at_ns(told.step)
        known = {name: told.beliefs.get(name) for name in self.bank.trackers}
        points = [
            track_point(name, self.bank.target, at_ns, told.reports, Estimate(*moments(belief)))
            for name, belief in known.items()
            if belief is not None and dimension(belief) in (n, STATE)
        ]
        return points if told.named else [replace(one, status="tracking") for one in points]
