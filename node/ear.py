"""An ear: the half of a node that hears targets pass, and that is its place in directed diffusion.

The other half (``head/hearing/role.py``) may lead a cluster. The sensor reports by itself, some time after the closest
point of approach. A report leaves only if somebody wants it: to each sink whose interest in passes lives here
(``trackfield/protocols/interest``). A new head is sent the reports of the last ``KEPT_NS`` again, since the one before
it may have died with them; and so is a new sink of fixes the last fixes. If heads are the loudest nodes, a node in a
field that wants fixes also broadcasts its reports, so that its neighbours know who is loudest.

The ear keeps the clock of the process, and its receiver is always on. What the other half says to the own id, it does
for it: an ``Interest`` is spread (one that lasts 0 s is withdrawn), a ``FixReport`` goes to all that want fixes. What
comes for the process it hands over as ``Arrived``, and so each copy of an interest of others that is of use to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Final, NamedTuple

from node.keeping import Keeping, Kept
from node.spans import Spans, first_absent, insert
from trackfield.protocols.announcing import Announcing
from trackfield.protocols.interest.interests import Known, Wanted
from trackfield.protocols.interest.piece import TIMERS as DIFFUSION
from trackfield.protocols.interest.piece import Diffusion
from trackfield.protocols.interest.state import Spread
from trackfield.protocols.timesync import Timekeeping
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
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
    Store,
    Timer,
    Transitions,
    check_transition,
)
from trackfield.sensing.readings import Reading
from trackfield.wire.clusters import Announce
from trackfield.wire.codec import encode
from trackfield.wire.interests import Arrived, Interest
from trackfield.wire.messages import SyncReply, SyncRequest
from trackfield.wire.passes import EVENTS, FIXES, PASSES, FixReport

LAST_STEP: Final = 65535
KEPT_NS: Final = 15 * NS
"""So long a report may still be sent to a new head."""


class Phase(Enum):
    """The phase of an ear; ``WATCHING``: somebody wants its passes, or may be about to."""

    NEW = "new"
    IDLE = "idle"
    WATCHING = "watching"


_LIVING: Final = frozenset(Phase) - {Phase.NEW}

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, event): _LIVING for phase in _LIVING for event in (Timer, Received, Sampled)},
}


class Said(NamedTuple):
    """A ``message`` of the class ``task``, made at local time ``made_ns``."""

    made_ns: int
    task: int
    message: Any


@dataclass(frozen=True, slots=True)
class Memory:
    """The state of an ear: its time, its part in diffusion, and how often it ``announced`` itself.

    It has reported ``passes``, one in each of the steps ``done``; ``recent`` are the last reports and fixes, and
    ``served`` the interests under which they were sent.
    """

    phase: Phase = Phase.NEW
    kept: Kept = field(default_factory=Kept)
    spread: Spread = field(default_factory=Spread)
    announced: int = 0
    passes: int = 0
    done: Spans = ()
    recent: tuple[Said, ...] = ()
    served: frozenset[tuple[str, int]] = frozenset()

    @property
    def time(self) -> Timekeeping:
        """What it knows of the time."""
        return self.kept.time


Step = tuple[Memory, tuple[Effect, ...]]


class Ear:
    """The ear of process ``id``; step k begins at ``origin_ns`` + k ``step_ns``.

    ``announcing`` are the arguments of its ``Announcing``, ``keeping`` those of its ``Keeping``, ``diffusion`` those of
    its ``Diffusion`` besides the id, the place and the classes of data. If ``broadcasts``, its neighbours hear its
    reports, as heads are the loudest nodes. ``sync`` holds the fields of its ``Rounds``; None: its clock is right.
    """

    def __init__(
        self,
        *,
        id: str,
        step_ns: int,
        announcing: Mapping[str, Any],
        keeping: Mapping[str, Any],
        diffusion: Mapping[str, Any],
        origin_ns: int = 0,
        broadcasts: bool = False,
        sync: Mapping[str, Any] | None = None,
    ) -> None:
        self.id, self.step_ns, self.origin_ns, self.broadcasts = id, step_ns, origin_ns, broadcasts
        self.announcing = Announcing(**announcing)
        self.keeping = Keeping(id=id, sync=sync, **keeping)
        self.diffusion = Diffusion(
            id=id, x_m=self.announcing.x_m, y_m=self.announcing.y_m, sources=(PASSES,), **diffusion
        )
        self.kinds = frozenset({"fix"}) | self.diffusion.kinds | self.keeping.kinds

    def begin(self) -> Memory:
        """An ear that has not started."""
        return Memory(spread=self.diffusion.begin())

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        live = {task: self._wants(after, event.now, task) for task in (PASSES, FIXES)}
        after, more = self._serve(after, event.now, live)
        watched = live[PASSES] or (self.broadcasts and live[FIXES])
        after = replace(after, phase=Phase.WATCHING if watched else Phase.IDLE)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        effects = (*more, *effects)  # a reading is asked for last
        if after.kept.references != state.kept.references and not isinstance(event, Started):
            effects = (Store(self.keeping.pack(after.kept)), *effects)
        if after.phase is not state.phase:
            effects = (State(after.phase.value), *effects)
        return after, effects

    def _wants(self, memory: Memory, now: int, task: int) -> tuple[Known, ...]:
        """The interests in this class of data that live here."""
        return self.diffusion.live(memory.spread, now, task)

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Received():
                return self._receive(memory, event)
            case Timer():
                return self._ring(memory, event)
            case Sampled(_, "wake-up", at):
                return memory, () if at is None else (SetTimer("pass", max(at, event.now)),)
            case Sampled(now, _, heard):
                return self._heard(memory, now, heard)
        raise IllegalEvent(f"an ear cannot handle {event}")

    def _start(self, memory: Memory, start: Started) -> Step:
        kept, effects = self.keeping.start(memory.kept, start.now, start.stored)
        later = start.now >= self.announcing.announce_ns
        announced = self.announcing.announcements if later else 0
        first = () if later else (self.announcing.next(0, start.now),)
        spread, timers, _ = self.diffusion.handle(memory.spread, start)
        after = replace(memory, kept=kept, announced=announced, spread=spread)
        return after, (Radio(True), *effects, *timers, *first, Sample("wake-up"))

    def _ring(self, memory: Memory, event: Timer) -> Step:
        match event:
            case Timer(_, "pass"):
                return memory, (Sample("sound"),)
            case Timer(now, "announce"):
                announced, effects = self.announcing.ring(memory.announced, now)
                return replace(memory, announced=announced), effects
            case Timer(now, "clock" | "settled" as timer):
                kept, effects = self.keeping.ring(memory.kept, now, timer)
                return replace(memory, kept=kept), effects
            case Timer(_, "sync"):
                return self._keep(memory, event)
            case Timer(name=name) if name in DIFFUSION:
                return self._diffuse(memory, event)
        raise IllegalEvent(f"an ear has no timer {event.name!r}")

    def _receive(self, memory: Memory, event: Received) -> Step:
        match event:
            case Received(_, Announce() as message, sender):
                return replace(memory, kept=self.keeping.hear(memory.kept, message, sender)), ()
            case Received(message=SyncReply() | SyncRequest()):
                return self._keep(memory, event)
            case Received(now, Interest() as asked, self.id):
                return self._ask(memory, now, asked)
            case Received(now, FixReport() as fix, self.id):
                memory = self._kept(memory, Said(now, FIXES, fix))
                return self._tell(memory, now, fix, self._wants(memory, now, FIXES))
            case Received(message=FixReport()):  # a neighbour says that an event is over
                return memory, ()
        return self._diffuse(memory, event)

    def _keep(self, memory: Memory, event: Timer | Received) -> Step:
        """Go on with a round of exchanges, or tell the time; after a round the sensor is asked anew when it reports."""
        kept, effects = self.keeping.handle(memory.kept, event)
        after = replace(memory, kept=kept)
        if after.time.in_round or not memory.time.in_round:
            return after, effects
        return after, (*effects, Sample("wake-up"))

    # --- diffusion -----------------------------------------------------------------------------------------------

    def _diffuse(self, memory: Memory, event: Received | Timer) -> Step:
        """An event of diffusion; what it brings goes to the other half."""
        spread, effects, arrived = self.diffusion.handle(memory.spread, event)
        given = [self._hand(one.sender.encode(), one.message) for one in arrived]
        if isinstance(event, Received) and isinstance(event.message, Interest):
            new = not any(isinstance(one, Ignored) for one in effects)
            given += [self._hand(event.message.sink, event.message)] if new else []
        return replace(memory, spread=spread), (*effects, *given)

    def _hand(self, origin: bytes, message: Any) -> Send:
        return Send(Arrived(origin, encode(message)), self.id)

    def _ask(self, memory: Memory, now: int, asked: Interest) -> Step:
        """The other half wants something, or no more."""
        if not asked.lasts_s:
            spread, effects, _ = self.diffusion.withdraw(memory.spread, asked.number)
            return replace(memory, spread=spread), effects
        place = asked.x_m, asked.y_m, asked.radius_m
        wanted = Wanted(asked.number, asked.task, *place, asked.interval_s, asked.lasts_s, asked.most_hops)
        spread, effects, _ = self.diffusion.ask(memory.spread, now, wanted)
        return replace(memory, spread=spread), effects

    def _tell(self, memory: Memory, now: int, message: Any, known: tuple[Known, ...]) -> Step:
        """Send a message to the sinks of these interests."""
        effects = list[Effect]()
        for one in known:
            if one.sink == self.id:  # of fixes its other half knows
                effects += [] if isinstance(message, FixReport) else [Send(message, self.id)]
                continue
            spread, told, _ = self.diffusion.tell(memory.spread, now, message, one)
            memory = replace(memory, spread=spread)
            effects += told
        return memory, tuple(effects)

    # --- passes --------------------------------------------------------------------------------------------------

    def _heard(self, memory: Memory, now: int, heard: Reading | None) -> Step:
        """The sensor knows of a pass: the report is for the step that comes next."""
        into_ns = memory.time.corrected(now) - self.origin_ns
        step = -(-into_ns // self.step_ns)
        known = not 1 <= step <= LAST_STEP or first_absent(memory.done, step) != step
        if heard is None or known:
            return memory, (Sample("wake-up"),)
        report = replace(heard.report(step, step * self.step_ns - into_ns), event=memory.passes % EVENTS)
        after = replace(memory, passes=memory.passes + 1, done=insert(memory.done, step))
        after = self._kept(after, Said(now, PASSES, report))
        after, effects = self._tell(after, now, report, self._wants(after, now, PASSES))
        shouts = self._shout(after, now, report) if self.broadcasts else ()
        return after, (*effects, *shouts, Sample("wake-up"))

    def _shout(self, memory: Memory, now: int, report: Any) -> tuple[Effect, ...]:
        """Tell all neighbours and the other half, which may be the loudest one, if anybody wants fixes."""
        if not self._wants(memory, now, FIXES):
            return ()
        own = any(one.sink == self.id for one in self._wants(memory, now, PASSES))  # then it was told already
        return (Send(report, NEIGHBOURHOOD),) if own else (Send(report, NEIGHBOURHOOD), Send(report, self.id))

    def _kept(self, memory: Memory, said: Said) -> Memory:
        """With one more message that may be sent again, and without those that are too old for that."""
        fresh = (one for one in memory.recent if said.made_ns - one.made_ns <= KEPT_NS)
        return replace(memory, recent=(*fresh, said))

    def _serve(self, memory: Memory, now: int, live: Mapping[int, tuple[Known, ...]]) -> Step:
        """Send the last reports and fixes to sinks whose interests, by class of data, are new here."""
        served = frozenset(one.key for known in live.values() for one in known)
        if served == memory.served:
            return memory, ()
        after, effects = replace(memory, served=served), list[Effect]()
        for made_ns, task, message in memory.recent:
            if now - made_ns <= KEPT_NS:
                new = tuple(one for one in live[task] if one.key not in memory.served)
                after, told = self._tell(after, now, message, new)
                effects += told
        return after, tuple(effects)
