"""What a header does while others lead, or nobody: it follows terms, takes over, contends, and lets others have it.

A node that senses a target while it knows of no head starts an election (``trackfield/protocols/election.py``). Those
that know of one say so, and the election is off. A head lives as long as its word is heard: a poll in the window of
each step, and what it says after the deadline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from head.beliefs import packed_beliefs
from head.peers.known import rank_of, stored_of
from head.peers.leading import Leading, prior_beliefs, untold
from head.peers.local import Local
from head.peers.memory import Known, Memory, Polled, Sensed
from head.peers.settings import Settings
from trackfield.filters.belief import Belief
from trackfield.protocols.collection.links import text_of
from trackfield.protocols.election import Election
from trackfield.protocols.lease import MOST_NUMBER, TAKE_OVER, Lease, Term
from trackfield.role import (
    NEIGHBOURHOOD,
    CancelTimer,
    Effect,
    Ignored,
    Note,
    Publish,
    Send,
    SetTimer,
    TrackPoint,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.collecting import Collected
from trackfield.tracking.plausible import plausible
from trackfield.tracking.results import beliefs_of
from trackfield.tracking.steps import Progress, Steps
from trackfield.tracking.stored import unpack
from trackfield.wire.clusters import Alive, Doubt, HandOver, HandOverAck
from trackfield.wire.peers import MOST_KEY, Claim, Dissolve, HeadEstimate, JoinClaim, LocalEstimate, Poll, Result

HOLD: Final = 2
"""One that hears no poll for more steps than that measures no more: it sleeps, and does not take over."""

Step = tuple[Memory, tuple[Effect, ...]]
Word = Poll | Result | HeadEstimate


@dataclass(frozen=True)
class Following:
    """The part of a header that follows others, and begins to lead."""

    settings: Settings
    bank: Bank
    steps: Steps
    lease: Lease
    election: Election
    leading: Leading
    local: Local | None = None

    # --- terms ---------------------------------------------------------------------------------------------------

    def led(self, memory: Memory, now: int) -> bool:
        """Whether it knows of a head that lives: itself, or one of which it heard within the lease."""
        held = memory.held
        if memory.leads is not None or now < memory.waits_ns:
            return True
        return bool(held.term.leader) and held.watched and now - held.heard_ns < self.lease.timeout_ns

    def word(self, memory: Memory, now: int, message: Word, sender: str) -> Step:
        """A head says something: whoever follows it, or led in a lower term, knows that it lives."""
        term = Term(message.number, sender)
        held, effects, news = self.lease.hear(memory.held, now, term, direct=True, near=True)
        if news == "outdated":
            return memory, (Ignored("outdated"), *self._told(memory, now, sender))
        memory = replace(memory, held=held)
        if news == "yielded":
            memory, more = self._yield(memory, term, heard=True)
            effects = (*effects, *more)
        memory, stops = self._off(memory)
        effects = (*effects, *stops)
        if news:  # the new head is to be told, too
            memory = replace(memory, joined=untold(memory.joined, self.settings.id))
        match message:
            case Poll():
                memory, more = self._polled(memory, now, message)
            case Result() | HeadEstimate():
                memory, more = self._known(memory, message.step, beliefs_of(message, self.bank.trackers))
        return memory, (*effects, *more)

    def _yield(self, memory: Memory, term: Term, *, heard: bool) -> Step:
        """Another one leads in a higher term: it gets what this one knows, as it may have begun without a track.

        One that was not ``heard`` itself may be out of reach, and gets it by broadcast.
        """
        assert memory.leads is not None
        step, beliefs = memory.leads.progress.step, self.bank.beliefs(memory.leads.progress.tracks)
        after, effects = self.leading.end(memory)
        to = term.leader if heard else NEIGHBOURHOOD
        given = Send(LocalEstimate(term.number, step, packed_beliefs(step, beliefs)), to)
        knows = (given,) if all(one is not None for one in beliefs.values()) else ()
        return after, (*effects, *knows, Note(f"yields to {term.leader}, term {term.number}"))

    def _told(self, memory: Memory, now: int, sender: str) -> tuple[Effect, ...]:
        """Tells one that leads in a term that is over, or contends, which term holds."""
        number, leader = memory.held.term
        near = leader == self.settings.id or memory.polled.awake
        return (Send(Alive(number, leader.encode()), sender),) if near and self.led(memory, now) else ()

    def _polled(self, memory: Memory, now: int, poll: Poll) -> Step:
        """Who measures at the coming step: if it does itself, its receiver stays on."""
        numbers = {number: id for id, number in self.settings.numbers.items()}
        given = [int.from_bytes(poll.sensors[i : i + 2], "little") for i in range(0, len(poll.sensors), 2)]
        ids = tuple(numbers[one] for one in given if one in numbers)
        awake = self.settings.number in given
        slot = given.index(self.settings.number) if awake else 0
        after = replace(memory, polled=Polled(poll.step, ids, awake, slot))
        joins = self._join(after, now, poll) if self.settings.joins and not awake else ()
        return after, (*joins, *self._wait(after, poll.step))

    def _wait(self, memory: Memory, step: int) -> tuple[Effect, ...]:
        """The timer by which the head must have said something of this step, for those that would take over."""
        if not (self.settings.takes_over and memory.polled.awake):
            return (CancelTimer("word"), CancelTimer(TAKE_OVER))
        due_ns = self.bank.at_ns(step) + self.settings.times.word_ns
        return (SetTimer("word", memory.time.local(due_ns)), CancelTimer(TAKE_OVER))

    def _known(self, memory: Memory, step: int, beliefs: bytes) -> Step:
        if memory.known is not None and memory.known.step > step:
            return memory, ()
        return replace(memory, known=Known(step, beliefs)), self._wait(memory, step + 1)

    def dissolved(self, memory: Memory, now: int, message: Dissolve, sender: str) -> Step:
        """A head gives up its term."""
        term = Term(message.number, sender)
        if memory.held.term != term:
            return memory, (Ignored("repeated" if memory.held.over == term else "outdated"),)
        held, effects = self.lease.end(memory.held, message.number)
        known = None if message.lost else memory.known
        after = replace(memory, held=held, known=known, polled=Polled(), waits_ns=0)
        after, more = self._contend(after, now)
        return after, (*effects, CancelTimer("word"), *more)

    # --- the head is silent --------------------------------------------------------------------------------------

    def silent(self, memory: Memory, now: int) -> Step:
        """No word in time, to one that measured: are the others as deaf? If so, it takes over when its turn comes."""
        if self.bank.step_at(memory.time.corrected(now)) > memory.polled.step + HOLD:
            memory = replace(memory, polled=Polled())
        rank = rank_of(self.settings, self.bank, memory, now)
        if rank is None or memory.leads is not None or not memory.polled.awake:
            return memory, ()
        number, leader = memory.held.term
        turn = SetTimer(TAKE_OVER, now + (1 + rank) * self.settings.times.turn_ns)
        return memory, (Send(Doubt(number, leader.encode()), NEIGHBOURHOOD), turn)

    def doubted(self, memory: Memory, now: int, message: Doubt, sender: str) -> Step:
        """Another node did not hear the head: if this one did, or knows of a later term, it says so."""
        term = Term(message.number, text_of(message.leader))
        knows = self._vouches(memory, now, term) or (memory.held.term > term and self.led(memory, now))
        number, leader = memory.held.term
        return memory, (Send(Alive(number, leader.encode()), sender),) if knows and leader else ()

    def _vouches(self, memory: Memory, now: int, term: Term) -> bool:
        """Whether it heard that head later than the one that doubts could have."""
        held, times = memory.held, self.settings.times
        return term == held.term and (memory.leads is not None or now - held.heard_ns < times.word_ns)

    def vouched(self, memory: Memory, now: int, message: Alive, sender: str) -> Step:
        """Another node says that this head lives: what it says of the next step is waited for."""
        term = Term(message.number, text_of(message.leader))
        if term.leader == self.settings.id or term.number > MOST_NUMBER:
            return memory, (Ignored("outdated"),)
        held, effects, news = self.lease.hear(memory.held, now, term, direct=True, near=True)
        if news == "outdated":
            return memory, (Ignored("outdated"),)
        memory = replace(memory, held=held)
        if news == "yielded":
            memory, more = self._yield(memory, term, heard=False)
            effects = (*effects, *more)
        if news:  # what another head wanted of it is void
            memory = replace(memory, polled=Polled(), joined=untold(memory.joined, self.settings.id))
        memory, stops = self._off(memory)
        step = self.bank.step_at(memory.time.corrected(now)) + 1
        return memory, (*effects, *stops, *self._wait(memory, step))

    def take_over(self, memory: Memory, now: int) -> Step:
        """The head is still silent, and it is this node's turn: it goes on with what was said last, and says so."""
        stored, (number, silent) = stored_of(self.settings, self.bank, memory, now), memory.held.term
        if stored is None or memory.leads is not None or not memory.polled.awake:
            return memory, ()
        after, effects = self._lead(memory, now, number + 1, stored.beliefs, stored.step, f"{silent} is silent")
        after, told = self.leading.word(after)
        return after, (told, *effects)

    # --- elections -----------------------------------------------------------------------------------------------

    def sensed(self, memory: Memory, now: int, report: Any) -> Step:
        """Its own sensor senses a target."""
        kind = self.bank.kind(self.settings.id)
        db = float(kind.loudness(kind.z(np.array([kind.values(report)], float)))[0])
        memory = replace(memory, sensed=Sensed(report.step, self.settings.key(db), report))
        polled = memory.polled
        if self.local is None or memory.leads is not None or not (polled.awake and polled.step == report.step):
            return self._contend(memory, now)
        return memory, (SetTimer("conclude", now + polled.slot * self.settings.times.slot_ns),)

    def conclude(self, memory: Memory, now: int) -> Step:
        """Its slot: it tells the head what it concludes; what it read, if it does not know the head's last estimate."""
        sensed, (number, leader) = memory.sensed, memory.held.term
        if self.local is None or not leader or memory.leads is not None:
            return memory, ()
        stored = stored_of(self.settings, self.bank, memory, now)
        if stored is None or stored.step != sensed.step - 1 or None in stored.beliefs.values():
            return memory, (Send(sensed.report, leader),)
        beliefs = self.local.packed(stored, sensed.step, self.settings.id, sensed.report)
        return memory, (Send(LocalEstimate(number, sensed.step, beliefs), leader),)

    def lapsed(self, memory: Memory, now: int) -> Step:
        """The lease of the head is over."""
        return self._contend(replace(memory, polled=Polled()), now)

    def _contend(self, memory: Memory, now: int) -> Step:
        """Start an election, if it senses a target now and knows of no head."""
        step = self.bank.step_at(memory.time.corrected(now))
        if memory.sensed.step != step or step < 1 or self.led(memory, now):
            return memory, ()
        known = max(memory.held.term.number, memory.race.number if memory.race.outcome else 0)
        number = memory.race.number if memory.race.open else known + 1
        expires = step + self.settings.expiry_steps
        race, effects = self.election.begin(memory.race, now, number, memory.sensed.key, expires)
        return replace(memory, race=race), effects

    def _off(self, memory: Memory) -> Step:
        """No election any more: a head is known."""
        if not memory.race.open:
            return memory, ()
        race, effects = self.election.stop(memory.race)
        return replace(memory, race=race), effects

    def contended(self, memory: Memory, now: int, message: Claim | JoinClaim, sender: str) -> Step:
        """Others contend. One that knows of a head says so; else the election goes on."""
        step = self.bank.step_at(memory.time.corrected(now))
        if isinstance(message, JoinClaim) and message.own < MOST_KEY and message.expires >= step:
            until = min(message.expires, step + self.settings.expiry_steps)
            memory = replace(memory, joined=memory.joined.set(sender, until))
        if self.led(memory, now):
            if isinstance(message, JoinClaim) and message.number == memory.held.term.number:
                return memory, ()
            return memory, self._told(memory, now, sender)
        if message.number <= memory.held.term.number:
            return memory, (Ignored("outdated"),)
        race, effects = self.election.hear(memory.race, now, message, sender, step)
        return replace(memory, race=race), effects

    def ring(self, memory: Memory, now: int, timer: str) -> Step:
        """A timer of the election; at its end one of them leads."""
        race, effects = self.election.ring(memory.race, now, timer)
        memory = replace(memory, race=race)
        if race.outcome == "joined":  # if the head is more than a hop away, it hears nothing of it
            return replace(memory, waits_ns=now + self.lease.timeout_ns), effects
        if race.outcome != "won" or self.led(memory, now):
            return memory, effects
        expires = self.bank.step_at(memory.time.corrected(now)) + self.settings.expiry_steps
        joined = memory.joined.update(dict.fromkeys(race.sensing, expires))
        after, more = self._elected(replace(memory, joined=joined), now, race.number)
        return after, (*effects, *more)

    def _elected(self, memory: Memory, now: int, number: int) -> Step:
        stored = stored_of(self.settings, self.bank, memory, now)
        beliefs, since = (stored.beliefs, stored.step) if stored else (None, 0)
        if beliefs is None and not memory.held.term.number and (prior := prior_beliefs(self.bank)):
            beliefs = unpack(prior).beliefs
        return self._lead(memory, now, number, beliefs, since, "elected")

    def _join(self, memory: Memory, now: int, poll: Poll) -> tuple[Effect, ...]:
        """One that senses the target tells the head so, once in a while: it may be asked to measure."""
        sensed, step = memory.sensed, self.bank.step_at(memory.time.corrected(now))
        told = memory.joined.get(self.settings.id, -1)
        if sensed.step != step or told > step:
            return ()
        return (SetTimer("join", now + self.settings.times.turn_ns * (1 + self.settings.number % 8)),)

    def join(self, memory: Memory, now: int) -> Step:
        """Its turn to tell."""
        step, (number, leader) = self.bank.step_at(memory.time.corrected(now)), memory.held.term
        if memory.leads is not None or not leader:
            return memory, ()
        expires = step + self.settings.expiry_steps
        message = JoinClaim(number, MOST_KEY, leader.encode(), memory.sensed.key, expires)
        return replace(memory, joined=memory.joined.set(self.settings.id, expires - 1)), (Send(message, leader),)

    # --- it leads ------------------------------------------------------------------------------------------------

    def handed(self, memory: Memory, now: int, message: HandOver, sender: str) -> Step:
        """A head hands over: this node leads, and acknowledges it; once more, if the first one was lost."""
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
        if not plausible(beliefs, self.bank.model):
            return memory, (Ignored("unusable belief"),)
        after, effects = self._lead(memory, now, message.number, beliefs, message.step, f"{sender} hands over")
        return after, (ack, *effects)

    def _lead(
        self,
        memory: Memory,
        now: int,
        number: int,
        beliefs: Mapping[str, Belief | None] | None,
        since: int,
        why: str,
    ) -> Step:
        """Lead with trackers that go on from beliefs after a step, to the last one that has begun; or from nothing."""
        if memory.leads is not None:
            memory, _ = self.leading.end(memory)
        until = max(self.bank.step_at(memory.time.corrected(now)), since, 0)
        points: list[TrackPoint] = []
        if beliefs is None:
            tracks = self.bank.begin(prior=False)
        else:
            resumed = self.bank.resume(beliefs, since, until)
            tracks, points = resumed.tracks, resumed.points if until > since else []
        memory, stops = self._off(replace(memory, polled=Polled()))
        after, effects = self.leading.begin(memory, now, number, Progress(tracks, Collected(until)), why)
        return after, (*stops, *(Publish(replace(one, term=number)) for one in points), *effects)
