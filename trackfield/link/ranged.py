"""Any link with a maximum range."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

from trackfield.link.fate import FIELD, Fate, Link, Transmission, lost
from trackfield.link.places import Places, distance_m, moves


@dataclass(frozen=True, slots=True)
class Ranged:
    """``link`` up to ``range_m`` metres; a process whose place is not known is out of range."""

    link: Link
    places: Places
    range_m: float
    # Of links whose ends do not move, by sender.
    _known: defaultdict[str, dict[str, bool]] = field(
        default_factory=lambda: defaultdict(dict), init=False, repr=False, compare=False
    )

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``; the sender spends the same energy for a lost frame."""
        fate = self.link.fate(frame)
        return fate if self.reaches(frame.src, frame.dst, frame.sent_ns) else lost(fate, "radio")

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return self.link.reception(src, dst, size, kind, at_ns, medium) if self.reaches(src, dst, at_ns) else 0.0

    def reaches(self, src: str, dst: str, at_ns: int) -> bool:
        """Whether they are near enough at an instant."""
        known = self._known[src]
        if dst in known:
            return known[dst]
        places = self.places
        if src not in places or dst not in places:
            return False
        near = distance_m(places, src, dst, at_ns) <= self.range_m
        if not (moves(places[src]) or moves(places[dst])):
            known[dst] = near
        return near
