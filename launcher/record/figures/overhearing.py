"""What radios spend on frames that are for others: an accounting, computed from the frames of a run."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from launcher.record.diary import Diary
from launcher.record.ledger import Ledger
from launcher.records import MessageRow
from trackfield.drivers.engine.receiver import Opening, Windows
from trackfield.drivers.spec import links_of, places_of
from trackfield.link.energy import Power
from trackfield.link.fate import Link, Transmission
from trackfield.link.models import reach_m
from trackfield.link.places import moves
from trackfield.link.signals import Signals
from trackfield.role import NEIGHBOURHOOD

HEARD: Final = 0.01
"""A node overhears a sender if at least this share of its frames would arrive at the node."""

Devices = Mapping[str, Mapping[str, Power]]
"""What each process has for each medium, by its id."""


Overheard = Mapping[tuple[str, str, str], int]
"""How long (ns), by (process, medium, period)."""


def overheard_ns(ledger: Ledger, devices: Devices, period_of: Callable[[int], str] = lambda at_ns: "") -> Overheard:
    """For how long those with these devices overhear: frames for others, and lost ones, in reach of a radio that is on.

    In windows, a radio overhears what it catches, from that instant on. A frame counts for the period in which it was
    sent.
    """
    total: Counter[tuple[str, str, str]] = Counter()
    for medium in sorted({medium for powers in devices.values() for medium in powers}):
        for id, sent_ns, took_ns in _on(medium, ledger, devices):
            total[id, medium, period_of(sent_ns)] += took_ns
    return total


def overheard_fj(heard: Overheard, devices: Devices) -> int:
    """What that costs above sleeping (fJ).

    A radio that listens draws as much as one that receives, or nearly: this is a part of ``listen``, not beside it.
    """
    powers = ((devices[id][medium], took_ns) for (id, medium, _), took_ns in heard.items())
    return sum(took_ns * (power.receive_uw - power.sleep_uw) for power, took_ns in powers)


@dataclass(frozen=True)
class _Heard:
    """A transmission as it was recorded, and the receivers for whom it was that got it."""

    row: MessageRow
    meant: set[str]
    preamble_ns: int
    broadcast: bool


def _on(medium: str, ledger: Ledger, devices: Devices) -> Iterator[tuple[str, int, int]]:
    """Of the frames on one medium: who overhears one, when it was sent, and for how long."""
    powers = {id: own[medium] for id, own in devices.items() if medium in own}
    reach, windows = _Reach(medium, ledger, powers), _Caught(medium, ledger)
    for heard, openings in _openings(medium, ledger, powers):
        row = heard.row
        for id in reach.of(row):
            opening = openings.get(id, False)
            if opening is not False and id not in heard.meant and id != row.src:
                power = powers[id]
                took_ns = (row.bytes + power.overhead_bytes) * power.byte_ns + heard.preamble_ns
                if isinstance(opening, Windows):
                    took_ns = windows.caught_ns(heard, id, took_ns)
                yield id, row.sent_ns, took_ns


class _Reach:
    """Who of those with these ``powers`` would hear whom."""

    def __init__(self, medium: str, ledger: Ledger, powers: Mapping[str, Power]) -> None:
        specs = [diary.spec for diary in ledger.diaries.values()]
        self._medium, self._places = medium, places_of(specs)
        self._link: Link | None = links_of(ledger.run, specs).get(medium)
        plain = ledger.run.media.get(medium, ledger.run.link)
        self._fixed = plain["model"] != "trace"
        self._still = [id for id in powers if not moves(self._places[id])]
        self._moving = [id for id in powers if moves(self._places[id])]
        self._at = np.array([self._places[id] for id in self._still], float).reshape(-1, 2)
        self._near: dict[str, list[str]] = {}
        self._found: dict[tuple[str, int], list[str]] = {}

    def of(self, row: MessageRow) -> list[str]:
        """Those of them who would hear at least ``HEARD`` of such frames."""
        if self._link is None or row.src not in self._places:
            return []
        if not self._fixed or moves(self._places[row.src]):
            return self._hearing(row, [*self._still, *self._moving])
        key = row.src, row.bytes
        if key not in self._found:
            self._found[key] = self._hearing(row, self._candidates(row.src))
        return self._found[key] + self._hearing(row, self._moving)

    def _candidates(self, src: str) -> list[str]:
        """Those at rest within the reach of one at rest."""
        if src not in self._near:
            assert self._link is not None
            x, y = np.array(self._places[src], float)
            far = np.hypot(self._at[:, 0] - x, self._at[:, 1] - y)
            self._near[src] = [self._still[i] for i in np.flatnonzero(far <= reach_m(self._link)).tolist()]
        return self._near[src]

    def _hearing(self, row: MessageRow, ids: list[str]) -> list[str]:
        assert self._link is not None
        link, at_ns, medium = self._link, row.sent_ns, self._medium
        return [id for id in ids if link.reception(row.src, id, row.bytes, at_ns=at_ns, medium=medium) >= HEARD]


class _Caught:
    """What receivers catch that are open in windows."""

    def __init__(self, medium: str, ledger: Ledger) -> None:
        self._signals = Signals.of(ledger.link, medium)
        self._lives: defaultdict[str, list[Diary]] = defaultdict(list)
        self._latest: tuple[_Heard, int] | None = None
        for diary in ledger.diaries.values():
            self._lives[diary.spec.id].append(diary)

    def caught_ns(self, heard: _Heard, id: str, took_ns: int) -> int:
        """How long (ns) this one hears a frame that takes so long, from when it catches it on; 0: it does not."""
        row, preamble_ns = heard.row, heard.preamble_ns
        if self._latest is None or self._latest[0] is not heard:
            self._latest = heard, self._begins_ns(heard)
        due_ns = self._latest[1] + took_ns
        for diary in self._lives[id]:
            if diary.owns(due_ns) and diary.misses(row.medium, due_ns, took_ns, preamble_ns) is None:
                from_ns = diary.receiver(row.medium, due_ns).hears_from(due_ns, took_ns, preamble_ns)
                return 0 if from_ns is None else due_ns - from_ns
        return 0

    def _begins_ns(self, heard: _Heard) -> int:
        """When its first transmission begins."""
        row = heard.row
        if self._signals is None:
            return row.sent_ns
        to = NEIGHBOURHOOD if heard.broadcast else row.dst
        frame = Transmission(
            row.src, to, row.kind, row.sent_ns, row.copy, row.bytes, heard.broadcast, row.medium, heard.preamble_ns
        )
        return row.sent_ns + next((one.begin_ns for one in self._signals.on_air(frame)), 0)


def _openings(
    medium: str, ledger: Ledger, powers: Mapping[str, Power]
) -> Iterator[tuple[_Heard, Mapping[str, Opening]]]:
    """Each transmission in order, and how the receivers of all were open when it was sent."""
    changes = sorted(
        (
            (t, diary.spec.id, opening)
            for diary in ledger.diaries.values()
            if diary.spec.id in powers
            for t, opening in diary.awake(medium)
        ),
        key=lambda change: (change[0], change[1], bool(change[2])),
    )
    openings: dict[str, Opening] = {}
    position = 0
    for heard in _sent(medium, ledger):
        while position < len(changes) and changes[position][0] < heard.row.sent_ns:
            _, id, opening = changes[position]
            openings[id] = opening
            position += 1
        yield heard, openings


def _sent(medium: str, ledger: Ledger) -> list[_Heard]:
    """The transmissions on a medium that were for somebody, in order."""
    longer = {(f.src, f.kind, f.sent_ns, f.copy): f for f in ledger.aired if f.medium == medium}
    found: dict[tuple[Any, ...], _Heard] = {}
    for row in ledger.rows:
        if row.medium == medium and row.outcome != "overflow":
            key = row.sent_ns, row.src, row.incarnation, row.kind, row.copy
            if key not in found:
                frame = longer.get((row.src, row.kind, row.sent_ns, row.copy))
                broadcast, preamble_ns = (False, 0) if frame is None else (frame.broadcast, frame.preamble_ns)
                found[key] = _Heard(row, set(), preamble_ns, broadcast)
            if row.delivered:
                found[key].meant.add(row.dst)
    return [heard for _, heard in sorted(found.items(), key=lambda item: item[0])]
