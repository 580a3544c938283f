"""Asking for the time and telling it over the radio: exchanges as in NTP (RFC 5905, sections 8 and 10).

A request leaves at t0 and its reply arrives at t3 by the asker's clock; by the time of its reference, the request
arrives at t1 and the reply leaves at t2. Then the reference is ahead by theta and the two frames took delta:

    theta = ((t1 - t0) + (t2 - t3)) / 2        delta = (t3 - t0) - (t2 - t1)

Of a round of exchanges the theta of the smallest delta counts (of equals the last): it differs from the lead of the
reference by at most delta / 2. Each exchange has a slot of its own, and the next begins when that is over, whenever the
reply arrived: so many processes that ask at a time do not flood their reference, and the sending times of a process
depend on its own clock only.

Any process may be a reference. One that asks nobody is a root: its clock is right by definition, and it answers always.
Any other answers by its corrected time, and not before it has set its clock once in its life; so processes that ask
each other in a circle never set theirs. The references of a run form trees: a root is of stratum 0, any other process
of one more than its reference. At stratum n the error is at most the sum of delta / 2 over the n exchanges between it
and the root, plus what the clocks in between have drifted since each was set.

The roles of one process (``trackfield.host``) share its clock. One of them asks and tells; the others follow: they are
given each correction that it finds, and say nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Final, Self

from trackfield.draw import uniform
from trackfield.role import (
    NS,
    CancelTimer,
    ClockSet,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
    Transitions,
    check_transition,
)
from trackfield.wire.keys import Medium
from trackfield.wire.messages import MOST_US, SyncReply, SyncRequest

SPREAD_NS: Final = NS
"""First rounds begin spread over this time, so that not all processes of a field ask at once."""
_NUMBERS: Final = 1 << 16
_US: Final = 1000


@dataclass(frozen=True, slots=True)
class Offset:
    """The result of an exchange: the reference is ``theta_ns`` ahead, plus or minus half of ``delta_ns``."""

    delta_ns: int
    theta_ns: int


def offset(t0: int, t1: int, t2: int, t3: int) -> Offset:
    """The result of an exchange with the times t0 and t3 (asker's clock), t1 and t2 (time of its reference)."""
    return Offset((t3 - t0) - (t2 - t1), ((t1 - t0) + (t2 - t3)) // 2)


class Phase(Enum):
    """``RESTING``: between rounds; ``ASKING``: a request waits for its reply; ``ANSWERED``: the rest of its slot.

    ``FOLLOWING``: another role of the process asks.
    """

    NEW = "new"
    RESTING = "resting"
    ASKING = "asking"
    ANSWERED = "answered"
    FOLLOWING = "following"


TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): frozenset({Phase.RESTING, Phase.FOLLOWING}),
    (Phase.RESTING, Timer): frozenset({Phase.ASKING}),
    (Phase.ASKING, Timer): frozenset({Phase.ASKING, Phase.RESTING}),
    (Phase.ANSWERED, Timer): frozenset({Phase.ASKING, Phase.RESTING}),
    (Phase.RESTING, Received): frozenset({Phase.RESTING}),
    (Phase.ASKING, Received): frozenset({Phase.ASKING, Phase.ANSWERED}),
    (Phase.ANSWERED, Received): frozenset({Phase.ANSWERED}),
    **{(Phase.FOLLOWING, event): frozenset({Phase.FOLLOWING}) for event in (Timer, Received, ClockSet)},
}


