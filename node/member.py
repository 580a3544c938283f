"""A member: the sensing half of a node that may also become the head (``head/header.py`` is the other one).

It sleeps but for short windows, in which a head may poll it (``trackfield/protocols/wakeup.py``): then it measures at
the instant of a step, and reports in its slot to whoever polled it, or says that it senses no target. What it senses
while nobody asked it, it tells the header of its own process only: a node with a detector that wakes it does so. Yu et
al. (2009), section 4; Zhou et al. (2011), section II. It keeps the clock of the process.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from math import inf
from typing import Any, Final

from node.keeping import Keeping, Kept
from trackfield.protocols.timesync import Timekeeping
from trackfield.protocols.wakeup import Wakeup
from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Listen,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    Transitions,
    check_transition,
)
from trackfield.sensing.readings import Reading
from trackfield.wire.clusters import CYCLE, Announce, NoTarget
from trackfield.wire.messages import SyncReply, SyncRequest
from trackfield.wire.peers import Poll

LAST_STEP: Final = 65535
HOLD: Final = 2
"""A poll holds for so many steps more, for those that hear no other one: it may have been lost."""


class Phase(Enum):
    """The phase of a member; ``SENSING``: it senses a target unasked, ``ACTIVE``: a head polled it."""

    NEW = "new"
    ASLEEP = "asleep"
    SENSING = "sensing"
    ACTIVE = "active"


_LIVING: Final = frozenset(Phase) - {Phase.NEW}

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, event): _LIVING for phase in _LIVING for event in (Timer, Received, Sampled)},
}


@dataclass(frozen=True, slots=True)
class Asked:
    """The ``head`` of the term with this ``number`` wants a report of ``step`` in ``slot``; -1: nobody asks."""

    number: int = 0
    head: str = ""
    step: int = -1
    slot: int = 0


@dataclass(frozen=True, slots=True)
class Memory:
    """The state of a member: its time, what it was asked last, and the last step ``done``.

    ``report`` waits for its slot. ``senses`` while it senses a target; if it does not, ``wakes_ns`` is the local time
    at which it may again (None: never).
    """

    phase: Phase = Phase.NEW
    kept: Kept = field(default_factory=Kept)
    asked: Asked = field(default_factory=Asked)
    done: int = 0
    report: Any = None
    senses: bool = False
    wakes_ns: int | None = None

    @property
    def time(self) -> Timekeeping:
        """What it knows of the time."""
        return self.kept.time


Step = tuple[Memory, tuple[Effect, ...]]


class Member:
    """Measures at the steps for which it was polled; step k begins at ``origin_ns`` + k ``step_ns``.

    It is the sensor of process ``id``, ``number`` in the field's list; ``slot_ns`` is from one slot to the next. A
    reading below ``threshold_db`` is no target. If ``local``, its header filters, and tells the head of that.
    ``wakeup`` are the arguments of its ``Wakeup``; None: its receiver is always on, as that of any node is until the
    field is set up. ``keeping`` are further arguments of its ``Keeping``, and ``sync`` holds the fields of its
    ``Rounds``; None: its clock is right.
    """

    def __init__(
        self,
        *,
        id: str,
        number: int,
        step_ns: int,
        slot_ns: int,
        keeping: Mapping[str, Any],
        wakeup: Mapping[str, Any] | None = None,
        origin_ns: int = 0,
        threshold_db: float = -inf,
        local: bool = False,
        sync: Mapping[str, Any] | None = None,
    ) -> None:
        self.id, self.number, self.step_ns, self.slot_ns = id, number, step_ns, slot_ns
        self.origin_ns, self.threshold_db, self.local = origin_ns, threshold_db, local
        self.wakeup = None if wakeup is None else Wakeup(**wakeup)
        self.keeping = Keeping(id=id, sync=sync, wakeup=self.wakeup, **keeping)
        self.kinds = frozenset({"poll"}) | self.keeping.kinds

    def begin(self) -> Memory:
        """A member that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        if isinstance(event, Received) and isinstance(event.message, Announce):
            return replace(state, kept=self.keeping.hear(state.kept, event.message, event.sender)), ()
        after, effects = self._react(state, event)
        after = replace(after, phase=self._phase(after))
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if (receiver := self._receiver(after)) != self._receiver(state) or isinstance(event, Started):
            effects = (receiver, *effects)
        if after.kept.references != state.kept.references and not isinstance(event, Started):
            effects = (*effects, Store(self.keeping.pack(after.kept)))
        if after.phase is not state.phase:
            effects = (State(after.phase.value), *effects)
        return after, effects

    def _phase(self, memory: Memory) -> Phase:
        if memory.asked.step > memory.done or memory.report is not None:
            return Phase.ACTIVE
        return Phase.SENSING if memory.senses else Phase.ASLEEP

    def _receiver(self, memory: Memory) -> Radio | Listen:
        """How its receiver listens: always during the set-up and while it waits for the time, else in its windows."""
        if self.wakeup is None or not memory.kept.settled or memory.time.waiting:
            return Radio(True)
        return self.wakeup.listen(memory.time.correction_ns)

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started(now, stored):
                kept, effects = self.keeping.start(memory.kept, now, stored)
                return replace(memory, kept=kept), (*effects, Sample("wake-up"))
            case Received():
                return self._receive(memory, event)
            case Timer():
                return self._ring(memory, event)
            case Sampled(now, "wake-up", at):
                memory = replace(memory, wakes_ns=None if at is None else max(at, now))
                return memory, self._next(memory, now)
            case Sampled(now, _, value):
                return self._measured(memory, now, value)
        raise IllegalEvent(f"a member cannot handle {event}")

    def _receive(self, memory: Memory, event: Received) -> Step:
        match event:
            case Received(now, Poll() as poll, sender):
                return self._polled(memory, now, poll, sender)
            case Received(message=SyncReply() | SyncRequest()):
                return self._keep(memory, event)
        return memory, (Ignored("unexpected"),)

    def _ring(self, memory: Memory, event: Timer) -> Step:
        match event:
            case Timer(now, "clock" | "settled" as timer):
                kept, effects = self.keeping.ring(memory.kept, now, timer)
                return replace(memory, kept=kept), effects
            case Timer(_, "sync"):
                return self._keep(memory, event)
            case Timer(now, "step"):
                return self._due(memory, now)
            case Timer(_, "report") if memory.report is not None:
                return replace(memory, report=None), (Send(memory.report, memory.asked.head),)
        raise IllegalEvent(f"a member has no timer {event.name!r} now")

    def _keep(self, memory: Memory, event: Timer | Received) -> Step:
        """Go on with a round of exchanges, or tell the time; after a round, timers are set anew."""
        kept, effects = self.keeping.handle(memory.kept, event)
        after = replace(memory, kept=kept)
        if after.time.in_round or not memory.time.in_round:
            return after, effects
        return after, (*effects, *self._next(after, event.now))

    # --- polls ---------------------------------------------------------------------------------------------------

    def _polled(self, memory: Memory, now: int, poll: Poll, sender: str) -> Step:
        """A head asks: of two that do so for one step the one of the higher term."""
        own = self.number.to_bytes(2, "little")
        numbers = [poll.sensors[i : i + 2] for i in range(0, len(poll.sensors), 2)]
        before = memory.asked
        if (poll.number, sender) < (before.number, before.head) and before.step >= memory.done:
            return memory, (Ignored("outdated"),)
        if own not in numbers:
            return replace(memory, asked=Asked(poll.number, sender)), ()
        asked = Asked(poll.number, sender, poll.step, numbers.index(own))
        step, since = divmod(self._into(memory, now), self.step_ns)
        if poll.step < step or (poll.step == step and since) or poll.step <= memory.done:
            return memory, (Ignored("late"),)
        if poll.step > step + 2:
            return memory, (Ignored("from the future"),)
        after = replace(memory, asked=asked)
        return after, self._next(after, now)

    # --- steps ---------------------------------------------------------------------------------------------------

    def _into(self, memory: Memory, now: int) -> int:
        """The time (ns) since step 0 at this local time."""
        return memory.time.corrected(now) - self.origin_ns

    def _next(self, memory: Memory, now: int) -> tuple[Effect, ...]:
        """The timer of the next step at which it measures: when it was asked to, or may sense something."""
        steps = [memory.asked.step] if memory.asked.step > memory.done else []
        if memory.senses or memory.wakes_ns is not None:
            from_ns = now if memory.senses or memory.wakes_ns is None else max(memory.wakes_ns, now)
            steps.append(max(-(-self._into(memory, from_ns) // self.step_ns), memory.done + 1, 1))
        step = min(steps, default=LAST_STEP + 1)
        if step > LAST_STEP:
            return ()
        return (SetTimer("step", memory.time.local(self.origin_ns + step * self.step_ns)),)

    def _due(self, memory: Memory, now: int) -> Step:
        """Measure if a step begins now; a process that was stopped may have missed it, or a clock gone back."""
        step, since = divmod(self._into(memory, now), self.step_ns)
        if since == 0 and memory.done < step <= LAST_STEP:
            return replace(memory, done=step), (Sample("sound"),)
        if memory.asked.step < step or (memory.asked.step == step and since):
            memory = replace(memory, done=max(memory.done, memory.asked.step))
        return memory, self._next(memory, now)

    def _measured(self, memory: Memory, now: int, heard: Reading | None) -> Step:
        step, asked = memory.done, memory.asked
        loud = heard is not None and heard.level >= self.threshold_db
        after = replace(memory, senses=heard is not None, wakes_ns=None)
        own = heard.report(step) if heard is not None and loud else None
        effects: list[Effect] = [] if own is None else [Send(own, self.id)]
        held = asked.step < step <= asked.step + HOLD and own is not None and asked.step > 0
        tells = own is None or not self.local  # else its header says what it concludes
        if (asked.step == step or held) and asked.head != self.id and tells:
            answer = NoTarget(step % CYCLE) if own is None else own
            if asked.slot:
                after = replace(after, report=answer)
                effects.append(SetTimer("report", now + asked.slot * self.slot_ns))
            else:
                effects.append(Send(answer, asked.head))
        more = (Sample("wake-up"),) if heard is None else ()
        return after, (*effects, *self._next(after, now), *more)
