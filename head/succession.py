"""Who leads after whom: the first leader, hand-overs that come, take-overs of a leader that is silent, claims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from head.beliefs import packed_beliefs
from head.leading import Leading
from head.memory import Known, Memory, Wanted
from head.settings import Settings
from trackfield.filters.belief import Belief, moments
from trackfield.protocols.lease import MOST_NUMBER, TAKE_OVER, Lease, News, Term
from trackfield.role import NEIGHBOURHOOD, NS, CancelTimer, Effect, Ignored, Note, Publish, Send, SetTimer, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.collecting import Collected
from trackfield.tracking.steps import Progress, Steps
from trackfield.tracking.stored import Stored, unpack
from trackfield.wire.clusters import Alive, Doubt, HandOver, HandOverAck, Share

VOUCHERS: Final = 4
"""So many masters answer one that doubts whether the leader is alive."""

Step = tuple[Memory, tuple[Effect, ...]]


@dataclass(frozen=True)
class Succession:
    """The part of a master that begins to lead, and that follows others."""

    settings: Settings
    bank: Bank
    steps: Steps
    lease: Lease
    leading: Leading

    def first(self, memory: Memory, now: int) -> Step:
        """The first step: the master that is nearest to where the target is known to be leads; all others know that."""
        prior = self.bank.prior
        if prior is None or memory.held.term.number:
            return memory, ()
        x, y = prior.mean[:2].tolist()
        leader = min(self.settings.away(id, x, y) for id in self.settings.places)[1]
        beliefs: dict[str, Belief | None] = dict.fromkeys(self.bank.trackers, prior)
        memory = replace(memory, known=Known(0, packed_beliefs(0, beliefs, particles=False)))
        if leader == self.settings.id:
            return self.leading.begin(memory, now, 1, self.steps.begin(), "the target starts near it")
        memory, effects, _ = self.hear(memory, now, Term(1, leader), direct=False)
        return memory, effects

    # --- others lead ---------------------------------------------------------------------------------------------

    def hear(self, memory: Memory, now: int, term: Term, *, direct: bool) -> tuple[Memory, tuple[Effect, ...], News]:
        """Somebody says that this is the term."""
        near = term.leader in memory.rosters
        held, effects, news = self.lease.hear(memory.held, now, term, direct=direct, near=near)
        memory = replace(memory, held=held)
        if news == "yielded":
            memory, more = self.leading.end(memory)
            effects = (*effects, *more, Note(f"yields to {term.leader}, term {term.number}"))
        if news == "follows" and memory.wanted.leader not in ("", term.leader):  # what the one before it wanted
            memory, effects = replace(memory, wanted=Wanted()), (*effects, CancelTimer("gather"))
        return memory, effects, news

    def silent(self, memory: Memory, now: int) -> Step:
        """The leader is silent for too long: when does this master take over?"""
        rank = self._rank(memory, now)
        timer = None if rank is None else self.lease.silent(memory.held, now, rank)
        if timer is None:
            return memory, ()
        return replace(memory, insists=False), (self._doubt(memory), timer)

    def _doubt(self, memory: Memory) -> Send:
        number, leader = memory.held.term
        return Send(Doubt(number, leader.encode()), NEIGHBOURHOOD)

    def doubted(self, memory: Memory, now: int, term: Term, sender: str) -> Step:
        """Another master has not heard the leader: if this one has, or knows of a later term, it says so."""
        held = memory.held
        knows = self.lease.vouches(held, now, term) or (held.term > term and held.term.leader)
        return memory, self.told(memory, sender) if knows else ()

    def told(self, memory: Memory, sender: str) -> tuple[Effect, ...]:
        """Tells another master which term holds, if this is one of those that are nearest to it."""
        others = {*memory.rosters, self.settings.id} - {sender}
        near = sorted(self.settings.away(id, *self.settings.places[sender]) for id in others)[:VOUCHERS]
        number, leader = memory.held.term
        if not leader or self.settings.id not in [id for _, id in near]:
            return ()
        return (Send(Alive(number, leader.encode()), sender),)

    def vouched(self, memory: Memory, now: int, term: Term) -> Step:
        """Another master says that this leader is alive."""
        if term == memory.held.term:
            return memory, self.lease.vouched(memory.held, now, term)
        memory, effects, _ = self.hear(memory, now, term, direct=False)
        return memory, effects

    def _rank(self, memory: Memory, now: int) -> int | None:
        """Its place in the order: first the heir, then by distance to where the target should be; None: it is in none.

        The silent leader is left out, and so are masters out of reach.
        """
        stored, dead = self._stored(memory, now), memory.held.term.leader
        known = None if stored is None else next(iter(stored.beliefs.values()), None)
        if memory.known is None or stored is None or known is None:
            return None
        mean = moments(known).mean
        seconds = (memory.time.corrected(now) - self.bank.at_ns(stored.step)) / NS
        x, y = (mean[:2] + mean[2:4] * seconds).tolist()
        living = {*memory.rosters, self.settings.id} - {dead}
        order = [id for _, id in sorted(self.settings.away(id, x, y) for id in living)]
        if (heir := memory.known.heir) in order:
            order = [heir, *(id for id in order if id != heir)]
        return order.index(self.settings.id)

    def _stored(self, memory: Memory, now: int) -> Stored | None:
        """What it knows of the target, if that can be used; what was said of steps to come cannot."""
        try:
            stored = None if memory.known is None else unpack(memory.known.beliefs)
        except ValueError:
            return None
        latest = self.bank.step_at(memory.time.corrected(now)) + 1
        return None if stored is None or stored.step > latest else stored

    # --- it leads ------------------------------------------------------------------------------------------------

    def take_over(self, memory: Memory, now: int) -> Step:
        """The leader is still silent, and it is this master's turn: it goes on with what was shared last.

        Unless it is the first in the order, it asks once more: by now others may know of a leader that it cannot hear.
        """
        stored, (number, silent) = self._stored(memory, now), memory.held.term
        if stored is None or not memory.held.watched:
            return memory, ()
        if not memory.insists and self._rank(memory, now):
            again = SetTimer(TAKE_OVER, now + self.lease.turn_ns)
            return replace(memory, insists=True), (self._doubt(memory), again)
        progress, points = self._resumed(memory, now, stored.beliefs, stored.step)
        after, effects = self.leading.begin(memory, now, number + 1, progress, f"{silent} is silent", dead=silent)
        published = tuple(Publish(replace(one, term=number + 1)) for one in points)
        shared = packed_beliefs(progress.step, self.bank.beliefs(progress.tracks), particles=False)
        told = Send(Share(number + 1, progress.step, b"", shared), NEIGHBOURHOOD)
        return after, (told, *published, *effects)

    def handed(self, memory: Memory, now: int, message: HandOver, sender: str) -> Step:
        """A leader hands over: this master leads, and acknowledges it; once more, if the first one was lost."""
        term, ack = Term(message.number, self.settings.id), Send(HandOverAck(message.number), sender)
        if memory.leads and memory.held.term == term:
            return memory, (ack,)
        if term <= memory.held.term or message.number > MOST_NUMBER:
            return memory, (Ignored("outdated"),)
        if message.step > self.bank.step_at(memory.time.corrected(now)) + 1:
            return memory, (Ignored("from the future"),)
        try:
            beliefs = unpack(message.beliefs).beliefs
        except ValueError:
            return memory, (Ignored("unusable belief"),)
        progress, points = self._resumed(memory, now, beliefs, message.step)
        after, effects = self.leading.begin(memory, now, message.number, progress, f"{sender} hands over")
        return after, (ack, *(Publish(replace(one, term=message.number)) for one in points), *effects)

    def claim(self, memory: Memory, now: int, step: int) -> Step:
        """A slave senses a target, and nobody in reach leads."""
        progress = Progress(self.bank.begin(prior=False), Collected(step - 1))
        return self.leading.begin(memory, now, memory.held.term.number + 1, progress, "its slaves sense a target")

    def _resumed(
        self, memory: Memory, now: int, beliefs: Mapping[str, Belief | None], since: int
    ) -> tuple[Progress, list[TrackPoint]]:
        """Trackers that go on from beliefs after a step, to the last one whose deadline is over, and their points."""
        until = max(self.bank.step_at(memory.time.corrected(now) - self.steps.deadline_ns), since)
        resumed = self.bank.resume(beliefs, since, until)
        return Progress(resumed.tracks, Collected(until)), resumed.points if until > since else []