@dataclass(frozen=True, slots=True)
class Timekeeping:
    """What a process knows of the time: its clock plus ``correction_ns`` is its estimate of the root's.

    ``known`` once it has set its clock in this life. ``asked`` counts its requests, of which the last left at local
    time ``sent_ns``. ``slots`` are left of the round, including the present one; ``best`` is the best result of the
    round so far. The next round is due at local time ``due_ns``.
    """

    phase: Phase = Phase.NEW
    correction_ns: int = 0
    known: bool = False
    asked: int = 0
    sent_ns: int = 0
    slots: int = 0
    best: Offset | None = None
    due_ns: int = 0

    @property
    def waiting(self) -> bool:
        """Whether a reply may arrive now: its receiver must be on."""
        return self.phase is Phase.ASKING

    @property
    def in_round(self) -> bool:
        """Whether a round is under way; of a role that follows, whether it waits for the first correction."""
        return self.slots > 0

    def corrected(self, local_ns: int) -> int:
        """The estimated time of the root when the own clock shows ``local_ns``."""
        return local_ns + self.correction_ns

    def local(self, corrected_ns: int) -> int:
        """What the own clock shows at a corrected time: when to set a timer for that."""
        return corrected_ns - self.correction_ns


Step = tuple[Timekeeping, tuple[Effect, ...]]


@dataclass(frozen=True, slots=True)
class Rounds:
    """How a process asks: rounds of ``exchanges`` with ``reference``, a slot of ``timeout_ns`` for each.

    A round begins ``resync_ns`` after the last, and goes over ``medium``. Process ``id`` of a run with ``seed`` has its
    own share of the spread at the start and after failures.
    """

    reference: str
    exchanges: int
    resync_ns: int
    timeout_ns: int
    seed: int
    id: str
    medium: Medium = "field"

    @property
    def lead_ns(self) -> int:
        """How long a round takes."""
        return self.exchanges * self.timeout_ns


@dataclass(frozen=True, slots=True)
class Following:
    """How a role uses the clock that another role of its process sets, which has set it after ``follows_ns``, as a
    rule.
    """

    follows_ns: int


