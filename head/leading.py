"""What a master does while it leads: its trackers take each step, and it chooses who measures at the next, and leads.

Özfidan et al. (2018), section III-D. The leader asks the masters of other chosen slaves to wake them (``Merge``), and
gets one message with their reports of each of them (``Aggregate``). Another master leads from the moment at which it
has the belief: it acknowledges that, and only then does the old leader stop. Without an acknowledgement the old one
asks its second nominee, and goes on itself if that does not answer either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from head.beliefs import packed_beliefs
from head.memory import Asked, Known, Leadership, Memory, Offer, Wanted
from head.settings import Settings
from trackfield.filters.types import Gaussian
from trackfield.protocols.lease import Lease, Term
from trackfield.role import NEIGHBOURHOOD, CancelTimer, Effect, Ignored, Note, Publish, Send, SetTimer
from trackfield.tracking.bank import Bank
from trackfield.tracking.following import ANYWHERE
from trackfield.tracking.selection import Choice, Cluster, Grounds
from trackfield.tracking.steps import Progress, Steps
from trackfield.wire.clusters import Aggregate, HandOver, HandOverAck, LedTrack, Merge, Share
from trackfield.wire.codec import WireError, decode, encode
from trackfield.wire.listed import packed, unpacked

MOST_NOMINEES: Final = 2
"""To so many masters, nearer to the target than itself, a leader offers to hand over at a step."""
MOST_SILENT: Final = 3
"""A master that was asked and sent nothing for so many steps in a row is left alone for a while."""
NOTICES: Final = 3
"""How often a master that handed over says who leads now."""
MOST_NAMED: Final = 256
"""Of more reports the base is told that the first were used."""
LAST_STEP: Final = 65535

Step = tuple[Memory, tuple[Effect, ...]]


@dataclass(frozen=True)
class Leading:
    """The part of a master that leads; ``sensors`` are the ids of all in the field, in the order of their numbers."""

    settings: Settings
    bank: Bank
    steps: Steps
    lease: Lease
    sensors: Sequence[str]

    @cached_property
    def _numbers(self) -> Mapping[str, int]:
        return {id: number for number, id in enumerate(self.sensors)}

    # --- beginning and end ---------------------------------------------------------------------------------------

    def begin(self, memory: Memory, now: int, number: int, progress: Progress, why: str, dead: str = "") -> Step:
        """Lead from now on, with trackers that are so far; the coming step is the one after that.

        A master that is taken for ``dead`` is left alone for a while.
        """
        held, effects = self.lease.lead(memory.held, number)
        avoided = {dead: progress.step + self.settings.beacon_every} if dead else {}
        leads = Leadership(progress, Choice(self.settings.id, {}), avoided=avoided)
        after = replace(memory, held=held, leads=leads, notices=0)
        note = Note(f"{self.settings.id} leads in term {number}: {why}")
        after, more = self.choose(after, now, hands_over=False)
        return after, (*effects, note, *self.deadline(after), *more)

    def end(self, memory: Memory) -> Step:
        """Lead no more, as another one does: what was reported of steps that are not taken yet goes to that one."""
        leads, term = memory.leads, memory.held.term
        assert leads is not None
        effects: list[Effect] = [CancelTimer(self.steps.timer)]
        if leads.offer is not None:
            effects.append(CancelTimer("hand-over"))
        if term.leader in memory.rosters:
            ahead = leads.progress.collected.ahead
            effects += (
                Send(Aggregate(term.number, step, self.reports(ahead[step])), term.leader) for step in sorted(ahead)
            )
        return replace(memory, leads=None, wanted=Wanted(), notices=NOTICES), tuple(effects)

    def _resign(self, memory: Memory) -> Step:
        """The target is lost: the term is over, and nobody takes it over."""
        assert memory.leads is not None
        number, step = memory.held.term.number, memory.leads.progress.step
        over = Send(Share(number, step, b"", b""), NEIGHBOURHOOD)
        held, effects = self.lease.end(memory.held, number)
        after = replace(memory, held=held, leads=None, known=None, wanted=Wanted(), notices=NOTICES)
        return after, (over, *effects, Note(f"{self.settings.id} has lost the target, term {number} is over"))

    def deadline(self, memory: Memory) -> tuple[Effect, ...]:
        """The timer of the coming step, by its own clock."""
        assert memory.leads is not None
        if memory.leads.progress.step >= LAST_STEP:
            return ()
        timer = self.steps.deadline(memory.leads.progress)
        return (replace(timer, at=memory.time.local(timer.at)),)

    # --- a step --------------------------------------------------------------------------------------------------

    def fuse(self, memory: Memory, now: int) -> Step:
        """The deadline of a step: its reports are used, and the next one is planned."""
        leads = memory.leads
        assert leads is not None
        taken = self.steps.take(leads.progress, memory.time.corrected(now))
        number, first = memory.held.term.number, next(iter(taken.points.values()))
        blind = leads.blind + 1 if first.status == "waiting" else 0
        asked = {id: replace(one, silent=0 if id in leads.came else one.silent + 1) for id, one in leads.asked.items()}
        leads = replace(leads, progress=taken.state, blind=blind, asked=asked, came=frozenset())
        after = replace(memory, leads=leads)
        published = tuple(Publish(replace(point, term=number)) for point in taken.all)
        if blind >= self.settings.beacon_every:
            after, effects = self._resign(after)
            return after, (*published, *effects)
        after, effects = self.choose(after, now, hands_over=True)
        after, told = self._told(after, first.sensors)
        return after, (*published, *effects, *told, *self.deadline(after))

    def _told(self, memory: Memory, used: Sequence[str]) -> Step:
        """Tell those in reach and the base what is known, at the steps at which they are told."""
        leads, settings = memory.leads, self.settings
        assert leads is not None
        number, step, effects = memory.held.term.number, leads.progress.step, list[Effect]()
        gaussian = packed_beliefs(step, self.bank.beliefs(leads.progress.tracks), particles=False)
        if step % settings.share_every == 0:
            heir = self._heir(memory)
            memory = replace(memory, known=Known(step, gaussian, heir))
            effects.append(Send(Share(number, step, heir.encode(), gaussian), NEIGHBOURHOOD))
        if step % settings.base_every == 1 % settings.base_every:
            named = packed(self._numbers[id] for id in used[:MOST_NAMED])
            effects.append(Send(LedTrack(number, step, named, gaussian), settings.base))
        return memory, tuple(effects)

    def _heir(self, memory: Memory) -> str:
        """Who takes over if this master dies: the nearest other one in reach."""
        assert memory.leads is not None
        known = self.bank.ahead(memory.leads.progress.tracks)
        if known is None or not memory.rosters:
            return ""
        x, y = known[1].mean[:2].tolist()
        return min(self.settings.away(id, x, y) for id in memory.rosters)[1]

    # --- the choice ----------------------------------------------------------------------------------------------

    def choose(self, memory: Memory, now: int, *, hands_over: bool) -> Step:
        """Choose who measures at the coming step, and who leads; then ask for it."""
        leads = memory.leads
        assert leads is not None
        choice, order = self._chosen(memory, leads)
        if hands_over and choice.leader != self.settings.id:
            nearer = order[: order.index(self.settings.id)]  # others would only hand it on
            nominees = tuple(dict.fromkeys((choice.leader, *nearer)))[:MOST_NOMINEES]
            offer = Offer(memory.held.term.number + 1, nominees)
            return self._offer(replace(memory, leads=replace(leads, offer=offer)), now)
        return self._ask(replace(memory, leads=replace(leads, choice=choice)), now)

    def _chosen(self, memory: Memory, leads: Leadership) -> tuple[Choice, list[str]]:
        """The policy's choice among the masters in reach, and these by their distance from the target."""
        me, step = self.settings.id, leads.progress.step
        lists = {**memory.rosters, me: memory.members.ids}
        known = self.bank.ahead(leads.progress.tracks)
        if known is None:  # it looks for a target around itself
            x, y = self.settings.places[me]
            now = ahead = Gaussian(np.array([x, y, 0.0, 0.0]), ANYWHERE)
        else:
            now, ahead = known
        clusters = [
            Cluster(id, (x, y), lists[id])
            for id, x, y in self.settings.masters
            if id in lists and leads.avoided.get(id, -1) <= step
        ]
        grounds = Grounds(clusters, now.mean, ahead, self.bank.positions, self.bank.information, me)
        choice = self.settings.chooses.choose(grounds)
        return choice if known else Choice(me, choice.sensors), [one.id for one in grounds.by_distance()]

    # --- others measure ------------------------------------------------------------------------------------------

    def _ask(self, memory: Memory, now: int) -> Step:
        """Ask for the choice: its own slaves by the next beacon, those of others by their masters."""
        leads, settings = memory.leads, self.settings
        assert leads is not None
        step, number = leads.progress.step + 1, memory.held.term.number
        last = step + settings.beacon_every - 1
        own = leads.choice.sensors.get(settings.id, ())[: settings.times.slots]
        slot, asked, avoided, effects = len(own), dict[str, Asked](), dict(leads.avoided), list[Effect]()
        for id, sensors in leads.choice.sensors.items():
            if id == settings.id or slot + len(sensors) + settings.times.gather_slots > settings.times.slots:
                continue
            before = leads.asked.get(id)
            if before is not None and before.silent >= MOST_SILENT:
                avoided[id] = step + settings.beacon_every
                continue
            wanted = Wanted(settings.id, sensors, slot, last)
            slot += len(sensors) + settings.times.gather_slots
            if before is None or not before.wanted.same(wanted) or before.silent or before.wanted.last <= step:
                effects.append(Send(self._merge(number, step, wanted), id))
                asked[id] = Asked(wanted, before.silent if before else 0)
            else:
                asked[id] = before
        for id, before in leads.asked.items():
            if id not in asked and before.wanted.last >= step:
                effects.append(Send(Merge(number, step, 0, 0, b""), id))
        leads = replace(leads, asked=asked, avoided={id: to for id, to in avoided.items() if to > step})
        return replace(memory, leads=leads, wanted=Wanted(settings.id, own, 0, last)), tuple(effects)

    def _merge(self, number: int, step: int, wanted: Wanted) -> Merge:
        numbers = self._numbers
        sensors = packed(numbers[id] for id in wanted.sensors)
        return Merge(number, step, self.settings.beacon_every, wanted.slot, sensors)

    def reports(self, heard: Mapping[str, Any]) -> bytes:
        """Reports by sensor as bytes; see ``Aggregate``."""
        each = ((self._numbers[id], encode(report)) for id, report in sorted(heard.items()))
        return b"".join(packed([number]) + bytes([len(data)]) + data for number, data in each)

    def read(self, data: bytes) -> dict[str, Any]:
        """The inverse of ``reports``. Raises ``WireError``."""
        found, at = dict[str, Any](), 0
        while at < len(data):
            end = at + 3 + (data[at + 2] if at + 2 < len(data) else len(data))
            ids = unpacked(data[at : at + 2], self.sensors)
            if end > len(data) or ids is None:
                raise WireError("malformed", "not a list of reports")
            found[ids[0]] = decode(data[at + 3 : end])
            at = end
        return found

    # --- another one leads ---------------------------------------------------------------------------------------

    def _offer(self, memory: Memory, now: int) -> Step:
        """Offer to hand over to the first of the nominees."""
        leads = memory.leads
        assert leads is not None
        assert leads.offer is not None
        beliefs = self.bank.beliefs(leads.progress.tracks)
        data = packed_beliefs(leads.progress.step, beliefs, particles=self.settings.particles)
        message = HandOver(leads.offer.number, leads.progress.step, data)
        wait = SetTimer("hand-over", now + self.settings.times.handover_ns)
        return memory, (Send(message, leads.offer.nominees[0]), wait)

    def unanswered(self, memory: Memory, now: int) -> Step:
        """A nominee did not acknowledge: the next one is asked, in a term of its own, or it goes on itself."""
        leads = memory.leads
        if leads is None or leads.offer is None:
            return memory, ()
        (silent, *others), step = leads.offer.nominees, leads.progress.step
        avoided = {**leads.avoided, silent: step + self.settings.beacon_every}
        note = Note(f"{silent} does not acknowledge term {leads.offer.number}")
        number, leads = leads.offer.number, replace(leads, avoided=avoided)
        if others:
            offer = Offer(number + 1, tuple(others))
            after, effects = self._offer(replace(memory, leads=replace(leads, offer=offer)), now)
            return after, (note, *effects)
        after, effects = self.choose(replace(memory, leads=replace(leads, offer=None)), now, hands_over=False)
        return after, (note, *effects)

    def acknowledged(self, memory: Memory, now: int, ack: HandOverAck, sender: str) -> Step:
        """The nominee leads."""
        offer = memory.leads.offer if memory.leads is not None else None
        if offer is None or (ack.number, sender) != (offer.number, offer.nominees[0]):
            return memory, (Ignored("outdated"),)
        held, effects = self.lease.follow(memory.held, now, Term(ack.number, sender))
        after, more = self.end(replace(memory, held=held))
        return after, (*effects, *more, Note(f"handed over to {sender}, term {ack.number}"))
