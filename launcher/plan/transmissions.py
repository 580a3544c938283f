"""The transmissions on a medium: when, by whom, how strong they are where, and which of them meet."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackfield.link.fate import Transmission
from trackfield.link.places import Places, distance_m, moves
from trackfield.link.signals import Signals

UNITS: Final = 1e4
"""Of a signal as strong as the noise: strengths are whole numbers, so that sums do not depend on their order."""
MOST: Final = 10**12
"""The strength of the strongest signal, 80 dB above the noise."""
CHUNK: Final = 2_000_000
"""So many pairs of transmissions are looked at together."""

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Row(NamedTuple):
    """A transmission [``begin_ns``, ``end_ns``) of fragment number ``part`` by the sender of this number.

    The exchange to which it belongs was begun by ``opener`` at ``opened_ns``. Those for whom it is got it, if it is
    ``sound``, as far as that is known.
    """

    begin_ns: int
    end_ns: int
    sender: int
    part: int
    sound: bool
    opener: int
    opened_ns: int


@dataclass(frozen=True)
class Sent:
    """All m transmissions on a medium: the columns of ``Row``, and in which order they begin and end.

    ``senders`` are numbered. Those of frame n that are no acknowledgements are ``counts[n]`` of ``data`` from
    ``firsts[n]`` on, of at most ``tries[n]`` for each fragment.
    """

    senders: dict[str, int]
    begin: Ints
    end: Ints
    sender: Ints
    part: Ints
    sound: Flags
    opener: Ints
    opened: Ints
    by_begin: Ints
    by_end: Ints
    data: Ints
    firsts: dict[int, int]
    counts: dict[int, int]
    tries: dict[int, int]

    @classmethod
    def of(cls, signals: Signals, frames: Sequence[Transmission], numbers: Iterable[int]) -> Sent:
        """Those of the frames with these numbers."""
        senders, firsts, counts, tries = dict[str, int](), dict[int, int](), dict[int, int](), dict[int, int]()
        rows, data = list[Row](), list[int]()
        for n in numbers:
            frame = frames[n]
            at, since = frame.sent_ns, frame.sent_ns
            firsts[n], tries[n] = len(data), signals.tries(frame)
            for one in signals.on_air(frame):
                src = senders.setdefault(frame.src, len(senders))
                who = senders.setdefault(frame.dst, len(senders)) if one.answer else src
                if not one.answer:
                    since = at + one.begin_ns
                    data.append(len(rows))
                heard = one.heard or frame.broadcast
                rows.append(Row(at + one.begin_ns, at + one.end_ns, who, one.part, heard, src, since))
            counts[n] = len(data) - firsts[n]
        begin, end, sender, part, sound, opener, opened = np.array(rows, np.int64).reshape(-1, len(Row._fields)).T
        return cls(
            senders, begin, end, sender, part, sound > 0, opener, opened, np.argsort(begin, kind="stable"),
            np.argsort(end, kind="stable"), np.array(data, np.int64), firsts, counts, tries,
        )  # fmt: skip

    @property
    def after_begin(self) -> Ints:
        """(m,) how many begin before each of them ends."""
        return np.searchsorted(self.begin[self.by_begin], self.end, "left")

    @property
    def after_end(self) -> Ints:
        """(m,) how many are over when each of them begins."""
        return np.searchsorted(self.end[self.by_end], self.begin, "right")

    @property
    def own(self) -> Ints:
        """(m,) how many of the same sender each of them overlaps, itself included."""
        from_ns = self.sender * (int(self.end.max(initial=0)) + 1)  # one line of time, one sender after the other
        begin, end = from_ns + self.begin, from_ns + self.end
        return np.searchsorted(np.sort(begin), end, "left") - np.searchsorted(np.sort(end), begin, "right")


class Near:
    """Whose signals are strong enough to disturb whom."""

    def __init__(self, signals: Signals, places: Places, sent: Sent) -> None:
        self._signals, self._places, self._sent = signals, places, sent
        self._reach_m = signals.reach_m
        self._moving = [id for id in sent.senders if id in places and moves(places[id])]
        self._still = [id for id in sent.senders if id in places and not moves(places[id])]
        self._at = np.array([places[id] for id in self._still], float).reshape(-1, 2)
        self._moves, self._heard = frozenset(self._moving), dict[tuple[str, str, int], bool]()

    def strengths(self, hearer: str) -> Ints:
        """(m,) the strength of each transmission at this process, in ``UNITS``; 0 if it is too weak, or its own."""
        sent, place = self._sent, self._places.get(hearer)
        if place is None:
            return np.zeros(len(sent.begin), np.int64)
        by_sender, moving = np.zeros(len(sent.senders), np.int64), self._moving
        if moves(place):
            moving = list(sent.senders)
        else:
            far = np.hypot(*(self._at - np.array(place, float)).T)
            near = np.flatnonzero(far <= self._reach_m) if isfinite(self._reach_m) else range(len(self._still))
            for id in (self._still[i] for i in near):
                by_sender[sent.senders[id]] = self.strength(id, hearer, 0)
        found = by_sender[sent.sender]
        for id in moving:
            theirs = np.flatnonzero(sent.sender == sent.senders[id])
            found[theirs] = [self.strength(id, hearer, at) for at in sent.begin[theirs].tolist()]
        return found

    def hears(self, src: str, hearer: str, at_ns: int) -> bool:
        """Whether the signal of one process is noticed by another at an instant; of two at rest it is found once."""
        if self._moves.isdisjoint((src, hearer)):
            at_ns = 0
        key = src, hearer, at_ns
        if key not in self._heard:
            near = {src, hearer} <= self._places.keys() and distance_m(self._places, *key) <= self._reach_m
            self._heard[key] = near and self.strength(src, hearer, at_ns) > 0
        return self._heard[key]

    def strength(self, src: str, hearer: str, at_ns: int) -> int:
        """That of one process at another at an instant."""
        db = None if src == hearer else self._signals.db(src, hearer, at_ns)
        return 0 if db is None else min(max(round(UNITS * 10 ** (db / 10)), 1), MOST)


@dataclass(frozen=True)
class Clashes:
    """Of each transmission the ``others`` (numbers) that it meets, from ``starts`` (m + 1,) on."""

    starts: Ints
    others: Ints

    @classmethod
    def of(cls, sent: Sent, near: Near, blind_ns: int) -> Clashes:
        """Those that overlap although their senders listen first.

        Of two exchanges, the later one would have waited if it began at least ``blind_ns`` after the earlier one, and
        he who began it hears the other.
        """
        found = [_unheeded(sent, near, blind_ns, *pair) for pair in _overlapping(sent)]
        one, other = np.concatenate([np.empty((2, 0), np.int64), *found], axis=1)
        one, other = np.concatenate([one, other]), np.concatenate([other, one])
        order = np.lexsort((other, one))
        return cls(np.searchsorted(one[order], np.arange(len(sent.begin) + 1)), other[order])

    def of_each(self, which: Ints) -> tuple[Ints, Ints]:
        """(k,) positions in ``which`` (n,), and the number of another that this one meets."""
        counts = self.starts[which + 1] - self.starts[which]
        return np.repeat(np.arange(len(which)), counts), self.others[spans(self.starts[which], counts)]


def spans(firsts: Ints, counts: Ints) -> Ints:
    """The numbers from each of ``firsts`` (n,) on, so many as ``counts`` (n,) says, one after the other."""
    before = np.cumsum(counts) - counts
    numbers: Ints = np.arange(int(counts.sum())) + np.repeat(firsts - before, counts)
    return numbers


def _overlapping(sent: Sent) -> Iterable[tuple[Ints, Ints]]:
    """All pairs of transmissions that overlap, in chunks."""
    order, position = sent.by_begin, np.arange(len(sent.begin))
    counts = sent.after_begin[order] - position - 1
    chunk = np.cumsum(counts) // CHUNK
    for number in np.unique(chunk):
        first = position[chunk == number]
        yield order[np.repeat(first, counts[first])], order[spans(first + 1, counts[first])]


def _unheeded(sent: Sent, near: Near, blind_ns: int, one: Ints, other: Ints) -> NDArray[np.int64]:
    """(2, k) those of these pairs that listening would not have kept apart."""
    apart = (sent.opener[one] != sent.opener[other]) & (sent.sender[one] != sent.sender[other])
    one, other = one[apart], other[apart]
    swapped = sent.opened[one] > sent.opened[other]
    earlier, later = np.where(swapped, other, one), np.where(swapped, one, other)
    seen = sent.opened[later] - sent.opened[earlier] >= blind_ns
    ids, all_ = list(sent.senders), len(sent.senders)
    codes = sent.opener[earlier[seen]] * all_ + sent.opener[later[seen]]
    known, first, back = np.unique(codes, return_index=True, return_inverse=True)
    times = sent.opened[later[seen]][first].tolist()
    heard = [near.hears(ids[c // all_], ids[c % all_], t) for c, t in zip(known.tolist(), times, strict=True)]
    seen[seen] = np.array(heard, bool)[back]
    return np.stack([one[~seen], other[~seen]])
