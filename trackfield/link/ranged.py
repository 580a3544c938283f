"""Any link with an end: who is further away hears nothing."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist

from trackfield.link.fate import Fate, Link, Places, lost


@dataclass(frozen=True, slots=True)
class Ranged:
    """``link`` up to ``range_m`` metres; a process whose place is not known is out of range."""

    link: Link
    places: Places
    range_m: float

    def fate(self, src: str, dst: str, kind: str, sent_ns: int, copy: int, size: int, broadcast: bool = False) -> Fate:
        """See ``Link.fate``; what the sender spends is spent all the same."""
        fate = self.link.fate(src, dst, kind, sent_ns, copy, size, broadcast)
        return fate if self._reaches(src, dst) else lost(fate, "radio")

    def reception(self, src: str, dst: str, size: int) -> float:
        """See ``Link.reception``."""
        return self.link.reception(src, dst, size) if self._reaches(src, dst) else 0.0

    def _reaches(self, src: str, dst: str) -> bool:
        places = self.places
        return src in places and dst in places and dist(places[src], places[dst]) <= self.range_m
