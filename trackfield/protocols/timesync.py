"""How a node learns the centre's time over the radio: exchanges as in NTP (RFC 5905, sections 8 and 10).

A request leaves at t0 and its reply arrives at t3 by the node's clock; by the centre's clock, the request arrives at t1
and the reply leaves at t2. Then the centre's clock is ahead by theta and the two frames took delta:

    theta = ((t1 - t0) + (t2 - t3)) / 2        delta = (t3 - t0) - (t2 - t1)

Of a round of exchanges the theta of the smallest delta counts (of equals the last): its error is at most delta / 2.
Each exchange has a slot of its own, and the next begins when that is over, whenever the reply arrived: so many nodes
that ask at a time do not flood the centre, and the sending times of a node depend on its own clock only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trackfield.draw import uniform
from trackfield.role import NS, Corrected, Effect, Ignored, Send, SetTimer
from trackfield.wire.messages import SyncReply, SyncRequest

SPREAD_NS: Final = NS
"""Nodes that are awake soon begin their first rounds spread over this time, so that not all ask at once."""
_NUMBERS: Final = 1 << 16
_US: Final = 1000


@dataclass(frozen=True, slots=True)
class Offset:
    """The result of an exchange: the centre's clock is ``theta_ns`` ahead, plus or minus half of ``delta_ns``."""

    delta_ns: int
    theta_ns: int


def offset(t0: int, t1: int, t2: int, t3: int) -> Offset:
    """The result of an exchange with the times t0 and t3 (node's clock), t1 and t2 (centre's clock)."""
    return Offset((t3 - t0) - (t2 - t1), ((t1 - t0) + (t2 - t3)) // 2)


@dataclass(frozen=True, slots=True)
class Timekeeping:
    """A node's knowledge of the time: its clock plus ``correction_ns`` is the centre's.

    ``asked`` counts its requests; ``sent_ns`` is the local sending time of the pending request, None if there is none.
    ``slots`` are left of the round, including the present one; ``best`` is the best result of the round so far. A node
    that is awake begins its next round at ``due_ns`` (local time).
    """

    correction_ns: int = 0
    asked: int = 0
    sent_ns: int | None = None
    slots: int = 0
    best: Offset | None = None
    due_ns: int = 0


Step = tuple[Timekeeping, tuple[Effect, ...]]


@dataclass(frozen=True, slots=True)
class Synchronisation:
    """Rounds of ``exchanges`` with ``centre``, a slot of ``timeout_ns`` for each.

    A node that is awake begins a round ``resync_ns`` after the last. Node ``id`` of a run with ``seed`` has its own
    share of the spread at the start and after failures.
    """

    centre: str
    exchanges: int
    resync_ns: int
    timeout_ns: int
    seed: int
    id: str

    @property
    def lead_ns(self) -> int:
        """How long a round takes."""
        return self.exchanges * self.timeout_ns

    def start(self, now: int) -> Timekeeping:
        """A life begins: a node that is awake soon begins its first round within ``SPREAD_NS``."""
        return Timekeeping(due_ns=now + int(SPREAD_NS * uniform(self.seed, self.id, "sync", "start")))

    def due(self, time: Timekeeping, now: int) -> Step:
        """The timer ``sync``: a round begins, or a slot of it is over."""
        left = time.slots - 1 if time.slots else self.exchanges
        return self._ask(replace(time, slots=left), now) if left else self._conclude(time, now)

    def receive(self, time: Timekeeping, now: int, reply: SyncReply, sender: str) -> Step:
        """A reply arrived; it is used only if it answers the pending request and its times are plausible."""
        if sender != self.centre:
            return time, (Ignored("foreign"),)
        if time.sent_ns is None or (reply.exchange, reply.sent_us) != (time.asked % _NUMBERS, time.sent_ns // _US):
            return time, (Ignored("outdated"),)
        found = offset(time.sent_ns, reply.came_us * _US, reply.left_us * _US, now)
        if reply.left_us < reply.came_us or found.delta_ns < 0:
            return time, (Ignored("implausible"),)
        best = found if time.best is None or found.delta_ns <= time.best.delta_ns else time.best
        return replace(time, sent_ns=None, best=best), ()

    def _ask(self, time: Timekeeping, now: int) -> Step:
        asked = time.asked + 1
        request = SyncRequest(asked % _NUMBERS, now // _US)
        after = replace(time, asked=asked, sent_ns=now)
        return after, (Send(request, self.centre), SetTimer("sync", now + self.timeout_ns))

    def _conclude(self, time: Timekeeping, now: int) -> Step:
        """The end of a round; if all its exchanges failed, the old correction holds, and the next round comes soon."""
        over = replace(time, sent_ns=None, slots=0, best=None)
        if time.best is None:
            pause = int(self.lead_ns * (1 + 2 * uniform(self.seed, self.id, "sync", time.asked)))
            return replace(over, due_ns=now + min(pause, self.resync_ns)), ()
        over = replace(over, correction_ns=time.best.theta_ns, due_ns=now + self.resync_ns)
        return over, (Corrected(over.correction_ns),)
