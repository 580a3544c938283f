"""Who wants what of a field, and until when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import dist
from typing import Any, Final, NamedTuple

from trackfield.protocols.interest.interests import Place
from trackfield.role import NS
from trackfield.wire.interests import Interest
from trackfield.wire.keys import check_id
from trackfield.wire.outside import Subscribe

MOST: Final = 16
"""A gateway keeps so many subscriptions."""

Key = tuple[str, int]
"""A subscriber, and the class of data that it wants."""


class Wish(NamedTuple):
    """What is wanted: from within ``radius_m`` of a place (m), until local time ``until_ns``.

    ``number`` is that of the interest that the sink is given.
    """

    number: int
    x_m: float
    y_m: float
    radius_m: float
    until_ns: int

    @property
    def region(self) -> tuple[float, float, float]:
        """Where data is wanted from."""
        return self.x_m, self.y_m, self.radius_m

    def interest(self, sink: str, task: int, *, lasts_s: float) -> Interest:
        """What the sink of the same process is told; 0 s: it is no longer wanted."""
        return Interest(sink.encode(), self.number, 0, task, *self.region, 0.0, lasts_s, 0, 0)


@dataclass(frozen=True, slots=True)
class Subscriptions:
    """The wishes of subscribers; a new one of the same subscriber for the same class replaces the old one."""

    known: Mapping[Key, Wish] = field(default_factory=dict)

    def subscribed(self, subscriber: str, wanted: Subscribe, now: int) -> Subscriptions | None:
        """With one more; None if there is no room for it."""
        key, before = (subscriber, wanted.task), self.known.get((subscriber, wanted.task))
        if before is None and len(self.known) >= MOST:
            return None
        taken = {one.number for one in self.known.values()}
        number = before.number if before else next(one for one in range(MOST) if one not in taken)
        until_ns = now + round(wanted.lasts_s * NS)
        return replace(self, known={**self.known, key: Wish(number, wanted.x_m, wanted.y_m, wanted.radius_m, until_ns)})

    def without(self, key: Key) -> Subscriptions:
        """Without one that was withdrawn."""
        return Subscriptions({one: wish for one, wish in self.known.items() if one != key})

    def live(self, now: int) -> Subscriptions:
        """Those that have not expired."""
        return Subscriptions({one: wish for one, wish in self.known.items() if now < wish.until_ns})

    def wanting(self, task: int, place: Place) -> tuple[str, ...]:
        """Who wants data of this class from this place (m), in the order in which they subscribed."""
        found = ((key, wish) for key, wish in self.known.items() if key[1] == task)
        return tuple(key[0] for key, wish in found if dist(place, (wish.x_m, wish.y_m)) <= wish.radius_m)

    @property
    def subscribers(self) -> frozenset[str]:
        """Who wants anything."""
        return frozenset(subscriber for subscriber, _ in self.known)

    @property
    def next_ns(self) -> int | None:
        """When the first of them expires."""
        return min((wish.until_ns for wish in self.known.values()), default=None)

    def told(self, before: Subscriptions, sink: str) -> tuple[Interest, ...]:
        """What the sink must be told after a change: of interests that are gone, and of those that are new."""
        gone = (wish.interest(sink, key[1], lasts_s=0.0) for key, wish in before.known.items() if key not in self.known)
        new = (
            wish.interest(sink, key[1], lasts_s=1.0)
            for key, wish in self.known.items()
            if key not in before.known or before.known[key].region != wish.region
        )
        return (*gone, *new)

    # --- over a restart ------------------------------------------------------------------------------------------

    def plain(self) -> list[Any]:
        """What is stored."""
        return [[*key, *wish] for key, wish in self.known.items()]

    @classmethod
    def from_plain(cls, plain: Any, now: int) -> Subscriptions:
        """The inverse, without those that have expired. Raises ``ValueError`` or ``TypeError`` for anything else."""
        known = dict[Key, Wish]()
        for subscriber, task, number, x_m, y_m, radius_m, until_ns in plain:
            wish = Wish(int(number), float(x_m), float(y_m), float(radius_m), int(until_ns))
            known[check_id(subscriber), int(task)] = wish
        return cls(dict(list(known.items())[:MOST])).live(now)
