"""Any link with a maximum range."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.link.fate import FIELD, Fate, Link, lost
from trackfield.link.places import Places, distance_m


@dataclass(frozen=True, slots=True)
class Ranged:
    """``link`` up to ``range_m`` metres; a process whose place is not known is out of range."""

    link: Link
    places: Places
    range_m: float

    def fate(
        self,
        src: str,
        dst: str,
        kind: str,
        sent_ns: int,
        copy: int,
        size: int,
        broadcast: bool = False,
        medium: str = FIELD,
    ) -> Fate:
        """See ``Link.fate``; the sender spends the same energy for a lost frame."""
        fate = self.link.fate(src, dst, kind, sent_ns, copy, size, broadcast, medium)
        return fate if self._reaches(src, dst, sent_ns) else lost(fate, "radio")

    def reception(self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0) -> float:
        """See ``Link.reception``."""
        return self.link.reception(src, dst, size, kind, at_ns) if self._reaches(src, dst, at_ns) else 0.0

    def _reaches(self, src: str, dst: str, at_ns: int) -> bool:
        places = self.places
        return src in places and dst in places and distance_m(places, src, dst, at_ns) <= self.range_m
