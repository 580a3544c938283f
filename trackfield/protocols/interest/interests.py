"""The interests that a process knows, and from which neighbours it heard them: its gradients.

An interest is known by its sink and number. Its sink spreads it anew every third of its duration, and each process
hands on the first copy of each refresh. So a process hears of every refresh from each neighbour that is in reach of it,
and a gradient, the neighbour from which a copy came, expires when two of them are missed.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from math import dist
from typing import Final, NamedTuple

from trackfield.role import NS
from trackfield.wire.error import WireError
from trackfield.wire.interests import Interest
from trackfield.wire.keys import check_id

REFRESHES: Final = 3
"""So often an interest is spread in its duration."""
MISSED: Final = 2
"""After so many missed refreshes a gradient expires."""
GRACE: Final = 0.25
"""A refresh is missed this share of the time between two of them after it was due: floods take their time."""
STRAGGLERS: Final = 8
"""A refresh with a number up to so many before the last is an old one; any other may be of a sink's new life."""
MOST_INTERESTS: Final = 64
MOST_GRADIENTS: Final = 8
"""Of so many neighbours a process remembers that they know an interest."""
NUMBERS: Final = 1 << 16

Key = tuple[str, int]
"""The id of an interest: its sink, and the sink's number of it."""
Place = tuple[float, float]


class Wanted(NamedTuple):
    """What a sink asks for: data of the class ``task`` from within ``radius_m`` of a place (m).

    It is spread over ``most_hops`` at most, every third of ``lasts_s``. A source sends at most one message in
    ``interval_s`` (0: any number).
    """

    number: int
    task: int
    x_m: float
    y_m: float
    radius_m: float
    interval_s: float
    lasts_s: float
    most_hops: int

    def interest(self, sink: str, refresh: int) -> Interest:
        """The message by which ``sink`` spreads it."""
        return Interest(sink.encode(), self.number, refresh, *self[1:-1], 0, self.most_hops)


class Known(NamedTuple):
    """A live interest in data of the class ``task``: whose it is, and that it is ``hops`` away (0: an own one)."""

    sink: str
    number: int
    task: int
    hops: int

    @property
    def key(self) -> Key:
        """The id of the interest."""
        return self.sink, self.number


def covers(interest: Interest, place: Place) -> bool:
    """Whether data is wanted from this place (m)."""
    return dist(place, (interest.x_m, interest.y_m)) <= interest.radius_m


def id_of(id: bytes) -> str:
    """An id out of a message. Raises ``WireError`` (``key``) for what is none."""
    try:
        return check_id(id.decode("ascii"))
    except UnicodeDecodeError:
        raise WireError("key", "an id that is not ASCII") from None


@dataclass(frozen=True, slots=True)
class Gradient:
    """A neighbour that is ``hops`` from the sink, as it said at ``heard_ns`` by the copy of ``refresh``."""

    hops: int
    refresh: int
    heard_ns: int


@dataclass(frozen=True, slots=True)
class Entry:
    """An interest as its last refresh said it, and the neighbours it came from, in the order in which they came.

    A gradient holds for ``life_ns`` without a refresh, the last of them until ``until_ns``. By the last refresh this
    process is ``hops`` from the sink. They are worked out once: each message that comes asks for them.
    """

    interest: Interest
    gradients: Mapping[str, Gradient]
    life_ns: int = field(init=False)
    until_ns: int = field(init=False)
    hops: int = field(init=False)

    def __post_init__(self) -> None:
        life_ns, known = int((MISSED + GRACE) / REFRESHES * self.interest.lasts_s * NS), self.gradients.values()
        object.__setattr__(self, "life_ns", life_ns)
        object.__setattr__(self, "until_ns", max(one.heard_ns for one in known) + life_ns)
        last = (one.hops for one in known if one.refresh == self.interest.refresh)
        object.__setattr__(self, "hops", 1 + min(last))

    def live(self, now: int) -> bool:
        """Whether any gradient holds."""
        return now < self.until_ns

    def ways(self, now: int, silent: Container[str], via: str = "") -> tuple[str, ...]:
        """The neighbours to which data may go that came ``via`` one of them (empty: own data), the best first.

        Those with fewer hops are better, then those that answer, that missed no refresh, and that were heard first.
        Data may go to a neighbour that is as far from the sink as this process, but not from one such to another: so
        it does not go round in circles.
        """
        last, before = self.interest.refresh, self.gradients.get(via)
        hops = self.hops - (before is not None and before.hops >= self.hops)
        known = [
            (one.hops, neighbour in silent, one.refresh != last, one.heard_ns, neighbour)
            for neighbour, one in self.gradients.items()
            if now < one.heard_ns + self.life_ns and one.hops <= hops and neighbour != via
        ]
        return tuple(neighbour for *_, neighbour in sorted(known))

    def nearer(self, neighbour: str) -> bool:
        """Whether this process is nearer to the sink than the neighbour, as far as is known."""
        known = self.gradients.get(neighbour)
        return known is not None and known.hops > self.hops

    def heard(self, now: int, copy: Interest, sender: str) -> Entry:
        """The same after a copy of the interest that is not older than it."""
        gradient = Gradient(copy.hops, copy.refresh, now)
        others = {id: one for id, one in self.gradients.items() if id != sender and now < one.heard_ns + self.life_ns}
        gradients = {**others, sender: gradient}
        if len(gradients) > MOST_GRADIENTS:
            worst = max(gradients, key=lambda id: (gradients[id].refresh != copy.refresh, gradients[id].hops, id))
            del gradients[worst]
        return Entry(copy if self.ahead(copy) else self.interest, gradients)

    def ahead(self, copy: Interest) -> int:
        """By how many refreshes a copy is newer: 0 of the same one, negative for one that comes too late."""
        ahead = (copy.refresh - self.interest.refresh) % NUMBERS
        return ahead if ahead < NUMBERS - STRAGGLERS else ahead - NUMBERS


@dataclass(frozen=True, slots=True)
class Interests:
    """The interests of others, by their ids."""

    known: Mapping[Key, Entry] = field(default_factory=dict)

    def at(self, now: int, key: Key) -> Entry | None:
        """The interest, if it is live."""
        entry = self.known.get(key)
        return entry if entry is not None and entry.live(now) else None

    def hear(self, now: int, copy: Interest, sender: str) -> tuple[Interests, str, bool]:
        """A copy came from a neighbour: what is known then, why it is of no use (empty: it is), and if it is news.

        Raises ``WireError`` (``key``) if its sink is no id.
        """
        key = (id_of(copy.sink), copy.number)
        before = self.at(now, key)
        if before is None:
            live = {id: entry for id, entry in self.known.items() if entry.live(now)}
            if len(live) >= MOST_INTERESTS:
                return replace(self, known=live), "too many interests", False
            return Interests({**live, key: Entry(copy, {sender: Gradient(copy.hops, copy.refresh, now)})}), "", True
        ahead = before.ahead(copy)
        if ahead < 0:
            return self, "outdated", False
        if ahead == 0 and sender in before.gradients and before.gradients[sender].refresh == copy.refresh:
            return self, "repeated", False
        return Interests({**self.known, key: before.heard(now, copy, sender)}), "", ahead > 0
