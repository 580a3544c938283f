"""A master: it admits slaves, wakes them, leads while the target is nearest to it, and helps others that lead.

Özfidan et al. (2018), sections II and III. Its pieces are association (``trackfield/protocols/association``), terms
(``trackfield/protocols/lease.py``), the trackers (``trackfield/tracking``), and the choice of sensors
(``trackfield/tracking/selection.py``). Its receiver is always on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import msgpack
from immutables import Map

from head.helping import Helping
from head.leading import Leading
from head.memory import TRANSITIONS, Known, Memory, Phase, Wanted
from head.settings import Settings, Times
from head.succession import Succession
from head.timing import Timing
from trackfield.protocols.association import admitting
from trackfield.protocols.collection.links import text_of
from trackfield.protocols.lease import TAKE_OVER, Lease, Term
from trackfield.protocols.lease import TIMER as LEASE
from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    check_transition,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.steps import Steps
from trackfield.wire.clusters import (
    Aggregate,
    Alive,
    Announce,
    Doubt,
    HandOver,
    HandOverAck,
    Merge,
    NoTarget,
    Roster,
    Share,
    Wake,
)
from trackfield.wire.codec import WireError, kind_name
from trackfield.wire.listed import unpacked
from trackfield.wire.messages import SyncReply, SyncRequest

OWN: Final = (
    "announce", "roster", "wake", "merge", "aggregate", "hand-over", "hand-over-ack", "share", "no-target", "doubt",
    "alive",
)  # fmt: skip
"""The messages that a master takes besides reports, and those that ask for a place or for the time."""

Step = tuple[Memory, tuple[Effect, ...]]


class Master:
    """Leads with the trackers of a ``Bank`` (its arguments), each step ``deadline_ns`` after its instant.

    ``settings`` are the fields of ``Settings``, ``times`` those of its ``Times``, ``association`` those of
    ``Admitting`` besides. ``unasked``: its slaves report by themselves, and it leads when they do and nobody else leads
    in reach. ``sync`` as for a fusion centre; it tells the time to its slaves.
    """

    def __init__(
        self,
        *,
        settings: Mapping[str, Any],
        times: Mapping[str, int],
        association: Mapping[str, Any],
        deadline_ns: int,
        unasked: bool = False,
        sync: Mapping[str, Any] | None = None,
        **bank: Any,
    ) -> None:
        masters = tuple((str(id), float(x), float(y)) for id, x, y in settings["masters"])
        self.settings = Settings(**{**settings, "masters": masters}, times=Times(**times))
        self.id, self.unasked = self.settings.id, unasked
        self.bank = Bank(**bank)
        self.sensors: Sequence[str] = tuple(self.bank.positions)
        x_m, y_m = self.settings.places[self.id]
        self.admitting = admitting.Admitting(
            id=self.id, x_m=x_m, y_m=y_m, sensors=self.sensors, seed=self.bank.seed, **association
        )
        self.lease = Lease(self.id, self.settings.timeout_steps * self.bank.step_ns, 2 * self.settings.times.frame_ns)
        self.steps = Steps(self.bank, deadline_ns=deadline_ns)
        self.leading = Leading(self.settings, self.bank, self.steps, self.lease, self.sensors)
        self.helping = Helping(self.bank, self.admitting, self.leading)
        self.succession = Succession(self.settings, self.bank, self.steps, self.lease, self.leading)
        self.timing = Timing(self.settings, sync, self.admitting.announcements)
        self.kinds = frozenset(OWN) | admitting.KINDS | self.bank.messages | self.timing.kinds

    def begin(self) -> Memory:
        """A master that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        after = replace(after, phase=_phase(after))
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.kept != state.kept:
            effects = (*effects, Store(self._pack(after)))
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Received(_, SyncRequest() | SyncReply()) | Timer(_, "sync"):
                return self._keep_time(memory, event)
            case Received(message=message) if kind_name(message) in admitting.KINDS:
                return self._associate(memory, event)
            case Received():
                return self._receive(memory, event)
            case Timer(_, name) if name in admitting.TIMERS:
                return self._associate(memory, event)
            case Timer(now, name):
                return self._ring(memory, now, name)
        raise IllegalEvent(f"a master cannot handle {event}")

    def _ring(self, memory: Memory, now: int, timer: str) -> Step:
        match timer:
            case self.steps.timer if memory.leads:
                return self._fuse(memory, now)
            case "window":
                return self.helping.beacon(memory, now)
            case "gather":
                return self.helping.gather(memory, now)
        begins = {
            "hand-over": self.leading.unanswered,
            "begin": self.succession.first,
            "clock": self.timing.start,
            LEASE: self.succession.silent,
            TAKE_OVER: self.succession.take_over,
        }
        if timer not in begins:
            raise IllegalEvent(f"a master has no timer {timer!r} now")
        return self._watched(now, *begins[timer](memory, now))

    # --- start, time, slaves -------------------------------------------------------------------------------------

    def _start(self, memory: Memory, start: Started) -> Step:
        members, effects = self.admitting.handle(memory.members, start)
        turn_ns = self.admitting.announce_ns + self.settings.rank * self.settings.times.clock_ns
        asks = SetTimer("clock", max(start.now, turn_ns))
        memory = replace(memory, members=members)
        if start.stored:
            memory, notes = self._unpack(memory, start)
            return memory, (*effects, asks, *notes)
        return memory, (*effects, asks, *self._begin(memory, start.now))

    def _begin(self, memory: Memory, now: int) -> tuple[SetTimer, ...]:
        """The first step is the instant at which somebody begins to lead, if it is known where the target is."""
        at = memory.time.local(self.bank.origin_ns)
        return (SetTimer("begin", at),) if self.bank.prior is not None and at >= now else ()

    def _pack(self, memory: Memory) -> bytes:
        """What its next life needs: the number of the term, its slaves, who sets its clock, and the others' slaves."""
        members, others = self.admitting.pack(memory.members), dict(memory.rosters)
        packed: bytes = msgpack.packb((memory.held.term.number, members, memory.references, others))
        return packed

    def _unpack(self, memory: Memory, start: Started) -> Step:
        try:
            number, members, references, rosters = msgpack.unpackb(start.stored)
            listed, known = self.admitting.unpack(memory.members, members, start.now), tuple(map(str, references))
            held = replace(memory.held, term=Term(int(number)))
            others = {id: tuple(ids) for id, ids in dict(rosters).items() if id in self.settings.places}
            if not set[str]().union(*others.values()) <= set(self.sensors):
                raise ValueError("sensors that are not of the field")
            return replace(memory, members=listed, held=held, references=known, rosters=Map(others)), ()
        except (ValueError, TypeError, msgpack.UnpackException) as error:
            return memory, (Note(f"What an earlier life stored cannot be used: {error}"),)

    def _keep_time(self, memory: Memory, event: Received | Timer) -> Step:
        """Ask for the time, or tell it; a member that asks is still there. After a round timers are set anew."""
        after, effects = self.timing.handle(memory, event)
        if isinstance(event, Received) and event.sender in memory.members.list:
            after = replace(after, members=self.admitting.heard(after.members, event.now, event.sender))
        if after.time.in_round or not memory.time.in_round:
            return after, effects
        deadline = self.leading.deadline(after) if after.leads else ()
        return after, (*effects, *deadline, *self._begin(after, event.now), *self.helping.again(after, event.now))

    def _associate(self, memory: Memory, event: Received | Timer) -> Step:
        members, effects = self.admitting.handle(memory.members, event)
        return replace(memory, members=members), effects

    # --- steps ---------------------------------------------------------------------------------------------------

    def _fuse(self, memory: Memory, now: int) -> Step:
        assert memory.leads is not None
        memory, gone = self.helping.judge(memory, now, memory.leads.progress.step + 1)
        memory, effects = self.leading.fuse(memory, now)
        return self._watched(now, memory, (*gone, *effects))

    def _watched(self, now: int, memory: Memory, effects: tuple[Effect, ...]) -> Step:
        """With the timer of the next beacon."""
        return memory, (*effects, *self.helping.watch(memory, now))

    # --- messages ------------------------------------------------------------------------------------------------

    def _receive(self, memory: Memory, event: Received) -> Step:
        now, message, sender = event.now, event.message, event.sender
        if isinstance(message, NoTarget) or self.bank.takes(message, sender):
            return self._reported(memory, now, message, sender)
        if isinstance(message, Announce):
            return self.timing.hear(memory, message, sender), ()
        if sender not in self.settings.places or sender == self.id:
            return memory, (Ignored("unknown master"),)
        match message:
            case Roster():
                memory, effects = self._listed(memory, message, sender)
            case Aggregate():
                memory, effects = self._gathered(memory, now, message, sender)
            case HandOver():
                memory, effects = self.succession.handed(memory, now, message, sender)
            case HandOverAck():
                memory, effects = self.leading.acknowledged(memory, now, message, sender)
            case Wake() | Merge() | Share():
                memory, effects = self._of_term(memory, now, message, sender)
            case Doubt(number, leader):
                memory, effects = self.succession.doubted(memory, now, Term(number, text_of(leader)), sender)
            case Alive(number, leader):
                memory, effects = self.succession.vouched(memory, now, Term(number, text_of(leader)))
            case _:
                effects = (Ignored("unexpected"),)
        return self._watched(now, memory, effects)

    def _listed(self, memory: Memory, message: Roster, sender: str) -> Step:
        """Another master is in reach, and has these slaves."""
        ids = unpacked(message.sensors, self.sensors)
        if ids is None:
            return memory, (Ignored("unknown sensor"),)
        return replace(memory, rosters=memory.rosters.set(sender, ids)), ()

    def _of_term(self, memory: Memory, now: int, message: Wake | Merge | Share, sender: str) -> Step:
        """Messages that say who leads; those of a term that is over are of no use."""
        leader = text_of(message.leader) if isinstance(message, Wake) else sender
        if not leader:
            return self._ended(memory, message.number, sender)
        if leader not in self.settings.places:
            return memory, (Ignored("unknown master"),)
        memory, effects, news = self.succession.hear(memory, now, Term(message.number, leader), direct=leader == sender)
        if news == "outdated":  # a leader that does not know so is told
            told = self.succession.told(memory, sender) if leader == sender else ()
            return memory, (*effects, *told, Ignored("outdated"))
        match message:
            case Merge():
                memory, more = self._asked(memory, now, message, sender)
            case Share(beliefs=b""):
                held, more = self.lease.end(memory.held, message.number)
                memory = replace(memory, held=held, known=None)
            case Share(step=step, heir=heir, beliefs=beliefs):
                known = Known(step, beliefs, text_of(heir))
                memory, more = replace(memory, known=known), ()
            case _:
                more = ()
        return memory, (*effects, *more)

    def _ended(self, memory: Memory, number: int, sender: str) -> Step:
        """The sender knows of no leader: if it led itself, its term is over."""
        if memory.held.term != Term(number, sender):
            return memory, ()
        held, effects = self.lease.end(memory.held, number)
        return replace(memory, held=held, known=None), effects

    def _asked(self, memory: Memory, now: int, merge: Merge, sender: str) -> Step:
        """The leader wants slaves of this master to measure, or no more."""
        sensors = unpacked(merge.sensors, self.sensors)
        if sensors is None:
            return memory, (Ignored("unknown sensor"),)
        if memory.leads:  # a message of its own term is its own
            return memory, (Ignored("unexpected"),)
        mine = tuple(id for id in sensors if id in memory.members.list)
        wanted = Wanted(sender, mine, merge.slot, merge.step + merge.steps - 1) if merge.steps else Wanted()
        return self.helping.ask(memory, now, wanted, merge.step)

    def _reported(self, memory: Memory, now: int, report: Any, sender: str) -> Step:
        """A slave's report: for the step's fix, for the leader, or unasked."""
        if sender not in memory.members.list:
            return memory, (Ignored("foreign"),)
        step = self.helping.step_of(memory, now, report)
        kept = self.helping.keep(memory, now, step, report, sender)
        if kept is None:
            return memory, (Ignored("late"),)
        if kept.leads and not isinstance(report, NoTarget):
            return self._collected(kept, now, step, {sender: report})
        asked = kept.leads or sender in kept.wanted.at(step)
        return (kept, ()) if asked or isinstance(report, NoTarget) else self._unasked(kept, now, step, report, sender)

    def _unasked(self, memory: Memory, now: int, step: int, report: Any, sender: str) -> Step:
        """A target is sensed that nobody asked for: it is the leader's, or else this master's."""
        if not self.unasked:
            return memory, (Ignored("not asked"),)
        if memory.held.watched:
            number, leader = memory.held.term
            return memory, (Send(Aggregate(number, step, self.leading.reports({sender: report})), leader),)
        memory, effects = self.succession.claim(memory, now, step)
        memory, more = self._collected(memory, now, step, {sender: report})
        return self._watched(now, memory, (*effects, *more))

    def _collected(self, memory: Memory, now: int, step: int, reports: Mapping[str, Any]) -> Step:
        """The reports of a step, by sensor, for the trackers; those that are of no use are ignored for a reason."""
        assert memory.leads is not None
        progress, effects, at = memory.leads.progress, tuple[Effect, ...](), memory.time.corrected(now)
        for sensor, report in reports.items():
            progress, more = self.steps.collect(progress, at, step, report, sender=sensor)
            effects = more or effects
        return replace(memory, leads=replace(memory.leads, progress=progress)), effects

    def _gathered(self, memory: Memory, now: int, message: Aggregate, sender: str) -> Step:
        """What another master's slaves reported."""
        if memory.leads is None:
            return memory, (Ignored("not leading"),)
        try:
            reports = self.leading.read(message.reports)
        except WireError as error:
            return memory, (Ignored(error.reason),)
        came = memory.leads.came | {sender} if sender in memory.leads.asked else memory.leads.came
        memory = replace(memory, leads=replace(memory.leads, came=came))
        sensed = {id: one for id, one in reports.items() if self.bank.takes(one, id)}
        return self._collected(memory, now, message.step, sensed)


def _phase(memory: Memory) -> Phase:
    if memory.leads:
        return Phase.LEADING
    if memory.wanted.sensors:
        return Phase.HELPING
    return Phase.FOLLOWING if memory.held.watched else Phase.IDLE