class TimeSync:
    """A protocol piece, in the form of a role: asks as ``rounds`` say, and tells the time to whoever asks.

    Without ``rounds`` it is the root. The role that it is part of keeps its ``Timekeeping``, gives it ``Started``, the
    timer ``sync`` and the frames of its ``kinds``, and passes its effects on. Between rounds the role may set the timer
    to another time, or cancel it. ``Corrected`` ends a round that succeeded.

    With ``Following`` it neither asks nor tells. The role that it is part of must have an attribute ``follows`` that is
    true, too, and gives it ``ClockSet``, which holds from then on. Until the first one, or until the timer if none
    comes in time, it is ``in_round``.
    """

    def __init__(self, rounds: Rounds | Following | None = None) -> None:
        self.following = rounds if isinstance(rounds, Following) else None
        self.rounds = rounds if isinstance(rounds, Rounds) else None
        told = set[str]() if self.following else {"sync-request"}
        self.kinds = frozenset(told | ({"sync-reply"} if self.rounds else set()))

    @classmethod
    def of(cls, sync: Mapping[str, Any] | None, **rounds: Any) -> Self:
        """From the argument ``sync`` of a role: the fields of ``Following`` or of its ``Rounds``, or None.

        ``rounds`` are fields of ``Rounds`` that may be left out.
        """
        if sync is None:
            return cls()
        return cls(Following(**sync) if "follows_ns" in sync else Rounds(**{**rounds, **sync}))

    @property
    def follows(self) -> bool:
        """Whether another role of the process sets the clock."""
        return self.following is not None

    @property
    def lead_ns(self) -> int:
        """How long a round takes; 0 for the root."""
        return self.rounds.lead_ns if self.rounds else 0

    def begin(self) -> Timekeeping:
        """A process that has not started."""
        return Timekeeping()

    def handle(self, state: Timekeeping, event: Event) -> Step:
        """See ``trackfield.role.Role``. Raises ``IllegalEvent`` for the timer of a root, and as ``TRANSITIONS`` say."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        return after, effects

    def _react(self, time: Timekeeping, event: Event) -> Step:
        match event:
            case Started(now):
                return self._start(time, now)
            case ClockSet() | Timer(_, "sync") if self.following:
                return _follow(time, event)
            case Timer(now, "sync") if self.rounds:
                left = time.slots - 1 if time.slots else self.rounds.exchanges
                time = replace(time, slots=left)
                return _ask(self.rounds, time, now) if left else _conclude(self.rounds, time, now)
            case Received(now, SyncReply() as reply, sender) if self.rounds:
                return _learn(self.rounds, time, now, reply, sender)
            case Received(message=SyncRequest()) if not self.following:
                return time, (self._tell(time, event),)
            case Received():
                return time, (Ignored("unexpected"),)
        raise IllegalEvent(f"timesync cannot handle {event}")

    def _start(self, time: Timekeeping, now: int) -> Step:
        """A life begins; the first round does so within ``SPREAD_NS``."""
        if self.following:
            due, waits = now + self.following.follows_ns, self.following.follows_ns > 0
            after = replace(time, phase=Phase.FOLLOWING, slots=int(waits), due_ns=due)
            return after, (SetTimer("sync", due),) if waits else ()
        time = replace(time, phase=Phase.RESTING)
        if self.rounds is None:
            return time, ()
        due = now + int(SPREAD_NS * uniform(self.rounds.seed, self.rounds.id, "sync", "start"))
        return replace(time, due_ns=due), (SetTimer("sync", due),)

    def _tell(self, time: Timekeeping, asked: Received) -> Send | Ignored:
        """The answer to a request, at once and on its medium: it leaves when the request came."""
        if self.rounds and not time.known:
            return Ignored("not synchronised")
        at_us = time.corrected(asked.now) // _US
        if abs(at_us) > MOST_US:  # its reference may have told it any time
            return Ignored("out of range")
        request = asked.message
        return Send(SyncReply(request.exchange, request.sent_us, at_us, at_us), asked.sender, asked.medium)


def _follow(time: Timekeeping, event: ClockSet | Timer) -> Step:
    """Another role has set the clock, or has not done so in time."""
    if isinstance(event, Timer):
        return replace(time, slots=0), ()
    after = replace(time, correction_ns=event.correction_ns, known=True, slots=0)
    return after, (CancelTimer("sync"),) if time.in_round else ()


def _ask(rounds: Rounds, time: Timekeeping, now: int) -> Step:
    asked = time.asked + 1
    request = SyncRequest(asked % _NUMBERS, now // _US)
    after = replace(time, phase=Phase.ASKING, asked=asked, sent_ns=now)
    return after, (Send(request, rounds.reference, rounds.medium), SetTimer("sync", now + rounds.timeout_ns))


def _learn(rounds: Rounds, time: Timekeeping, now: int, reply: SyncReply, sender: str) -> Step:
    """A reply is used only if it answers the pending request and its times are plausible."""
    if sender != rounds.reference:
        return time, (Ignored("foreign"),)
    if not time.waiting or (reply.exchange, reply.sent_us) != (time.asked % _NUMBERS, time.sent_ns // _US):
        return time, (Ignored("outdated"),)
    found = offset(time.sent_ns, reply.came_us * _US, reply.left_us * _US, now)
    if reply.left_us < reply.came_us or found.delta_ns < 0:
        return time, (Ignored("implausible"),)
    best = found if time.best is None or found.delta_ns <= time.best.delta_ns else time.best
    return replace(time, phase=Phase.ANSWERED, best=best), ()


def _conclude(rounds: Rounds, time: Timekeeping, now: int) -> Step:
    """The end of a round; if all its exchanges failed, the old correction holds, and the next round comes soon."""
    over = replace(time, phase=Phase.RESTING, best=None)
    if time.best is None:
        pause = int(rounds.lead_ns * (1 + 2 * uniform(rounds.seed, rounds.id, "sync", time.asked)))
        due = now + min(pause, rounds.resync_ns)
        return replace(over, due_ns=due), (SetTimer("sync", due),)
    due, correction = now + rounds.resync_ns, time.best.theta_ns
    over = replace(over, correction_ns=correction, known=True, due_ns=due)
    return over, (Corrected(correction), SetTimer("sync", due))
