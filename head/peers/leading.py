"""What a header does while it leads: it polls sensors, takes each step, says what it knows, and hands over.

Yu et al. (2009), section 4: the sensors nearest to where the target will be measure, and one of them leads. Zhou et al.
(2011), section II: the head picks three of those that joined it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from immutables import Map

from head.beliefs import packed_beliefs
from head.peers import choice
from head.peers.local import Local
from head.peers.memory import Known, Leadership, Memory, Offer
from head.peers.settings import Settings
from trackfield.filters.belief import moments
from trackfield.protocols.lease import Lease, Term
from trackfield.role import (
    NEIGHBOURHOOD,
    CancelTimer,
    Effect,
    Ignored,
    Note,
    Publish,
    Send,
    SetTimer,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.plausible import MOST_M, MOST_M_S, plausible
from trackfield.tracking.steps import Progress, Steps, Taken
from trackfield.tracking.stored import pack, unpack
from trackfield.wire.clusters import HandOver, HandOverAck, NoTarget
from trackfield.wire.listed import packed
from trackfield.wire.peers import Dissolve, HeadEstimate, LocalEstimate, Poll, Result

LAST_STEP: Final = 65535

Step = tuple[Memory, tuple[Effect, ...]]


@dataclass(frozen=True)
class Leading:
    """The part of a header that leads."""

    settings: Settings
    bank: Bank
    steps: Steps
    lease: Lease
    local: Local | None = None

    # --- beginning and end ---------------------------------------------------------------------------------------

    def begin(self, memory: Memory, now: int, number: int, progress: Progress, why: str) -> Step:
        """Lead from now on, with trackers that are so far; the coming step is the one after that."""
        held, effects = self.lease.lead(memory.held, number)
        after = self.chosen(replace(memory, held=held, leads=Leadership(progress)))
        note = Note(f"{self.settings.id} leads in term {number}: {why}")
        return after, (*effects, CancelTimer("word"), note, *self.timers(after))

    def end(self, memory: Memory) -> Step:
        """Lead no more."""
        effects = (CancelTimer(self.steps.timer), CancelTimer("window"), CancelTimer("hand-over"))
        return replace(memory, leads=None), effects

    def resign(self, memory: Memory, *, lost: bool, why: str) -> Step:
        """The term is over, and everybody is told."""
        assert memory.leads is not None
        number, step = memory.held.term.number, memory.leads.progress.step
        held, effects = self.lease.end(memory.held, number)
        after, more = self.end(replace(memory, held=held, known=None if lost else memory.known))
        note = Note(f"{self.settings.id} {why}, term {number} is over")
        over, again_ns = Dissolve(number, step, int(lost)), self.bank.at_ns(step) + self.settings.times.beacon_ns
        again = SetTimer("over", memory.time.local(again_ns))
        return replace(after, over=over), (Send(over, NEIGHBOURHOOD), *effects, *more, again, note)

    def again(self, memory: Memory, now: int) -> Step:
        """Say that the term is over to those, too, that listen in windows only; unless there is another one."""
        over, after = memory.over, replace(memory, over=None)
        if over is None or memory.held.term.number > over.number:
            return after, ()
        return after, (Send(over, NEIGHBOURHOOD, preamble_ns=self.settings.times.preamble_ns),)

    def timers(self, memory: Memory) -> tuple[Effect, ...]:
        """Those of the coming step, by its own clock: its poll, and its deadline."""
        assert memory.leads is not None
        step, time = memory.leads.progress.step, memory.time
        if step >= LAST_STEP:
            return ()
        deadline = self.steps.deadline(memory.leads.progress)
        polls_ns = self.bank.at_ns(step) + self.settings.times.beacon_ns
        return (
            replace(deadline, at=time.local(deadline.at)),
            SetTimer("window", time.local(polls_ns)),
        )

    # --- a step --------------------------------------------------------------------------------------------------

    def poll(self, memory: Memory, now: int) -> Step:
        """Have the chosen sensors measure at the coming step, unless it has begun."""
        leads = memory.leads
        if leads is None:
            return memory, ()
        step = leads.progress.step + 1
        if memory.time.corrected(now) >= self.bank.at_ns(step):
            return memory, ()
        sensors = packed(self.settings.numbers[id] for id in leads.chosen)
        message = Poll(memory.held.term.number, step, sensors)
        after = replace(
            memory, leads=replace(leads, asked=leads.chosen, came=frozenset(), deaf=frozenset(), concluded=Map())
        )
        broadcast = Send(message, NEIGHBOURHOOD, preamble_ns=self.settings.times.preamble_ns)
        again: tuple[Send, ...] = ()
        if self.local is not None and memory.known is not None:  # what they conclude begins with that
            estimate = HeadEstimate(message.number, memory.known.step, memory.known.beliefs)
            again = (Send(estimate, NEIGHBOURHOOD),)
        return after, (broadcast, *again, Send(message, self.settings.id))  # an older poll of its own member is over

    def collect(self, memory: Memory, now: int, report: Any, sender: str) -> Step:
        """A report of a polled sensor."""
        leads = memory.leads
        assert leads is not None
        if sender not in leads.asked and report.step != leads.progress.step + 1:
            return memory, (Ignored("not asked"),)
        at = memory.time.corrected(now)
        progress, effects = self.steps.collect(leads.progress, at, report.step, report, sender=sender)
        came = leads.came | {sender} if report.step == leads.progress.step + 1 else leads.came
        return replace(memory, leads=replace(leads, progress=progress, came=came)), effects

    def answered(self, memory: Memory, now: int, message: NoTarget, sender: str) -> Step:
        """A polled sensor senses no target."""
        leads = memory.leads
        if leads is None or sender not in leads.asked:
            return memory, (Ignored("not asked"),)
        joined = memory.joined.delete(sender) if sender in memory.joined else memory.joined
        return replace(memory, joined=joined, leads=replace(leads, deaf=leads.deaf | {sender})), ()

    def concluded(self, memory: Memory, now: int, message: LocalEstimate, sender: str) -> Step:
        """What a polled sensor concludes from the last estimate and its reading, or what one that yields knows."""
        leads = memory.leads
        if leads is not None and all(one is None for one in self.bank.beliefs(leads.progress.tracks).values()):
            return self._given(memory, leads, message)
        if self.local is None or leads is None or message.step != leads.progress.step + 1:
            return memory, (Ignored("not asked"),)
        heard = leads.concluded.set(sender, message.beliefs)
        return replace(memory, leads=replace(leads, concluded=heard, came=leads.came | {sender})), ()

    def _given(self, memory: Memory, leads: Leadership, message: LocalEstimate) -> Step:
        """A head that has no track goes on with what another one knows, if that is not old."""
        progress = leads.progress
        try:
            beliefs = unpack(message.beliefs).beliefs
        except ValueError:
            return memory, (Ignored("unusable belief"),)
        fresh = 0 <= progress.step - message.step <= self.settings.expiry_steps
        if not fresh or message.number != memory.held.term.number or not plausible(beliefs, self.bank.model):
            return memory, (Ignored("unusable belief"),)
        tracks = self.bank.resume(beliefs, message.step, progress.step).tracks
        return self.chosen(replace(memory, leads=replace(leads, progress=replace(progress, tracks=tracks)))), ()

    def fuse(self, memory: Memory, now: int) -> Step:
        """The deadline of a step: its reports are used, and the next one is planned."""
        leads = memory.leads
        assert leads is not None
        taken = self._taken(leads, memory.time.corrected(now))
        number, first = memory.held.term.number, next(iter(taken.points.values()))
        silent = 0 if first.sensors else leads.silent + 1
        blind = leads.blind + 1 if first.status == "waiting" else 0
        leads = replace(leads, progress=taken.state, silent=silent, blind=blind)
        missing, avoided = choice.missed(leads)
        after = replace(memory, leads=replace(leads, missing=missing, avoided=avoided))
        published = tuple(Publish(replace(point, term=number)) for point in taken.all)
        if max(silent, blind) >= self.settings.silent_steps:
            after, effects = self.resign(after, lost=True, why="has lost the target")
            return after, (*published, *effects)
        after = self.chosen(after)
        after, told = self._tell(after)
        after, offered = self._hand_over(after, now)
        return after, (*published, *told, *self._log(after), *offered, *self.timers(after))

    def _taken(self, leads: Leadership, at_ns: int) -> Taken:
        """The next step, by what members concluded if they filter, or else by reports."""
        taken = None if self.local is None else self.local.take(leads)
        return taken or self.steps.take(leads.progress, at_ns)

    def chosen(self, memory: Memory) -> Memory:
        """With the sensors that measure at the coming step."""
        leads = memory.leads
        assert leads is not None
        return replace(memory, leads=replace(leads, chosen=choice.chosen(self.settings, self.bank, memory, leads)))

    def _log(self, memory: Memory) -> tuple[Effect, ...]:
        assert memory.leads is not None
        beyond = choice.unreached(self.settings, self.bank, memory.leads)
        return (Note(choice.OUT_OF_REACH + ", ".join(beyond)),) if beyond else ()

    # --- what others are told ------------------------------------------------------------------------------------

    def word(self, memory: Memory) -> tuple[Memory, Send]:
        """What it tells those in reach: where the target is, or all that its trackers know."""
        assert memory.leads is not None
        number, progress = memory.held.term.number, memory.leads.progress
        beliefs = self.bank.beliefs(progress.tracks)
        gaussian = packed_beliefs(progress.step, beliefs)
        memory = replace(memory, known=Known(progress.step, gaussian))
        first = next(iter(beliefs.values()))
        if not self.settings.short or first is None:
            return memory, Send(HeadEstimate(number, progress.step, gaussian), NEIGHBOURHOOD)
        mean, covariance = moments(first)
        sds = np.sqrt(np.diagonal(covariance)[:4])
        limits = np.array([MOST_M, MOST_M, MOST_M_S, MOST_M_S])
        x, y, vx, vy = (float(value) for value in np.clip(mean[:4], -limits, limits))
        sd, speed_sd = float(np.hypot(*sds[:2])) / 2**0.5, float(np.hypot(*sds[2:4])) / 2**0.5
        result = Result(number, progress.step, x, y, vx, vy, min(sd, 6553.5), min(speed_sd, 655.35))
        return memory, Send(result, NEIGHBOURHOOD)

    def _tell(self, memory: Memory) -> Step:
        """Tell those in reach at each step, and a base over the tree at the steps at which it is told."""
        memory, word = self.word(memory)
        assert memory.leads is not None
        settings, step = self.settings, memory.leads.progress.step
        due = settings.base and step % settings.base_every == 1 % settings.base_every
        return memory, (word, replace(word, to=settings.base)) if due else (word,)

    # --- another one leads ---------------------------------------------------------------------------------------

    def _hand_over(self, memory: Memory, now: int) -> Step:
        """Offer to hand over, if another one should lead."""
        leads = memory.leads
        assert leads is not None
        found = choice.nominees(self.settings, self.bank, memory, leads)
        if not found or leads.offer is not None:
            return memory, ()
        offer = Offer(memory.held.term.number + 1, tuple(found))
        return self._offer(replace(memory, leads=replace(leads, offer=offer)), now)

    def _offer(self, memory: Memory, now: int) -> Step:
        leads = memory.leads
        assert leads is not None
        assert leads.offer is not None
        particles, modes = self.settings.hands == "particles", self.settings.hands == "modes"
        step, beliefs = leads.progress.step, self.bank.beliefs(leads.progress.tracks)
        data = packed_beliefs(step, beliefs, particles=particles, modes=modes)
        wait = SetTimer("hand-over", now + self.settings.times.handover_ns)
        return memory, (Send(HandOver(leads.offer.number, step, data), leads.offer.nominees[0]), wait)

    def unanswered(self, memory: Memory, now: int) -> Step:
        """A nominee did not acknowledge: the next one is asked. If none does, it goes on, or an election follows."""
        leads = memory.leads
        if leads is None or leads.offer is None:
            return memory, ()
        number, (silent, *others), step = leads.offer.number, leads.offer.nominees, leads.progress.step
        note = Note(f"{silent} does not acknowledge term {number}")
        leads = replace(leads, avoided={**leads.avoided, silent: step + choice.PAUSE})
        if others:
            offer = Offer(number + 1, tuple(others))
            after, effects = self._offer(replace(memory, leads=replace(leads, offer=offer)), now)
            return after, (note, *effects)
        after = self.chosen(replace(memory, leads=replace(leads, offer=None)))
        if self.settings.takes_over:
            return after, (note,)
        after, effects = self.resign(after, lost=False, why="found nobody to hand over to")
        return after, (note, *effects)

    def acknowledged(self, memory: Memory, now: int, ack: HandOverAck, sender: str) -> Step:
        """The nominee leads."""
        offer = memory.leads.offer if memory.leads is not None else None
        if offer is None or (ack.number, sender) != (offer.number, offer.nominees[0]):
            return memory, (Ignored("outdated"),)
        held, effects = self.lease.follow(memory.held, now, Term(ack.number, sender))
        after, more = self.end(replace(memory, held=held, joined=untold(memory.joined, self.settings.id)))
        return after, (*effects, *more, Note(f"handed over to {sender}, term {ack.number}"))


def untold(joined: Map[str, int], id: str) -> Map[str, int]:
    """Who senses the target, with this node as one that has not told its head so: that is a new one."""
    return joined.delete(id) if id in joined else joined


def prior_beliefs(bank: Bank) -> bytes | None:
    """What is known of the target before the first step, if anything is."""
    return None if bank.prior is None else pack(0, None, dict.fromkeys(bank.trackers, bank.prior))
