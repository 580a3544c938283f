"""A slave: a sensor node that has a master, sleeps until it is woken, and then measures and reports, step by step.

Özfidan et al. (2018), section II. A slave finds its master by radio (``trackfield/protocols/association``). Its
receiver is off but for short windows, in which its master may wake it by a beacon (``trackfield/protocols/wakeup.py``).
The beacon gives it a slot: from the instant of a step on it waits for so many slots, and reports what it senses, or
that it senses no target. It falls asleep when a beacon leaves it out, or so many steps after the last beacon that it
heard as that one said; then it asks whether its master is still there.

A slave that reports ``unasked`` reports by itself what it senses while it sleeps, as nodes with a detector that wakes
them do. Its clock is set by its master, if it is off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from math import inf
from typing import Any, Final

from trackfield.protocols.association.joining import KINDS, TIMERS, Joining, Search
from trackfield.protocols.timesync import Rounds, Timekeeping, TimeSync
from trackfield.protocols.wakeup import Wakeup
from trackfield.role import (
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Listen,
    Note,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
    Transitions,
    check_transition,
)
from trackfield.sensing.readings import Reading
from trackfield.wire.clusters import CYCLE, NoTarget, Wake
from trackfield.wire.messages import SyncReply

LAST_STEP: Final = 65535


class Phase(Enum):
    """The phase of a slave; ``ORPHAN``: it has no master, and waits until it looks for one again."""

    NEW = "new"
    SEEKING = "seeking"
    ORPHAN = "orphan"
    ASLEEP = "asleep"
    ACTIVE = "active"


_LIVING: Final = frozenset(Phase) - {Phase.NEW}

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, event): _LIVING for phase in _LIVING for event in (Timer, Received)},
    **{(phase, Sampled): frozenset({phase, Phase.ASLEEP}) for phase in _LIVING},
}


@dataclass(frozen=True, slots=True)
class Memory:
    """The state of a slave: its search for a master, its time, and what its last beacon said.

    It measures at the steps from ``first`` to ``last``, in ``slot``. ``done`` is the last step that it measured at.
    ``report`` waits for its slot. ``reference`` is the master that sets its clock.
    """

    phase: Phase = Phase.NEW
    search: Search = field(default_factory=Search)
    time: Timekeeping = field(default_factory=Timekeeping)
    reference: str = ""
    slot: int = 0
    first: int = 0
    last: int = -1
    done: int = 0
    report: Any = None


Step = tuple[Memory, tuple[Effect, ...]]


class Slave:
    """Measures in each step of ``step_ns`` for which it was woken; step k begins at ``origin_ns`` + k ``step_ns``.

    ``joining`` are the arguments of its ``Joining``, ``wakeup`` those of its ``Wakeup``; ``slot_ns`` is from one slot
    to the next. A reading below ``threshold_db`` is no target. ``sync`` holds the fields of its ``Rounds``, whose
    reference is its master; None: its clock is right.
    """

    def __init__(
        self,
        *,
        step_ns: int,
        slot_ns: int,
        joining: Mapping[str, Any],
        wakeup: Mapping[str, Any],
        origin_ns: int = 0,
        threshold_db: float = -inf,
        unasked: bool = False,
        sync: Mapping[str, Any] | None = None,
    ) -> None:
        self.step_ns, self.origin_ns, self.slot_ns = step_ns, origin_ns, slot_ns
        self.threshold_db, self.unasked = threshold_db, unasked
        self.joining, self.wakeup = Joining(**joining), Wakeup(**wakeup)
        self.rounds = None if sync is None else Rounds(**sync)
        self.kinds = KINDS | {"wake"} | ({"sync-reply"} if self.rounds else set())

    def begin(self) -> Memory:
        """A slave that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        after = replace(after, phase=self._phase(after))
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if self.unasked and after.phase is Phase.ASLEEP and state.phase is not Phase.ASLEEP:
            effects = (*effects, Sample("wake-up"))
        if (receiver := self._receiver(after)) != self._receiver(state) or isinstance(event, Started):
            effects = (receiver, *effects)
        if after.phase is not state.phase:
            effects = (State(after.phase.value), *effects)
        return after, effects

    def _phase(self, memory: Memory) -> Phase:
        if not memory.search.master:
            return Phase.SEEKING if memory.search.receives else Phase.ORPHAN
        return Phase.ACTIVE if memory.last >= memory.first else Phase.ASLEEP

    def _receiver(self, memory: Memory) -> Radio | Listen:
        """How its receiver listens: always while it waits for an answer, else in its windows if it has a master."""
        if memory.search.receives or memory.time.waiting:
            return Radio(True)
        return self.wakeup.listen(memory.time.correction_ns) if memory.search.master else Radio(False)

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Timer(_, "sync") | Received(message=SyncReply()) if self.rounds and memory.reference:
                return self._keep(memory, event)
            case Received(now, Wake() as wake, sender):
                return self._woken(memory, now, wake, sender)
            case Started() | Received():
                return self._associated(memory, event)
            case Timer(now, name):
                return self._associated(memory, event) if name in TIMERS else self._ring(memory, now, name)
            case Sampled(now, sensor, value):
                return self._sampled(memory, now, sensor, value)
        raise IllegalEvent(f"a slave cannot handle {event}")

    def _ring(self, memory: Memory, now: int, timer: str) -> Step:
        match timer:
            case "step":
                return self._due(memory, now)
            case "report":
                return replace(memory, report=None), self._sent(memory, memory.report)
        raise IllegalEvent(f"a slave has no timer {timer!r} now")

    def _sampled(self, memory: Memory, now: int, sensor: str, value: Any) -> Step:
        if sensor != "wake-up":
            return self._measured(memory, now, value)
        return memory, () if value is None else self._look(memory, max(value, now))

    # --- its master, and its clock -------------------------------------------------------------------------------

    def _associated(self, memory: Memory, event: Event) -> Step:
        """Go on with the search for a master. One that is lost wakes it no more; a new one sets its clock."""
        search, effects = self.joining.handle(memory.search, event)
        before, after = memory.search.master, replace(memory, search=search)
        if search.master == before:
            return after, effects
        if not search.master:
            forgotten = (CancelTimer("step"), *(CancelTimer("report"),) * (after.report is not None))
            return replace(after, last=after.first - 1, report=None), (*effects, *forgotten)
        after = replace(after, reference=search.master)
        note = Note(f"{search.master} is its master")
        if self.rounds is None:
            return after, (*effects, note)
        if memory.time.phase.value == "new":
            time, asks = self._sync(search.master).handle(memory.time, Started(event.now))
            return replace(after, time=time), (*effects, note, *asks)
        soon = () if memory.time.in_round else (SetTimer("sync", event.now),)
        return after, (*effects, note, *soon)

    def _sync(self, master: str) -> TimeSync:
        assert self.rounds is not None
        return TimeSync(replace(self.rounds, reference=master))

    def _keep(self, memory: Memory, event: Event) -> Step:
        """Go on with a round of exchanges; after it, timers are set anew."""
        time, effects = self._sync(memory.reference).handle(memory.time, event)
        after = replace(memory, time=time)
        if time.in_round or not memory.time.in_round:
            return after, effects
        return after, (*effects, *self._next(after, event.now))

    # --- beacons -------------------------------------------------------------------------------------------------

    def _woken(self, memory: Memory, now: int, wake: Wake, sender: str) -> Step:
        if sender != memory.search.master:
            return memory, (Ignored("foreign"),)
        if memory.search.place not in wake.places or not wake.steps:  # which need not mean that it still has its place
            measured = memory.last >= memory.first
            return replace(memory, last=memory.first - 1), (CancelTimer("step"),) * measured
        renewed = SetTimer("renew", now + self.joining.renew_ns)
        slot = wake.slot + wake.places.index(memory.search.place)
        after = replace(memory, slot=slot, first=wake.step, last=wake.step + wake.steps - 1)
        if not (coming := self._next(after, now)):  # it came so late that its steps are over
            after = replace(after, last=after.first - 1)
        return after, (renewed, *coming)

    # --- steps ---------------------------------------------------------------------------------------------------

    def _into(self, memory: Memory, now: int) -> int:
        """The time (ns) since step 0 at this local time."""
        return memory.time.corrected(now) - self.origin_ns

    def _at(self, memory: Memory, step: int) -> tuple[Effect, ...]:
        """The timer of a step."""
        return (SetTimer("step", memory.time.local(self.origin_ns + step * self.step_ns)),) if step <= LAST_STEP else ()

    def _next(self, memory: Memory, now: int) -> tuple[Effect, ...]:
        """The timer of the next step at which it measures."""
        step = max(-(-self._into(memory, now) // self.step_ns), memory.done + 1, memory.first, 1)
        return self._at(memory, step) if memory.search.master and step <= memory.last else ()

    def _look(self, memory: Memory, from_ns: int) -> tuple[Effect, ...]:
        """The timer of the next step at which it looks by itself for a target."""
        return self._at(memory, max(-(-self._into(memory, from_ns) // self.step_ns), memory.done + 1, 1))

    def _due(self, memory: Memory, now: int) -> Step:
        """Measure if a step begins now; a process that was stopped may have missed it, or a clock gone back."""
        step, since = divmod(self._into(memory, now), self.step_ns)
        asked = memory.first <= step <= memory.last
        looks = self.unasked and memory.phase is Phase.ASLEEP
        if since == 0 and memory.done < step and (asked or looks):
            return replace(memory, done=step), (Sample("sound"),)
        if memory.phase is Phase.ACTIVE and step > memory.last:
            return self._expired(memory, now)
        return memory, self._next(memory, now) if memory.phase is Phase.ACTIVE else (Sample("wake-up"),) * bool(looks)

    def _measured(self, memory: Memory, now: int, heard: Reading | None) -> Step:
        step = memory.done
        loud = heard is not None and heard.level >= self.threshold_db
        if not memory.first <= step <= memory.last:
            return self._looked(memory, heard if loud else None)
        report = heard.report(step) if heard is not None and loud else NoTarget(step % CYCLE)
        if memory.slot:
            effects: tuple[Effect, ...] = (SetTimer("report", now + memory.slot * self.slot_ns),)
            after = replace(memory, report=report)
        else:
            after, effects = memory, self._sent(memory, report)
        if step < memory.last:
            return after, (*effects, *self._next(after, now))
        after, more = self._expired(after, now)
        return after, (*effects, *more)

    def _looked(self, memory: Memory, heard: Reading | None) -> Step:
        """What it sensed without being asked."""
        sent = () if heard is None else self._sent(memory, heard.report(memory.done))
        return memory, (*sent, Sample("wake-up"))

    def _expired(self, memory: Memory, now: int) -> Step:
        """No beacon came for so long that it sleeps; is its master still there?"""
        search, effects = self.joining.renew(memory.search, now)
        return replace(memory, search=search, last=memory.first - 1), effects

    def _sent(self, memory: Memory, report: Any) -> tuple[Effect, ...]:
        return (Send(report, memory.search.master),) if memory.search.master and report is not None else ()
