"""Data on its way: a queue, one message at a time to a neighbour until it acknowledges it.

A message is known by its origin and serial number. A process hands it on to one neighbour, and to all, once each. If
it comes back after ``LOOP`` hops or more, paths were reinforced in a circle: it is handed on once more, along
gradients, and not again: no message goes on for ever.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from trackfield.protocols.interest.interests import Key, id_of
from trackfield.protocols.interest.paths import Flow, kept
from trackfield.role import Note
from trackfield.wire.interests import Data

MOST_ORIGINS: Final = 256
"""Of so many processes one remembers what they sent; then those of whom it heard first are forgotten."""
REMEMBERED: Final = 32
"""How many messages of each origin a process remembers."""
CARRIED: Final = 1
"""It was taken, to be handed on to one neighbour, or it is for this process."""
SPREAD: Final = 2
"""It came by a flood."""
LOOPED: Final = 4
"""It came back."""
LOOP: Final = 2
"""A message that comes again after one more hop comes round a neighbour, as an acknowledgement was lost."""


@dataclass(frozen=True, slots=True)
class Parcel:
    """A message of ``origin`` after ``hops`` hops; it came from the neighbour ``via`` (empty: it is an own one)."""

    key: Key
    origin: str
    serial: int
    hops: int
    message: bytes
    via: str = ""

    @classmethod
    def of(cls, data: Data, sender: str) -> Parcel:
        """What came by this message. Raises ``WireError`` (``key``) if sink or origin are no ids."""
        key = (id_of(data.sink), data.number)
        return cls(key, id_of(data.origin), data.serial, data.hops + 1, data.message, sender)

    @property
    def flow(self) -> Flow:
        """What it belongs to."""
        return self.key, self.origin

    def data(self, spread: int = 0) -> Data:
        """Its next hop, to one neighbour, or to all for so many hops."""
        (sink, number), origin = self.key, self.origin.encode()
        return Data(sink.encode(), number, origin, self.serial, self.hops, spread, self.message)


@dataclass(frozen=True, slots=True)
class Traffic:
    """What waits in a process; the first in the ``queue`` is under way to ``next`` (empty: none is).

    It was sent there ``tries`` times, and the neighbours in ``tried`` did not acknowledge it. ``serial`` is that of the
    next own message. ``seen`` are the last messages of each origin: serial, how they were here (the sum of ``CARRIED``,
    ``SPREAD``, ``LOOPED``), and after how many hops they first were.
    """

    queue: tuple[Parcel, ...] = ()
    next: str = ""
    tries: int = 0
    tried: tuple[str, ...] = ()
    serial: int = 0
    seen: Mapping[str, tuple[tuple[int, int, int], ...]] = field(default_factory=dict)

    def was(self, parcel: Parcel) -> int:
        """How this message was here before; 0: it was not."""
        return self._past(parcel)[0]

    def returns(self, parcel: Parcel) -> bool:
        """Whether this message was handed on here, and came back for the first time."""
        how, hops = self._past(parcel)
        return how & (CARRIED | LOOPED) == CARRIED and parcel.hops >= hops + LOOP

    def noting(self, parcel: Parcel, how: int) -> Traffic:
        """The same, after the message was here in this way, too."""
        before, hops = self._past(parcel)
        here = (parcel.serial, how | before, hops if before else parcel.hops)
        others = tuple(one for one in self.seen.get(parcel.origin, ()) if one[0] != parcel.serial)
        seen = kept(self.seen, parcel.origin, (*others, here)[-REMEMBERED:], MOST_ORIGINS)
        return replace(self, seen=seen)

    def _past(self, parcel: Parcel) -> tuple[int, int]:
        """How this message was here before, and after how many hops."""
        for serial, how, hops in self.seen.get(parcel.origin, ()):
            if serial == parcel.serial:
                return how, hops
        return 0, 0

    def add(self, parcel: Parcel, most: int) -> tuple[Traffic, tuple[Note, ...]]:
        """One more message waits; of more than ``most`` the oldest that is not under way is given up."""
        begun = 1 if self.next else 0
        queue = (*self.queue, parcel)
        if len(queue) <= most:
            return replace(self, queue=queue), ()
        left = replace(self, queue=(*queue[:begun], *queue[begun + 1 :]))
        return left, (_dropped(queue[begun], f"{most} wait already"),)

    def drop(self, why: str) -> tuple[Traffic, tuple[Note, ...]]:
        """The first message is given up."""
        return self.done(), (_dropped(self.queue[0], why),)

    def done(self) -> Traffic:
        """The first message has gone on."""
        return replace(self, queue=self.queue[1:], next="", tries=0, tried=())


def _dropped(lost: Parcel, why: str) -> Note:
    return Note(f"message {lost.serial} of {lost.origin} is dropped: {why}")
