"""Clusters that stay as they are: the first node of the group leads, and the next takes over if it is silent.

A head is known by its interest in passes, which it renews. A node that missed two refreshes, and waited for those
before it in the group, leads itself. A head that comes back follows, as the other one does well; of two that lead at a
time, such as after a partition, the earlier one in the group goes on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from head.hearing.choice import EVENT_NS
from head.hearing.leading import Leading
from head.hearing.memory import Memory, Pass, Step
from head.hearing.settings import Settings
from trackfield.role import NS, SetTimer
from trackfield.wire.interests import Interest

LEAD: Final = "lead"
LATE_NS: Final = 2 * NS
"""A report is with its head so long after the pass, at most: a second until it is known, then its way."""


@dataclass(frozen=True)
class Fixed:
    """The part of the head's half that settles who leads."""

    settings: Settings
    leading: Leading

    @property
    def rank(self) -> int:
        """Its place in the group."""
        rank = self.settings.rank(self.settings.id)
        assert rank is not None
        return rank

    def start(self, memory: Memory, now: int) -> Step:
        """At the start of a field the first one leads; later everybody listens first."""
        begin_ns = self.leading.bank.origin_ns
        if now >= begin_ns:
            return memory, (self._waits(now),)
        return memory, (SetTimer(LEAD, begin_ns) if self.rank == 0 else self._waits(begin_ns),)

    def _waits(self, since_ns: int) -> SetTimer:
        """The timer by which it leads, unless it hears of a head."""
        turn_ns = (self.rank + 1) * self.settings.times.turn_ns
        return SetTimer(LEAD, since_ns + self.settings.lapse_ns + turn_ns)

    def interest(self, memory: Memory, now: int, message: Interest, sink: str) -> Step:
        """Another node leads."""
        rank = self.settings.rank(sink)
        if rank is None:
            return memory, ()
        memory = replace(memory, heard_ns=now)
        if memory.leads is None:
            return memory, (self._waits(now),)
        if rank > self.rank:
            return memory, ()
        after, effects = self.leading.end(memory, f"{sink} does")
        return after, (*effects, self._waits(now))

    def passed(self, memory: Memory, now: int, one: Pass) -> Step:
        """A report came; who does not lead has no use for it."""
        return memory, ()

    def due(self, memory: Memory, now: int) -> Step:
        """Nobody else leads."""
        if memory.leads is not None:
            return memory, ()
        return self.leading.begin(memory, now, "nobody else of its cluster does")

    def gathered(self, memory: Memory, now: int) -> Step:
        """The last reports are used, unless the head before must have told of their event."""
        return self.leading.gathered(memory, now, self._untold(memory), "reports")

    def _untold(self, memory: Memory) -> list[Pass]:
        """The reports of events that were not over, or not for long, when another head was heard last."""
        events = list[list[Pass]]()
        for one in sorted(memory.passes, key=lambda one: one.at_ns):
            if events and one.at_ns - events[-1][-1].at_ns <= EVENT_NS:
                events[-1].append(one)
            else:
                events.append([one])
        if memory.heard_ns is not None:
            since_ns = memory.time.corrected(memory.heard_ns) - self.settings.times.close_ns - LATE_NS
            events = [event for event in events if event[-1].at_ns >= since_ns]
        return [one for event in events for one in event]

    def fused(self, memory: Memory) -> Step:
        """After a step: the head of a fixed cluster goes on."""
        return memory, ()
