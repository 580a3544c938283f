"""Assigns the places of a run to processes that are started elsewhere and do not say which one they want."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

GRACE_S: Final = 10.0
"""How long a place is kept for a host whose process is gone."""
STARTING_S: Final = 30.0
"""How long a process that was given a place may take until it is seen alive there."""


@dataclass(frozen=True, slots=True)
class Holder:
    """The host that has a place; ``since`` is when it was given, or when its process came or went last (s, any clock).

    There is no ``host`` if its process asked for the place by name.
    """

    host: str | None
    since: float
    arrived: bool = False
    live: bool = False

    def yields_to(self, host: str, now: float) -> bool:
        """Whether a process on this host may have the place."""
        if self.live:
            return False
        if not self.arrived:
            return now - self.since > STARTING_S
        return host == self.host or now - self.since > GRACE_S


class Claims:
    """Gives places, each to one process at a time: a host gets its own back, then come free ones, then abandoned ones.

    ``places`` has the role of each, in the order in which they are given. Times are seconds of any one clock.
    """

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = dict(places)
        self._holders: dict[str, Holder] = {}

    def take(self, role: str, host: str, now: float) -> tuple[str, bool] | None:
        """A place of this role for a process on this host, and whether another process had it before.

        None if all are taken. Raises ``LookupError`` if there is no such role.
        """
        places = [place for place, its_role in self._places.items() if its_role == role]
        if not places:
            raise LookupError(f"no process of this run has the role {role!r}")
        free = [p for p in places if p not in self._holders or self._holders[p].yields_to(host, now)]
        if not free:
            return None
        place = min(free, key=lambda p: self._rank(p, host))
        before = self._holders.get(place)
        self._holders[place] = Holder(host, now)
        return place, before is not None and before.arrived

    def _rank(self, place: str, host: str) -> int:
        holder = self._holders.get(place)
        if holder is None:
            return 1
        return 0 if holder.host == host else 2

    def seen(self, place: str, *, live: bool, now: float) -> None:
        """The process at this place appeared, or ended."""
        if place in self._places:
            holder = self._holders.get(place, Holder(None, now))
            self._holders[place] = replace(holder, since=now, live=live, arrived=holder.arrived or live)
