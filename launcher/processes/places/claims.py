"""Offers the places of a run to processes that are started elsewhere.

An offer keeps no place: many processes may be offered the same one, and the first to be seen alive there has it. So
whoever only asks takes nothing, and what is remembered does not grow with the number of questions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

GRACE_S: Final = 10.0
"""How long a place is kept for a host whose process is gone."""
OFFERED_S: Final = 10.0
"""How long other places are offered first, while one that was offered has no process yet."""


@dataclass(frozen=True, slots=True)
class Holder:
    """The process that has or had a place, and its ``host``, if known; ``since`` is when it came or went (s)."""

    host: str | None
    since: float
    live: bool = True

    def yields_to(self, host: str, now: float) -> bool:
        """Whether a process on this host may have the place."""
        return not self.live and (host == self.host or now - self.since > GRACE_S)


class Claims:
    """Offers places: a host gets its own back, then come free ones, then abandoned ones.

    ``places`` has the role of each, in the order in which they are offered. Times are seconds of any one clock.
    """

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = dict(places)
        self._holders: dict[str, Holder] = {}
        self._offered: dict[str, float] = {}

    def offer(self, role: str, host: str, now: float, wanted: str = "") -> str | None:
        """A place of this role for a process on this host: the ``wanted`` one, if any. None if all are taken.

        Raises ``LookupError`` if there is no such role, or no such place of it.
        """
        places = [place for place, its_role in self._places.items() if its_role == role]
        if not places:
            raise LookupError(f"no process of this run has the role {role!r}")
        if wanted:
            if wanted not in places:
                raise LookupError(f"no process of this run with the role {role!r} is named {wanted!r}")
            places = [wanted]
        free = [p for p in places if p not in self._holders or self._may_have(p, host, now, named=bool(wanted))]
        if not free:
            return None
        place = min(free, key=lambda p: self._rank(p, host, now))
        self._offered[place] = now
        return place

    def _may_have(self, place: str, host: str, now: float, *, named: bool) -> bool:
        holder = self._holders[place]
        return not holder.live if named else holder.yields_to(host, now)

    def _rank(self, place: str, host: str, now: float) -> tuple[bool, int, float]:
        holder, offered = self._holders.get(place), self._offered.get(place)
        kind = 1 if holder is None else 0 if holder.host == host else 2
        recent = offered is not None and now - offered < OFFERED_S
        return recent, kind, offered if recent and offered is not None else 0.0

    def had(self, place: str) -> bool:
        """Whether a process has or had this place."""
        return place in self._holders

    def came(self, place: str, now: float) -> None:
        """A process was seen alive at this place."""
        holder = self._holders.get(place)
        self._holders[place] = replace(holder or Holder(None, now), since=now, live=True)
        self._offered.pop(place, None)

    def went(self, place: str, now: float) -> None:
        """The process at this place is gone."""
        if place in self._holders:
            self._holders[place] = replace(self._holders[place], since=now, live=False)

    def known(self, place: str, host: str) -> None:
        """The process at this place says that it runs on this host."""
        if place in self._holders:
            self._holders[place] = replace(self._holders[place], host=host)
