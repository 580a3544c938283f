"""A sensor node: sleeps until something can be heard, listens once a step, and reports what is loud enough.

Zhai et al., section III-A: a node is active while the level it receives exceeds its threshold, and sends level
and direction of arrival to the fusion centre.

A node whose clock is off asks another process for the time (``trackfield/protocols/timesync.py``): before it wakes, or
soon after its start, and at intervals while it is awake. Its time is its clock plus the correction; timers use the
local clock. A new correction may move time back, so the node remembers which steps it has done: none is reported twice.

A node whose threshold the centre sets listens for the command while it hears the target, after each step's deadline,
until the command arrives (``node/duty.py``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from math import inf
from typing import Any, Final

from node.duty import Duty
from node.spans import Spans, first_absent, insert
from trackfield.protocols.timesync import Timekeeping, TimeSync
from trackfield.role import (
    CancelTimer,
    ClockSet,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
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
from trackfield.wire.messages import SyncReply, Threshold

LAST_STEP: Final = 65535
"""The highest step that a report can hold."""


class Phase(Enum):
    """The phase of a node; ``AWAKE``: it hears the target, but below the threshold."""

    NEW = "new"
    ASLEEP = "asleep"
    AWAKE = "awake"
    REPORTING = "reporting"


_LISTENED: Final = frozenset({Phase.ASLEEP, Phase.AWAKE, Phase.REPORTING})

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): frozenset({Phase.ASLEEP}),
    **{(phase, Sampled): _LISTENED for phase in _LISTENED},
    **{(phase, event): frozenset({phase}) for phase in _LISTENED for event in (Timer, Received, ClockSet)},
}


@dataclass(frozen=True, slots=True)
class Memory:
    """The state of a node: the level from which it reports and since which step, the steps done, and its time.

    ``listening`` while its receiver is on for a command.
    """

    phase: Phase
    threshold_db: float
    threshold_step: int = -1
    listening: bool = False
    done: Spans = ()
    time: Timekeeping = field(default_factory=Timekeeping)


Step = tuple[Memory, tuple[Effect, ...]]


class Node:
    """Reports to ``centre`` in each step of ``step_ns`` in which it hears at least ``threshold_db``.

    Readings of a kind of sensing without thresholds are all reported.

    Step k begins at ``origin_ns`` + k ``step_ns``, and is numbered by that time. ``sync`` holds the fields of its
    ``Rounds``, of which the ``reference`` is the centre if left out, or of its ``Following``; None: its clock is right.
    ``adaptive`` holds those of its ``Duty`` except ``step_ns``, for a node whose threshold the centre sets; None: its
    threshold is fixed. A sensor that reports ``by_itself`` is not read at steps: its node sleeps until it does, and
    reports for the step that comes next.
    """

    def __init__(
        self,
        *,
        step_ns: int,
        centre: str,
        origin_ns: int = 0,
        threshold_db: float = -inf,
        sync: Mapping[str, Any] | None = None,
        adaptive: Mapping[str, int] | None = None,
        by_itself: bool = False,
    ) -> None:
        self.step_ns, self.origin_ns, self.threshold_db, self.centre = step_ns, origin_ns, threshold_db, centre
        self.by_itself = by_itself
        self.sync = None if sync is None else TimeSync.of(sync, reference=centre)
        self.follows = self.sync is not None and self.sync.follows
        self.duty = None if adaptive is None else Duty(step_ns, **adaptive)
        replies = self.sync.kinds - {"sync-request"} if self.sync else frozenset[str]()
        self.kinds = replies | (frozenset({"threshold"}) if self.duty else frozenset[str]())

    def begin(self) -> Memory:
        """A node that has not started."""
        return Memory(Phase.NEW, self.threshold_db)

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if self._receives(after) is not self._receives(state):
            effects = (Radio(self._receives(after)), *effects)
        if after.phase is not state.phase:
            effects = (State(after.phase.value), *effects)
        return after, effects

    def _receives(self, memory: Memory) -> bool:
        """Whether its receiver is on: only while a frame may arrive for it."""
        return memory.time.waiting or memory.listening

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(replace(memory, phase=Phase.ASLEEP), event)
            case Sampled(now, "wake-up", at):
                return memory, self._wake_at(memory, now, at)
            case Sampled(now, "sound", heard) if self.by_itself:
                return self._told(memory, now, heard)
            case Sampled(now, "sound", heard):
                return self._hear(replace(memory, done=insert(memory.done, self._step(memory, now))), now, heard)
            case Timer() | ClockSet():
                return self._ring(memory, event)
            case Received():
                return self._receive(memory, event)
        raise IllegalEvent(f"a node cannot handle {event}")

    def _ring(self, memory: Memory, event: Timer | ClockSet) -> Step:
        match event:
            case Timer(now, "step"):
                return memory, (Sample("sound"),) if self.by_itself else self._listen(memory, now)
            case Timer(now, "command") if self.duty:
                return self._attend(memory, now)
            case Timer(now, "sync") | ClockSet(now) if self.sync:
                return self._keep(memory, now, *self.sync.handle(memory.time, event))
        raise IllegalEvent(f"a node cannot handle {event}")

    def _receive(self, memory: Memory, event: Received) -> Step:
        match event:
            case Received(now, SyncReply()) if self.sync and not self.follows:
                return self._keep(memory, now, *self.sync.handle(memory.time, event))
            case Received(now, Threshold() as threshold, sender) if self.duty:
                return self._obey(memory, now, threshold, sender)
        return memory, (Ignored("unexpected"),)

    def _start(self, memory: Memory, start: Started) -> Step:
        time, effects = self.sync.handle(memory.time, start) if self.sync else (memory.time, ())
        return replace(memory, time=time), (Radio(False), *effects, Sample("wake-up"))

    # --- steps ----------------------------------------------------------------------------------------------------

    def _into(self, memory: Memory, now: int) -> int:
        """The time (ns) since step 0 at this local time."""
        return memory.time.corrected(now) - self.origin_ns

    def _step(self, memory: Memory, now: int) -> int:
        return self._into(memory, now) // self.step_ns

    def _listen(self, memory: Memory, now: int) -> tuple[Effect, ...]:
        """Read the sensor if a step begins now; a process that was stopped may have missed it, or a clock gone back."""
        step, since = divmod(self._into(memory, now), self.step_ns)
        if since == 0 and 1 <= step <= LAST_STEP and first_absent(memory.done, step) == step:
            return (Sample("sound"),)
        return self._listen_from(memory, now)

    def _hear(self, memory: Memory, now: int, heard: Reading | None) -> Step:
        if heard is None:
            deaf = (CancelTimer("command"),) if self.duty else ()
            return replace(memory, phase=Phase.ASLEEP, listening=False), (*deaf, Sample("wake-up"))
        again = self._listen_from(memory, now)
        if heard.level < memory.threshold_db:
            after, attend = self._attend(replace(memory, phase=Phase.AWAKE), now)
            return after, (*again, *attend)
        after, attend = self._attend(replace(memory, phase=Phase.REPORTING), now)
        return after, (Send(heard.report(self._step(memory, now)), self.centre), *again, *attend)

    def _told(self, memory: Memory, now: int, heard: Reading | None) -> Step:
        """A sensor reports by itself: at most once for a step."""
        step = -(-self._into(memory, now) // self.step_ns)
        known = not 1 <= step <= LAST_STEP or first_absent(memory.done, step) != step
        if heard is None or known or heard.level < memory.threshold_db:
            return memory, (Sample("wake-up"),)
        report = heard.report(step, step * self.step_ns - self._into(memory, now))
        return replace(memory, done=insert(memory.done, step)), (Send(report, self.centre), Sample("wake-up"))

    def _listen_from(self, memory: Memory, earliest_ns: int) -> tuple[Effect, ...]:
        """Listen at the first step from then on that is not done; step 0 is the start itself, without a reading."""
        step = first_absent(memory.done, max(-(-self._into(memory, earliest_ns) // self.step_ns), 1))
        if step > LAST_STEP:
            return ()
        return (SetTimer("step", memory.time.local(self.origin_ns + step * self.step_ns)),)

    def _wake_at(self, memory: Memory, now: int, at: int | None) -> tuple[Effect, ...]:
        """The timers of a sleeping node, which can hear something from local time ``at`` on."""
        if at is None:
            step: tuple[Effect, ...] = ()
        else:
            step = (SetTimer("step", at),) if self.by_itself else self._listen_from(memory, max(at, now))
        if self.sync is None or self.follows or memory.time.in_round:
            return step
        if at is None:
            return (CancelTimer("sync"),)
        ahead = at - self.sync.lead_ns
        return (*step, SetTimer("sync", ahead if ahead - self.sync.lead_ns > now else memory.time.due_ns))

    # --- messages of the centre -----------------------------------------------------------------------------------

    def _keep(self, memory: Memory, now: int, time: Timekeeping, effects: tuple[Effect, ...]) -> Step:
        """Go on with a round of exchanges; after it, or after one of another role, all timers are set anew."""
        after = replace(memory, time=time)
        if time.in_round or not (memory.time.in_round or self.follows):
            return after, effects
        if memory.phase is Phase.ASLEEP:
            return after, (*effects, Sample("wake-up"))
        after, attend = self._attend(after, now)
        return after, (*effects, *self._listen_from(after, now), *attend)

    def _attend(self, memory: Memory, now: int) -> Step:
        """Switch listening for the centre's command on or off, as is due now; a sleeping node does not listen."""
        if self.duty is None or memory.phase is Phase.ASLEEP:
            return memory, ()
        listening, wait_ns = self.duty.at(memory.time.corrected(now), memory.threshold_step)
        return replace(memory, listening=listening), (SetTimer("command", now + wait_ns),)

    def _obey(self, memory: Memory, now: int, threshold: Threshold, sender: str) -> Step:
        if sender != self.centre:
            return memory, (Ignored("foreign"),)
        if threshold.step <= memory.threshold_step:
            return memory, (Ignored("outdated"),)
        return self._attend(replace(memory, threshold_db=threshold.level_db, threshold_step=threshold.step), now)
