"""Frames that left and are not settled: of each the version that holds, and what the link makes of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from heapq import heappop, heappush
from typing import NamedTuple

from trackfield.drivers.engine.frames import Frame, Identity
from trackfield.drivers.hearers import Hearers
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.fate import Fate, Link


class Way(NamedTuple):
    """What the link makes of a frame on its way to one of its hearers; ``due_ns`` is None if it does not arrive.

    What its hearer must hear of it began ``span_ns`` before.
    """

    hearer: str
    outcome: str
    due_ns: int | None
    span_ns: int = 0


class Entry(NamedTuple):
    """The latest version of a frame (None: it is final); one that was taken back costs nothing and has no ways."""

    identity: Identity
    frame: Frame
    version: int | None
    cost: Fate | None
    ways: list[Way]


class Leaving:
    """Frames by their identity, until the instant at which they left is settled.

    ``processes`` are those of the run by id, ``end_ns`` is its end; all is settled up to ``settled_ns``. ``left``
    counts the frames so far, without those that were taken back; ``ways`` the outcomes of those that are not settled,
    by the link alone.
    """

    def __init__(self, processes: Mapping[str, ProcessSpec], link: Link, end_ns: int) -> None:
        self.end_ns, self.settled_ns, self.left = end_ns, -1, 0
        self.ways: Counter[str] = Counter()
        self._link, self._hearers = link, Hearers(processes)
        self._entries: dict[Identity, Entry] = {}
        self._order: list[tuple[int, Identity]] = []

    def hearers(self, frame: Frame) -> Iterator[str]:
        """The ids of those for which a frame is."""
        return (process.id for process in self._hearers.of(frame))

    def too_late(self, frame: Frame, version: int | None) -> bool:
        """Whether this corrects a frame that is settled; a frame that only comes late is still entered."""
        return bool(version) and frame.sent_ns <= self.settled_ns and frame.identity not in self._entries

    def put(self, frame: Frame, version: int | None) -> list[Way]:
        """Enter a version of a frame, if it is the highest; returns the ways that are new and those that are gone."""
        identity = frame.identity
        before = self._entries.get(identity)
        if before is None:
            heappush(self._order, (frame.sent_ns, identity))
        elif (version or 0) <= (before.version or 0):
            return []
        else:
            self._count(before, -1)
        entry = self._entries[identity] = self._entry(identity, frame, version)
        self._count(entry, 1)
        return entry.ways + before.ways if before else entry.ways

    def settle(self, until_ns: int) -> Iterator[Entry]:
        """Remove and return what left up to this true time, in order."""
        self.settled_ns = max(self.settled_ns, until_ns)
        while self._order and self._order[0][0] <= until_ns:
            yield self._entries.pop(heappop(self._order)[1])

    def last_ns(self) -> int:
        """The latest instant (true time) at which any of them left or is due; 0 without any."""
        dues = (way.due_ns or 0 for entry in self._entries.values() for way in entry.ways)
        return max([0, *dues, *(sent_ns for sent_ns, _ in self._order)])

    def _count(self, entry: Entry, sign: int) -> None:
        self.left += sign if entry.frame.payload else 0
        for way in entry.ways:
            self.ways[way.outcome] += sign

    def _entry(self, identity: Identity, frame: Frame, version: int | None) -> Entry:
        if not frame.payload:
            return Entry(identity, frame, version, None, [])
        cost = frame.cost(self._link)
        return Entry(identity, frame, version, cost, [self._way(frame, hearer, cost) for hearer in self.hearers(frame)])

    def _way(self, frame: Frame, hearer: str, cost: Fate) -> Way:
        if frame.sent_ns >= self.end_ns:
            return Way(hearer, "in_flight", None)
        fate = cost if hearer == frame.to else frame.fate(self._link, hearer)
        if fate.cause is not None:
            return Way(hearer, fate.cause, None)
        return Way(hearer, "delivered", frame.sent_ns + fate.delay_ns, fate.span_ns)
