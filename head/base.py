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
import numpy as np

from trackfield.filters.belief import Belief, dimension, moments
from trackfield.filters.types import Estimate, Reports
from trackfield.protocols.association.admitting import Admitting, Members
from trackfield.protocols.timesync import Timekeeping, TimeSync
from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
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
from trackfield.tracking.points import track_point
from trackfield.tracking.stored import unpack
from trackfield.wire.clusters import LedTrack
from trackfield.wire.listed import unpacked
from trackfield.wire.messages import SyncRequest


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
class Told:
    """What the base was told last: the term's ``number``, of which ``step``, by whom, from whose reports."""

    number: int
    step: int
    leader: str
    sensors: tuple[str, ...]
    beliefs: Mapping[str, Belief | None]


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The state of the base; ``done`` is the last step that it published."""

    phase: Phase = Phase.NEW
    time: Timekeeping = field(default_factory=Timekeeping)
    told: Told | None = None
    done: int = 0
    members: Members = field(default_factory=Members)


Step = tuple[Memory, tuple[Effect, ...]]


class Base:
    """Publishes each step ``deadline_ns`` after its instant; the rest are the arguments of a ``Bank``.

    It stands at ``x_m``, ``y_m`` and announces itself as masters do, for those that ask it for the time;
    ``association`` are the other arguments of an ``Admitting`` for no slave.
    """

    def __init__(
        self, *, id: str, x_m: float, y_m: float, association: Mapping[str, Any], deadline_ns: int, **bank: Any
    ) -> None:
        self.bank, self.deadline_ns, self.sync = Bank(**bank), deadline_ns, TimeSync()
        self.sensors: Sequence[str] = tuple(self.bank.positions)
        self.announcing = Admitting(id=id, x_m=x_m, y_m=y_m, sensors=(), seed=self.bank.seed, **association)
        self.kinds = frozenset({"led-track"}) | self.sync.kinds

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
            case Started(now, stored):
                time, effects = self.sync.handle(memory.time, event)
                last = max(self.bank.step_at(time.corrected(now) - self.deadline_ns), 0)
                memory, notes = self._restored(replace(memory, time=time, done=last), stored)
                members, announces = self.announcing.handle(memory.members, event)
                announces = tuple(one for one in announces if getattr(one, "name", "") != "roster")
                return replace(memory, members=members), (*effects, *notes, *announces, *self._next(memory))
            case Timer(_, "announce"):
                members, effects = self.announcing.handle(memory.members, event)
                return replace(memory, members=members), effects
            case Received(now, LedTrack() as message, sender):
                return self._learn(memory, now, message, sender)
            case Received(message=SyncRequest()):
                time, effects = self.sync.handle(memory.time, event)
                return replace(memory, time=time), effects
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer(_, "step"):
                return self._publish(replace(memory, done=memory.done + 1))
        raise IllegalEvent(f"a base cannot handle {event}")

    def _next(self, memory: Memory) -> tuple[SetTimer, ...]:
        """The timer of the coming step."""
        return (SetTimer("step", memory.time.local(self.bank.at_ns(memory.done + 1) + self.deadline_ns)),)

    # --- what it is told -----------------------------------------------------------------------------------------

    def _learn(self, memory: Memory, now: int, message: LedTrack, leader: str) -> Step:
        """Of two reports the one of the higher term counts, and of one term the later."""
        before = memory.told
        if before is not None and (message.number, message.step) <= (before.number, before.step):
            return memory, (Ignored("outdated"),)
        if message.step > self.bank.step_at(memory.time.corrected(now)) + 1:
            return memory, (Ignored("from the future"),)
        try:
            told = self._told(message.number, message.step, leader, message.sensors, message.beliefs)
        except ValueError:
            return memory, (Ignored("unusable belief"),)
        kept: bytes = msgpack.packb((message.number, message.step, leader, message.sensors, message.beliefs))
        return replace(memory, told=told), (Store(kept),)

    def _told(self, number: int, step: int, leader: str, sensors: bytes, beliefs: bytes) -> Told:
        ids = unpacked(sensors, self.sensors)
        if ids is None:
            raise ValueError("sensors that are not of the field")
        return Told(number, step, leader, ids, unpack(beliefs).beliefs)

    def _restored(self, memory: Memory, stored: bytes) -> Step:
        if not stored:
            return memory, ()
        try:
            return replace(memory, told=self._told(*msgpack.unpackb(stored))), ()
        except (ValueError, TypeError, msgpack.UnpackException) as error:
            return memory, (Note(f"What an earlier life stored cannot be used: {error}"),)

    # --- what it says --------------------------------------------------------------------------------------------

    def _publish(self, memory: Memory) -> Step:
        told, step = memory.told, memory.done
        if told is None or told.step > step:
            return memory, self._next(memory)
        points = self._fresh(told) if told.step == step else self.bank.resume(told.beliefs, told.step, step).points
        named = (replace(one, term=told.number, origin=told.leader, known_step=told.step) for one in points)
        return memory, (*map(Publish, named), *self._next(memory))

    def _fresh(self, told: Told) -> list[TrackPoint]:
        """The points of the very step that it was told of."""
        n, at_ns = self.bank.model.dimension, self.bank.at_ns(told.step)
        reports = Reports(told.step, told.sensors, np.zeros((len(told.sensors), 2)), ())
        known = {name: told.beliefs.get(name) for name in self.bank.trackers}
        return [
            track_point(name, self.bank.target, at_ns, reports, Estimate(*moments(belief)))
            for name, belief in known.items()
            if belief is not None and dimension(belief) == n
        ]
