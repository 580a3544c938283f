"""How masters set their clocks: each asks a neighbour that is nearer to the base, whose clock is the reference.

So the strata of the clocks (``trackfield/protocols/timesync.py``) go from the base outwards, hop by hop. Neighbours are
those of whose announcements at least half were heard. One that does not answer is replaced by the next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import hypot
from typing import Any

from head.memory import Memory
from head.settings import Settings
from trackfield.protocols.timesync import Phase, Rounds, TimeSync
from trackfield.role import ClockSet, Corrected, Effect, Ignored, Received, Started, Timer
from trackfield.wire.clusters import Announce

Step = tuple[Memory, tuple[Effect, ...]]


@dataclass(frozen=True)
class Timing:
    """The part of a master that keeps the time; ``sync`` are the fields of its ``Rounds``, None: its clock is right."""

    settings: Settings
    sync: Mapping[str, Any] | None
    announcements: int

    @property
    def kinds(self) -> frozenset[str]:
        """The messages that it takes."""
        return TimeSync.of(self.sync).kinds

    def _with(self, memory: Memory) -> TimeSync:
        if self.sync is None:
            return TimeSync()
        return TimeSync(Rounds(**{**self.sync, "reference": (memory.references or (self.settings.base,))[0]}))

    def start(self, memory: Memory, now: int) -> Step:
        """Begin to ask, when the announcements are over; a clock that is right only tells."""
        if self.sync is not None and not memory.references:
            memory = replace(memory, references=self._references(memory))
        time, effects = self._with(memory).handle(memory.time, Started(now))
        return replace(memory, time=time), effects

    def hear(self, memory: Memory, message: Announce, sender: str) -> Memory:
        """A neighbour announces itself."""
        return replace(memory, near={**memory.near, sender: memory.near.get(sender, 0) + (message.of > 0)})

    def handle(self, memory: Memory, event: Received | Timer | ClockSet) -> Step:
        """Ask for the time, or tell it. After a round without an answer the next neighbour is asked."""
        if memory.time.phase is Phase.NEW:
            return memory, (Ignored("not synchronised"),) if isinstance(event, Received) else ()
        time, effects = self._with(memory).handle(memory.time, event)
        ended = memory.time.in_round and not time.in_round
        if ended and not any(isinstance(effect, Corrected) for effect in effects):
            first, *others = memory.references or (self.settings.base,)
            memory = replace(memory, references=(*others, first))
        return replace(memory, time=time), effects

    def _references(self, memory: Memory) -> tuple[str, ...]:
        """Neighbours by their distance from the base, first those that are nearer to it than this master."""
        bx, by = self.settings.base_x_m, self.settings.base_y_m
        away = {id: hypot(x - bx, y - by) for id, (x, y) in self.settings.places.items()} | {self.settings.base: 0.0}
        good = [id for id, heard in memory.near.items() if 2 * heard >= self.announcements and id in away]
        own = away[self.settings.id]
        return tuple(sorted(good, key=lambda id: (away[id] >= own, away[id], id)))
