"""Hearing: the half of a node that may lead a cluster; the other half is its ear (``node/ear.py``).

Yang et al., section 4: sensor nodes report when a target was closest to them to the head of their cluster, over
directed diffusion, and the head solves for the target's path. Who leads is settled by ``fixed`` or by ``loudest``; what
a head does is in ``leading``. The two halves say to each other, by messages to the own id: an ``Interest`` (the ear
spreads it), a ``FixReport`` (the ear sends it to all that want fixes), ``Arrived`` (what came for this process over
several hops, or a copy of an interest), and the reports of the own sensor. It follows the ear's clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from head.hearing.fixed import Fixed
from head.hearing.leading import Leading
from head.hearing.loudest import Loudest
from head.hearing.memory import KEPT_NS, TRANSITIONS, Memory, Pass, Phase, Step, recent
from head.hearing.settings import Settings, Times, centre
from trackfield.protocols.timesync import TimeSync
from trackfield.role import (
    NS,
    ClockSet,
    Event,
    Ignored,
    IllegalEvent,
    Radio,
    Received,
    Started,
    State,
    Timer,
    check_transition,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.following import Starts
from trackfield.tracking.steps import Steps
from trackfield.wire.codec import WireError, decode
from trackfield.wire.interests import Arrived, Interest
from trackfield.wire.keys import check_id
from trackfield.wire.passes import PASSES, FixReport

SAME_NS: Final = 2 * NS
"""Two reports of a sensor with one number are one if they are of the same time within this."""


class Hearing:
    """Leads a cluster with the trackers of a ``Bank`` (its arguments), each step after ``deadline_ns``.

    ``settings`` are the fields of ``Settings``, ``times`` those of its ``Times``. Late reports up to an age of
    ``max_age_ns`` are used too. ``sync`` holds the fields of a ``Following`` of the clock; None: the clock is right.
    """

    def __init__(
        self,
        *,
        settings: Mapping[str, Any],
        times: Mapping[str, int],
        deadline_ns: int,
        max_age_ns: int = 0,
        sync: Mapping[str, Any] | None = None,
        **bank: Any,
    ) -> None:
        group = tuple(settings.get("group", ()))
        self.settings = Settings(**{**settings, "group": group}, times=Times(**times))
        self.bank, self.sync = Bank(**bank), TimeSync.of(sync)
        self.follows = self.sync.follows
        self.steps = Steps(self.bank, deadline_ns=deadline_ns, max_age_ns=max_age_ns)
        around = self.settings.group if self.settings.fixed else (self.settings.id,)
        solves = any(isinstance(one.following.tracker, Starts) for one in self.bank.trackers.values())
        self.leading = Leading(self.settings, self.bank, self.steps, centre(self.bank.positions, around), solves)
        self.settling = (Fixed if self.settings.fixed else Loudest)(self.settings, self.leading)
        told = frozenset[str]() if self.settings.fixed else frozenset({"fix"})
        self.kinds = frozenset({"arrived"}) | told | self.bank.messages

    def begin(self) -> Memory:
        """One that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        after = replace(after, phase=self._phase(after))
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _phase(self, memory: Memory) -> Phase:
        if memory.leads is None:
            return Phase.CONTENDING if memory.waits else Phase.FOLLOWING
        return Phase.GATHERING if memory.leads.progress is None else Phase.LEADING

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Timer(_, "sync") | ClockSet():
                time, effects = self.sync.handle(memory.time, event)
                after = replace(memory, time=time)
                return after, (*effects, *self.leading.timer(after))
            case Received():
                return self._receive(memory, event)
            case Timer(now, name):
                return self._ring(memory, now, name)
        raise IllegalEvent(f"one that hears cannot handle {event}")

    def _start(self, memory: Memory, start: Started) -> Step:
        time, effects = self.sync.handle(memory.time, start) if self.follows else (memory.time, ())
        memory, more = self.settling.start(replace(memory, time=time), start.now)
        return memory, (Radio(False), *effects, *more)  # the ear keeps the receiver on

    def _ring(self, memory: Memory, now: int, timer: str) -> Step:
        match timer:
            case "lead":
                return self.settling.due(memory, now)
            case "gathered" if memory.leads is not None and memory.leads.progress is None:
                return self.settling.gathered(memory, now)
            case self.steps.timer if memory.leads is not None:
                memory, effects = self.leading.fuse(memory, now)
                after, more = self.settling.fused(memory)
                return after, (*effects, *more)
        raise IllegalEvent(f"one that hears has no timer {timer!r} now")

    # --- messages ------------------------------------------------------------------------------------------------

    def _receive(self, memory: Memory, event: Received) -> Step:
        match event:
            case Received(now, Arrived() as arrived, self.settings.id):
                return self._arrived(memory, now, arrived)
            case Received(now, FixReport() as fix) if isinstance(self.settling, Loudest):
                return self.settling.told(memory, now, fix)
            case Received(now, report, sender) if self.bank.takes(report, sender):
                return self._passed(memory, now, report, sender, handed=sender == self.settings.id)
        return memory, (Ignored("unexpected"),)

    def _arrived(self, memory: Memory, now: int, arrived: Arrived) -> Step:
        """What came over several hops."""
        try:
            origin, message = check_id(arrived.origin.decode("ascii")), decode(arrived.message)
        except (WireError, UnicodeDecodeError):
            return memory, (Ignored("malformed"),)
        match message:
            case Interest():
                return self._wanted(memory, now, message, origin)
            case FixReport():
                return self.leading.handed(memory, now, message, origin)
            case report if self.bank.takes(report, origin):
                return self._passed(memory, now, report, origin, handed=True)
        return memory, (Ignored("unexpected"),)

    def _wanted(self, memory: Memory, now: int, message: Interest, sink: str) -> Step:
        """An interest of another node."""
        if message.task != PASSES or sink == self.settings.id or sink not in self.bank.positions:
            return memory, ()
        return self.settling.interest(memory, now, message, sink)

    def _passed(self, memory: Memory, now: int, report: Any, sender: str, *, handed: bool) -> Step:
        """A report of a pass, ``handed`` over by the ear, or broadcast by a neighbour."""
        at = memory.time.corrected(now)
        if sender not in self.bank.positions:
            return memory, (Ignored("unknown sensor"),)
        if report.step > self.bank.step_at(at) + 1:
            return memory, (Ignored("from the future"),)
        one = Pass(sender, report, self.bank.at_ns(report.step) - round(report.early_s * NS))
        if at - one.at_ns > KEPT_NS:
            return memory, (Ignored("late"),)
        if any(_same(one, other) for other in memory.passes):
            return memory, () if handed else (Ignored("repeated"),)
        memory = replace(memory, passes=recent((*memory.passes, one), at))
        if self.settings.fixed and memory.leads is not None and memory.leads.progress is not None:
            return self.leading.collect(memory, now, one)
        return self.settling.passed(memory, now, one)


def _same(one: Pass, other: Pass) -> bool:
    """Whether two reports are one."""
    numbers = one.report.event == other.report.event and one.sensor == other.sensor
    return numbers and abs(one.at_ns - other.at_ns) <= SAME_NS
