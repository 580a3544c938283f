"""A header: the half of a node that may become the head of those around it; its other half is a member
(``node/member.py``).

Yu et al. (2009), section 4, and Zhou et al. (2011), section II. Its pieces are the election
(``trackfield/protocols/election.py``), terms (``trackfield/protocols/lease.py``) and the trackers
(``trackfield/tracking``). It follows the clock that the member sets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Final

import msgpack
from immutables import Map

from head.peers.following import Following
from head.peers.leading import Leading
from head.peers.local import Local
from head.peers.memory import TRANSITIONS, Memory, Phase
from head.peers.settings import Settings, Times
from trackfield.protocols.announcing import Announcing
from trackfield.protocols.election import TIMERS as ELECTION
from trackfield.protocols.election import Election
from trackfield.protocols.lease import MOST_NUMBER, TAKE_OVER, Lease, Term
from trackfield.protocols.lease import TIMER as LEASE
from trackfield.protocols.timesync import TimeSync
from trackfield.role import (
    ClockSet,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Radio,
    Received,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    check_transition,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.steps import Steps
from trackfield.wire.clusters import Alive, Announce, Doubt, HandOver, HandOverAck, NoTarget
from trackfield.wire.peers import Claim, Dissolve, HeadEstimate, JoinClaim, LocalEstimate, Poll, Result

OWN: Final = (
    "announce", "claim", "join-claim", "poll", "result", "estimate", "dissolve", "hand-over", "hand-over-ack",
    "doubt", "alive", "no-target", "local-estimate",
)  # fmt: skip
"""The messages that a header takes besides reports."""

Step = tuple[Memory, tuple[Effect, ...]]


class Header:
    """Leads with the trackers of a ``Bank`` (its arguments) while its term lasts, each step after ``deadline_ns``.

    ``settings`` are the fields of ``Settings``, ``times`` those of its ``Times``, ``election`` those of ``Election``
    besides the id and the seed. ``sync`` holds the fields of a ``Following`` of the clock; None: the clock is right.
    """

    def __init__(
        self,
        *,
        settings: Mapping[str, Any],
        times: Mapping[str, int],
        election: Mapping[str, int],
        deadline_ns: int,
        sync: Mapping[str, Any] | None = None,
        **bank: Any,
    ) -> None:
        beyond = tuple((str(id), float(x), float(y)) for id, x, y in settings.get("beyond", ()))
        self.settings = Settings(**{**settings, "beyond": beyond}, times=Times(**times))
        self.bank, self.sync = Bank(**bank), TimeSync.of(sync)
        self.follows = self.sync.follows
        turns = self.settings.number, self.settings.times.nodes, self.settings.announcements
        x, y = self.bank.positions[self.settings.id]
        self.announcing = Announcing(*turns, self.settings.times.announce_ns, x, y)
        self.steps = Steps(self.bank, deadline_ns=deadline_ns)
        lease = Lease(self.settings.id, self.settings.times.lease_ns, self.settings.times.turn_ns)
        way = self.settings.local
        self.local = Local(self.bank, way) if way else None
        self.leading = Leading(self.settings, self.bank, self.steps, lease, self.local)
        contest = Election(id=self.settings.id, seed=self.bank.seed, **election)
        self.following = Following(self.settings, self.bank, self.steps, lease, contest, self.leading, self.local)
        self.kinds = frozenset(OWN) | self.bank.messages

    def begin(self) -> Memory:
        """A header that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        if isinstance(event, Received) and isinstance(event.message, Announce):
            return self._heard(state, event.message, event.sender), ()
        after, effects = self._react(state, event)
        after = replace(after, phase=self._phase(after))
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if self._receives(after) is not self._receives(state) or isinstance(event, Started):
            effects = (Radio(self._receives(after)), *effects)
        if after.held.term.number != state.held.term.number or (isinstance(event, Timer) and event.name == "known"):
            effects = (*effects, Store(self._pack(after)))
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _phase(self, memory: Memory) -> Phase:
        if memory.leads is not None:
            return Phase.LEADING
        if memory.race.open:
            return Phase.ELECTING
        if memory.polled.awake:
            return Phase.POLLED
        return Phase.FOLLOWING if memory.held.watched else Phase.IDLE

    def _receives(self, memory: Memory) -> bool:
        """Whether it wants the receiver on, outside of the windows of its member."""
        return memory.leads is not None or memory.race.open or memory.polled.awake

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Timer(_, "sync") | ClockSet():
                return self._keep_time(memory, event)
            case Received():
                return self._receive(memory, event)
            case Timer(now, name):
                return self._ring(memory, now, name)
        raise IllegalEvent(f"a header cannot handle {event}")

    def _ring(self, memory: Memory, now: int, timer: str) -> Step:
        if timer in ELECTION:
            return self.following.ring(memory, now, timer)
        if timer == self.steps.timer and memory.leads is not None:
            return self.leading.fuse(memory, now)
        begins = {
            "announce": self._announce,
            "known": lambda memory, now: (memory, ()),
            "window": self.leading.poll,
            "hand-over": self.leading.unanswered,
            "over": self.leading.again,
            "word": self.following.silent,
            "join": self.following.join,
            "conclude": self.following.conclude,
            LEASE: self.following.lapsed,
            TAKE_OVER: self.following.take_over,
        }
        if timer not in begins:
            raise IllegalEvent(f"a header has no timer {timer!r} now")
        return begins[timer](memory, now)

    # --- start, time, peers --------------------------------------------------------------------------------------

    def _start(self, memory: Memory, start: Started) -> Step:
        time, effects = self.sync.handle(memory.time, start) if self.follows else (memory.time, ())
        memory = replace(memory, time=time)
        if start.stored:
            memory, notes = self._unpack(memory, start.stored)
            return replace(memory, announced=self.settings.announcements), (*effects, *notes)
        known = SetTimer("known", max(start.now, self.settings.times.announce_ns))
        return memory, (*effects, known, self.announcing.next(memory.announced, start.now))

    def _announce(self, memory: Memory, now: int) -> Step:
        """Say where it stands."""
        announced, effects = self.announcing.ring(memory.announced, now)
        return replace(memory, announced=announced), effects

    def _keep_time(self, memory: Memory, event: Timer | ClockSet) -> Step:
        """The member has set the clock: timers are set anew."""
        time, effects = self.sync.handle(memory.time, event)
        after = replace(memory, time=time)
        return after, (*effects, *(self.leading.timers(after) if after.leads else ()))

    def _pack(self, memory: Memory) -> bytes:
        """What its next life needs: the number of the term, and whom it heard."""
        packed: bytes = msgpack.packb((memory.held.term.number, dict(memory.near)))
        return packed

    def _unpack(self, memory: Memory, stored: bytes) -> Step:
        try:
            number, near = msgpack.unpackb(stored)
            known = Map({id: int(count) for id, count in dict(near).items() if id in self.settings.numbers})
            if not (isinstance(number, int) and 0 <= number <= MOST_NUMBER):
                raise ValueError(f"{number!r} is no number of a term")
            if not all(0 <= count <= self.settings.announcements for count in known.values()):
                raise ValueError("more announcements than nodes make")
            held = replace(memory.held, term=Term(number))
            return replace(memory, held=held, near=known), ()
        except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
            return memory, (Note(f"What an earlier life stored cannot be used: {error}"),)

    # --- messages ------------------------------------------------------------------------------------------------

    def _receive(self, memory: Memory, event: Received) -> Step:
        now, message, sender = event.now, event.message, event.sender
        if self.bank.takes(message, sender):
            return self._reported(memory, now, message, sender)
        if sender not in self.settings.numbers or sender == self.settings.id:
            return memory, (Ignored("unknown node"),)
        takes = self._takes.get(type(message))
        return (memory, (Ignored("unexpected"),)) if takes is None else takes(memory, now, message, sender)

    @cached_property
    def _takes(self) -> Mapping[type, Callable[[Memory, int, Any, str], Step]]:
        """What takes each message of another node."""
        following, leading = self.following, self.leading
        return {
            Claim: following.contended,
            JoinClaim: following.contended,
            Poll: following.word,
            Result: following.word,
            HeadEstimate: following.word,
            Dissolve: following.dissolved,
            HandOver: following.handed,
            HandOverAck: leading.acknowledged,
            NoTarget: leading.answered,
            LocalEstimate: leading.concluded,
            Doubt: following.doubted,
            Alive: following.vouched,
        }

    def _heard(self, memory: Memory, message: Announce, sender: str) -> Memory:
        """A node announces itself."""
        if sender not in self.settings.numbers or not message.of:
            return memory
        times = min(memory.near.get(sender, 0) + 1, self.settings.announcements)
        return replace(memory, near=memory.near.set(sender, times))

    def _reported(self, memory: Memory, now: int, report: Any, sender: str) -> Step:
        """A report of a polled sensor; of its own, that there is a target, too."""
        if sender == self.settings.id:
            memory, effects = self.following.sensed(memory, now, report)
            if memory.leads is None or sender not in memory.leads.asked:
                return memory, effects
            memory, more = self.leading.collect(memory, now, report, sender)
            return memory, (*effects, *more)
        if memory.leads is None:
            return memory, (Ignored("not leading"),)
        return self.leading.collect(memory, now, report, sender)
