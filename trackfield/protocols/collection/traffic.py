"""Messages on their way over the tree: a queue, one message at a time to the next process until it acknowledges it.

A message is known by its origin and number. A process that gets it once more acknowledges it and drops it, as its
sender has not had the acknowledgement; but if it has made more hops since, it went round in a circle, and goes on, by
the way that holds now, up to ``MOST_HOPS`` in all. That is what CTP does.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, TypeVar

from trackfield.protocols.collection.links import text_of
from trackfield.role import Note
from trackfield.wire.codec import WireError, decode
from trackfield.wire.keys import check_id
from trackfield.wire.messages import Hop, Threshold, Track

MOST_TRIES: Final = 3
"""How often a message is sent to the same neighbour."""
MOST_TURNS: Final = 3
"""To how many neighbours in turn a process sends a message that none acknowledges."""
MOST_HOPS: Final = 64
MOST_ORIGINS: Final = 4096
"""Of so many processes one remembers what they sent; then those of whom it heard first are forgotten."""
REMEMBERED: Final = 32
"""How many numbers of each origin a process remembers."""
_NUMBERS: Final = 1 << 16

T = TypeVar("T")


def topic(payload: bytes) -> Hashable:
    """What a message is about, of those of which only the newest counts; None for all others."""
    try:
        message = decode(payload)
    except WireError:
        return None
    match message:
        case Track(tracker=tracker):
            return "track", tracker
        case Threshold():
            return "threshold"
    return None


def _least(known: Mapping[str, T], origin: str) -> Mapping[str, T]:
    """What is known of origins, with room for this one."""
    if origin in known or len(known) < MOST_ORIGINS:
        return known
    first = next(iter(known))
    return {id: one for id, one in known.items() if id != first}


@dataclass(frozen=True, slots=True)
class Parcel:
    """A message that waits: the ``number``-th of its ``origin``, after ``hops`` hops; ``to`` is empty for the base."""

    origin: str
    number: int
    hops: int
    to: str
    message: bytes

    @classmethod
    def of(cls, hop: Hop) -> Parcel:
        """What came by this hop. Raises ``WireError`` (``key``) if it is from or to what is no id."""
        to = check_id(text_of(hop.to)) if hop.to else ""
        return cls(check_id(text_of(hop.origin)), hop.number, hop.hops + 1, to, hop.message)

    def hop(self, cost: float) -> Hop:
        """Its next hop, by a process with this cost."""
        return Hop(self.origin.encode(), self.number, self.hops, cost, self.to.encode(), self.message)

    def replaces(self, older: Parcel) -> bool:
        """Whether the other one is of no use beside this one."""
        ahead = (self.number - older.number) % _NUMBERS
        alike = (self.origin, self.to) == (older.origin, older.to) and 0 < ahead < _NUMBERS // 2
        return alike and (about := topic(self.message)) is not None and about == topic(older.message)


@dataclass(frozen=True, slots=True)
class Traffic:
    """What waits in a process, the first in the ``queue`` under way to ``next`` (empty: none is).

    It was sent ``tries`` times there, and ``turns`` neighbours did not acknowledge it. ``number`` is that of the next
    own message. ``seen`` are the (number, hops) of the last messages of each origin, ``ways`` the neighbour by which
    the last one came; ``dropped`` counts the messages that were given up here.
    """

    queue: tuple[Parcel, ...] = ()
    next: str = ""
    tries: int = 0
    turns: int = 0
    number: int = 0
    seen: Mapping[str, tuple[tuple[int, int], ...]] = field(default_factory=dict)
    ways: Mapping[str, str] = field(default_factory=dict)
    dropped: int = 0

    def hops_of(self, parcel: Parcel) -> int | None:
        """After how many hops this message was here before; None: it was not."""
        return dict(self.seen.get(parcel.origin, ())).get(parcel.number)

    def remembering(self, parcel: Parcel) -> Traffic:
        """The same, with this message among those that were here."""
        kept = tuple(one for one in self.seen.get(parcel.origin, ()) if one[0] != parcel.number)
        others = _least(self.seen, parcel.origin)
        return replace(self, seen={**others, parcel.origin: (*kept, (parcel.number, parcel.hops))[-REMEMBERED:]})

    def by(self, origin: str, neighbour: str) -> Traffic:
        """The same, after a message of this origin came by this neighbour."""
        if self.ways.get(origin) == neighbour:
            return self
        return replace(self, ways={**_least(self.ways, origin), origin: neighbour})

    def without_way(self, to: str) -> Traffic:
        """The same, with nothing known of where answers to this process go."""
        return replace(self, ways={id: way for id, way in self.ways.items() if id != to})

    def add(self, parcel: Parcel, most: int) -> tuple[Traffic, tuple[Note, ...]]:
        """The queue of at most so many with one more; what it cannot hold any longer, or need not, is dropped.

        The message under way is never dropped.
        """
        begun = 1 if self.next else 0
        for place, waiting in enumerate(self.queue[begun:], begun):
            if parcel.replaces(waiting):
                queue = (*self.queue[:place], parcel, *self.queue[place + 1 :])
                return self._dropping(queue, waiting, "a newer one replaces it")
        queue = (*self.queue, parcel)
        if len(queue) <= most:
            return replace(self, queue=queue), ()
        return self._dropping((*queue[:begun], *queue[begun + 1 :]), queue[begun], f"{most} wait already")

    def drop(self, why: str) -> tuple[Traffic, tuple[Note, ...]]:
        """The queue without its first message, which is given up."""
        return self.done()._dropping(self.queue[1:], self.queue[0], why)

    def done(self) -> Traffic:
        """The queue without its first message, which is where it was to go."""
        return replace(self, queue=self.queue[1:], next="", tries=0, turns=0)

    def _dropping(self, queue: tuple[Parcel, ...], lost: Parcel, why: str) -> tuple[Traffic, tuple[Note, ...]]:
        note = Note(f"message {lost.number} of {lost.origin} is dropped: {why}")
        return replace(self, queue=queue, dropped=self.dropped + 1), (note,)
