"""Announcing where a node stands: rounds one after the other, and in each a turn for each node, by its number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trackfield.role import NEIGHBOURHOOD, Effect, Send, SetTimer
from trackfield.wire.clusters import Announce

TIMER: Final = "announce"


@dataclass(frozen=True)
class Announcing:
    """Node ``number`` of ``nodes`` at (``x_m``, ``y_m``) announces itself so often before ``announce_ns``."""

    number: int
    nodes: int
    announcements: int
    announce_ns: int
    x_m: float
    y_m: float

    def next(self, announced: int, now: int) -> SetTimer:
        """The timer of the next announcement, after so many that it ``announced``."""
        round_ns = self.announce_ns // self.announcements
        turn_ns = round_ns * self.number // (self.nodes + 1)
        return SetTimer(TIMER, max(now, announced * round_ns + turn_ns))

    def ring(self, announced: int, now: int) -> tuple[int, tuple[Effect, ...]]:
        """Announce itself once more; how often it did so then."""
        said = announced + 1
        here = Send(Announce(said, self.announcements, 0, self.x_m, self.y_m), NEIGHBOURHOOD)
        return said, (here, self.next(said, now)) if said < self.announcements else (here,)
