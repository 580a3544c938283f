"""What a master does with its slaves: it wakes those that are wanted, by beacons, and collects what they report.

While its slaves measure for a leader that is another master, it sends that one message in each step with all that they
reported, at the end of their slots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

from immutables import Map

from head.leading import LAST_STEP, Leading
from head.memory import Memory, Wanted
from trackfield.protocols.association.admitting import Admitting
from trackfield.role import NEIGHBOURHOOD, CancelTimer, Effect, Send, SetTimer
from trackfield.tracking.bank import Bank
from trackfield.wire.clusters import CYCLE, Aggregate, NoTarget, Wake

RECENT: Final = 3
"""For so many steps back reports are kept."""

Step = tuple[Memory, tuple[Effect, ...]]


@dataclass(frozen=True)
class Helping:
    """The part of a master that wakes slaves and hears them."""

    bank: Bank
    admitting: Admitting
    leading: Leading

    # --- beacons -------------------------------------------------------------------------------------------------

    def watch(self, memory: Memory, now: int) -> tuple[SetTimer, ...]:
        """The timer of the next beacon, if there may be something to say by then."""
        if not (memory.leads or memory.wanted.sensors or memory.told.sensors or memory.notices):
            return ()
        beacon_ns, at = self.leading.settings.times.beacon_ns, memory.time.corrected(now)
        step = max(self.bank.step_at(at - beacon_ns) + 1, 0)
        if step >= LAST_STEP:
            return ()
        return (SetTimer("window", memory.time.local(self.bank.at_ns(step) + beacon_ns)),)

    def beacon(self, memory: Memory, now: int) -> Step:
        """Wake those that are wanted at the coming step, if that was not said, or it cannot be known that it is heard.

        A leader says so at every step: others hear by that that it is alive.
        """
        step = self.bank.step_at(memory.time.corrected(now)) + 1
        wanted = memory.wanted if memory.wanted.last >= step else Wanted()
        listed = memory.members.list
        silent = any(listed[id].silent for id in wanted.sensors if id in listed)
        changed = not wanted.same(memory.told) if wanted.sensors else memory.told.last >= step
        due = bool(wanted.sensors) and memory.told.last <= step
        memory = replace(memory, wanted=wanted)
        if not (memory.leads or memory.notices or silent or changed or due):
            return memory, self.watch(memory, now)
        steps = min(self.leading.settings.beacon_every, wanted.last - step + 1) if wanted.sensors else 0
        wake = self._wake(memory, step, steps, wanted)
        told = replace(wanted, last=step + steps - 1) if wanted.sensors else Wanted()
        after = replace(memory, told=told, notices=max(memory.notices - 1, 0))
        send = Send(wake, NEIGHBOURHOOD, preamble_ns=self.leading.settings.times.preamble_ns)
        return after, (send, *self.watch(after, now))

    def _wake(self, memory: Memory, step: int, steps: int, wanted: Wanted) -> Wake:
        number, leader = memory.held.term
        listed = memory.members.list
        places = bytes(listed[id].place for id in wanted.sensors if id in listed)
        return Wake(number, leader.encode(), step, steps if places else 0, wanted.slot, places)

    # --- for another leader --------------------------------------------------------------------------------------

    def ask(self, memory: Memory, now: int, wanted: Wanted, step: int) -> Step:
        """A leader wants these slaves to measure from this step on; none: no more."""
        after = replace(memory, wanted=wanted)
        gather = self._gather(after, step) if wanted.sensors else (CancelTimer("gather"),)
        return after, (*gather, *self.watch(after, now))

    def _gather(self, memory: Memory, step: int) -> tuple[SetTimer, ...]:
        """The timer of the message to the leader about this step."""
        wanted, times = memory.wanted, self.leading.settings.times
        over_ns = (wanted.slot + len(wanted.sensors)) * times.slot_ns + times.late_ns
        return (SetTimer("gather", memory.time.local(self.bank.at_ns(step) + over_ns)),)

    def gather(self, memory: Memory, now: int) -> Step:
        """Send the leader what the slaves reported of this step; those that were silent for too long have left."""
        step, wanted = self.bank.step_at(memory.time.corrected(now)), memory.wanted
        if memory.leads or not wanted.sensors:
            return memory, ()
        heard = memory.heard.get(step, Map())
        mine = {id: heard[id] for id in wanted.sensors if id in heard}
        report = Send(Aggregate(memory.held.term.number, step, self.leading.reports(mine)), wanted.leader)
        after, effects = self.judge(memory, now, step)
        more = self._gather(after, step + 1) if LAST_STEP > step < wanted.last else ()
        return after, (report, *effects, *more)

    def again(self, memory: Memory, now: int) -> tuple[Effect, ...]:
        """Its timers, after the clock was set."""
        if memory.leads or not memory.wanted.sensors:
            return self.watch(memory, now)
        step = max(self.bank.step_at(memory.time.corrected(now)) + 1, 0)
        return (*self._gather(memory, step), *self.watch(memory, now))

    # --- reports -------------------------------------------------------------------------------------------------

    def judge(self, memory: Memory, now: int, step: int) -> Step:
        """Who was told to report at this step, and did not?"""
        heard = memory.heard.get(step, Map())
        members, effects = self.admitting.judged(memory.members, now, memory.told.at(step), heard)
        return replace(memory, members=members), effects

    def step_of(self, memory: Memory, now: int, report: Any) -> int:
        """The step of a report; of one that senses no target the latest with its remainder."""
        if not isinstance(report, NoTarget):
            return int(report.step)
        latest = self.bank.step_at(memory.time.corrected(now))
        return latest - (latest - report.step) % CYCLE

    def keep(self, memory: Memory, now: int, step: int, report: Any, sender: str) -> Memory | None:
        """Keep a member's report of a step; None: the step is not of now, or it is there already."""
        latest = self.bank.step_at(memory.time.corrected(now))
        heard = memory.heard.get(step, Map())
        if not latest - RECENT < step <= latest + 1 or sender in heard:
            return None
        kept = memory.heard.set(step, heard.set(sender, report))
        for old in [one for one in kept if one <= latest - RECENT]:
            kept = kept.delete(old)
        members = self.admitting.heard(memory.members, now, sender)
        return replace(memory, heard=kept, members=members)
