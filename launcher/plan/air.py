"""How full a channel is, and which frames would have disturbed each other on it.

The fate of a frame depends on the frame alone (``trackfield/link/fate.py``): in the model no frame is lost because of
another. What is on the air when and how strong it is where is known, so it can be counted which of them were exposed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from launcher.plan.transmissions import Clashes, Flags, Ints, Near, Sent, spans
from trackfield.link.fate import Link, Transmission
from trackfield.link.places import Places
from trackfield.link.signals import Signals
from trackfield.role import NS

CAPTURE_DB: Final = 6.0
"""A frame survives if it is so much stronger than all that overlap it together: as for LoRa (Bor et al. 2016, "Do LoRa
low-power wide-area networks scale?"), and rather more than a CC2420 needs (Son, Krishnamachari and Heidemann 2006)."""
WINDOW_NS: Final = NS
"""The length of the busiest second."""

MUCH: Final = 0.05
"""If so many of all frames would have been lost besides, the losses of the model say nothing, however many it has."""
SOME: Final = 0.01
"""If the model loses so many frames on its links, and more would have been lost besides, these are the larger part."""
FEW: Final = 5.0
"""Fewer frames than that are no share to speak of."""
FULL: Final = 0.2
"""If the channel is in use for so much of a run, frames that wait and repeats, which the model leaves out as well, cost
5 % of the frames or more (``python -m tests.crowding``)."""


class Due(NamedTuple):
    """A frame, by its number, at one of those who it is for, and whether it was delivered there."""

    frame: int
    hearer: str
    delivered: bool


class Use(NamedTuple):
    """How much of the time some signal is on the air at a process: a share of the run and of its busiest second, which
    begins at ``peak_ns``.
    """

    id: str
    medium: str
    mean: float
    peak: float
    peak_ns: int


@dataclass(frozen=True)
class Air:
    """What was on the air at each process for which a frame was, and how many of the ``expected`` frames it hit.

    ``overlapped`` are those of which a transmission overlapped another one that is strong enough there to disturb it;
    of them, ``captured`` were stronger than all others together by ``CAPTURE_DB``, each time. ``deaf`` are frames
    during which their hearer was sending.

    ``spared`` are those that the model delivered, and that would have been lost: no transmission of them got through
    that was neither overlapped without capture nor met a deaf hearer. Where radios listen before they send, overlaps
    count that this would not have prevented: their senders do not hear each other, or began at nearly the same time.
    Where frames are repeated, their repeats are taken to be hit as often as all transmissions were. ``listens``: so do
    radios, on some medium.
    """

    uses: tuple[Use, ...] = ()
    expected: int = 0
    overlapped: int = 0
    captured: int = 0
    deaf: int = 0
    spared: float = 0.0
    listens: bool = False

    def plus(self, other: Air) -> Air:
        """Both together."""
        return Air(
            self.uses + other.uses,
            self.expected + other.expected,
            self.overlapped + other.overlapped,
            self.captured + other.captured,
            self.deaf + other.deaf,
            self.spared + other.spared,
            self.listens or other.listens,
        )

    @property
    def use_limit(self) -> float | None:
        """From which use on frames that wait make losses a fiction; None: radios do not listen, and none waits."""
        return FULL if self.listens else None


def flatters(spared: float, lost: float, expected: int, use_mean: float, use_limit: float | None = FULL) -> bool:
    """Whether what a model leaves out makes its losses a fiction: of so many frames it spares and loses so many, while
    the channel is in use for this share of the time, which has this limit.
    """
    many = spared >= MUCH * expected or spared > lost >= SOME * expected
    full = use_limit is not None and use_mean >= use_limit
    return full or (spared >= FEW and many)


def air_of(
    link: Link, places: Places, frames: Sequence[Transmission], dues: Iterable[Due], end_ns: int, at: Iterable[str] = ()
) -> Air | None:
    """What these frames were on all media with a radio, up to the end; None if there is no such medium.

    ``places`` are those of all processes. The figures do not depend on the order of the frames. How much the channel is
    used is said of those for whom there are ``dues``, and of those ``at`` whom it is wanted besides.
    """
    media: defaultdict[str, list[int]] = defaultdict(list)
    for number, frame in enumerate(frames):
        media[frame.medium].append(number)
    due: defaultdict[str, list[Due]] = defaultdict(list)
    for one in dues:
        due[frames[one.frame].medium].append(one)
    found: Air | None = None
    for medium, numbers in sorted(media.items()):
        signals = Signals.of(link, medium)
        if signals is not None and (due[medium] or at):
            sent = Sent.of(signals, frames, sorted(numbers, key=lambda n: frames[n]))
            found = (found or Air()).plus(_heard(signals, places, sent, due[medium], end_ns, at))
    return found


def _heard(
    signals: Signals, places: Places, sent: Sent, dues: Sequence[Due], end_ns: int, besides: Iterable[str]
) -> Air:
    """What these transmissions were to all for whom frames were."""
    at: defaultdict[str, list[Due]] = defaultdict(list, {id: [] for id in besides})
    for due in dues:
        at[due.hearer].append(due)
    near, blind_ns = Near(signals, places, sent), signals.radio.access.blind_ns
    clashes = None if blind_ns is None else Clashes.of(sent, near, blind_ns)
    overlaps = sent.after_begin, sent.after_end
    own, uses, judged = sent.own, list[Use](), list[_Judged]()
    for hearer, mine in sorted(at.items()):
        strength, me = near.strengths(hearer), sent.sender == sent.senders.get(hearer, -1)
        sums = (_Between(sent, what, *overlaps) for what in (strength > 0, strength, me))
        judged.append(_Judged.of(sent, mine, strength, me, own, clashes, *sums))
        uses.append(_use(sent, (strength > 0) | me, hearer, signals.medium, end_ns))
    flags = [np.concatenate([getattr(one, name) for one in judged]) for name in ("overlapped", "captured", "deaf")]
    overlapped, captured, deaf = (int(flag.sum()) for flag in flags)
    return Air(tuple(uses), len(dues), overlapped, captured, deaf, _spared(judged), blind_ns is not None)


class _Between:
    """Sums of a quantity (m,) of transmissions over those that overlap a given one."""

    def __init__(self, sent: Sent, quantity: NDArray[Any], lows: Ints, highs: Ints) -> None:
        self._begun = np.concatenate([[0], np.cumsum(quantity[sent.by_begin], dtype=np.int64)])
        self._over = np.concatenate([[0], np.cumsum(quantity[sent.by_end], dtype=np.int64)])
        self._lows, self._highs = lows, highs

    def at(self, which: Ints) -> Ints:
        """(n,) the sum for each of these transmissions, itself included."""
        sums: Ints = self._begun[self._lows[which]] - self._over[self._highs[which]]
        return sums


@dataclass(frozen=True)
class _Judged:
    """The n frames for one hearer. ``broken`` are those that were delivered, and would have needed another try; so
    many are ``left`` (n,). Of ``hits`` and misses in all its transmissions there are ``tried``.
    """

    overlapped: Flags
    captured: Flags
    deaf: Flags
    broken: Flags
    left: Ints
    hits: int
    tried: int

    @classmethod
    def of(
        cls, sent: Sent, dues: Sequence[Due], strength: Ints, me: Flags, own: Ints, clashes: Clashes | None,
        many: _Between, much: _Between, mine: _Between,
    ) -> _Judged:  # fmt: skip
        """By how many and how strong signals meet each transmission, and whether the hearer's ``mine`` do."""
        counts, firsts, tries = (
            np.array([known[due.frame] for due in dues], np.int64) for known in (sent.counts, sent.firsts, sent.tries)
        )
        row, which = np.repeat(np.arange(len(dues)), counts), sent.data[spans(firsts, counts)]
        level = strength[which]
        over = many.at(which) - own[which] * (level > 0) > 0
        weak = over & _weak(level, much.at(which) - own[which] * level)
        deaf = mine.at(which) > 0
        hit = weak | deaf
        if clashes is not None:
            one, other = clashes.of_each(which)
            others = np.zeros(len(which), np.int64)
            np.add.at(others, one, strength[other])
            hit = ((others > 0) & _weak(level, others)) | (np.bincount(one, me[other], len(which)) > 0)
        any_over, any_weak, any_deaf = (np.bincount(row, flag, len(dues)) > 0 for flag in (over, weak, deaf))
        parts = int(sent.part.max(initial=0)) + 1
        part, size = row * parts + sent.part[which], len(dues) * parts
        sent_so_often = np.bincount(part, minlength=size)
        clean = np.bincount(part, sent.sound[which] & ~hit, size) > 0
        lacking = ((sent_so_often > 0) & ~clean).reshape(-1, parts)
        most = (sent_so_often.reshape(-1, parts) * lacking).max(axis=1)
        broken = lacking.any(axis=1) & np.array([due.delivered for due in dues], bool)
        return cls(
            any_over, any_over & ~any_weak, any_deaf, broken, np.maximum(tries - most, 0), int(hit.sum()), len(hit)
        )


def _weak(level: Ints, others: Ints) -> Flags:
    """(n,) whether a signal is not captured among others that are so strong together."""
    return level < 10 ** (CAPTURE_DB / 10) * others


def _spared(judged: Sequence[_Judged]) -> float:
    """How many frames would have been lost, if repeats are hit as often as all transmissions were."""
    tried = sum(one.tried for one in judged)
    share = sum(one.hits for one in judged) / tried if tried else 0.0
    left = np.bincount(np.concatenate([one.left[one.broken] for one in judged]))
    return float(sum(count * share**tries for tries, count in enumerate(left.tolist())))


def _use(sent: Sent, audible: Flags, hearer: str, medium: str, end_ns: int) -> Use:
    """How much of the time any of these ``audible`` transmissions (m,) is on the air."""
    order = sent.by_begin[audible[sent.by_begin]]
    if not len(order):
        return Use(hearer, medium, 0.0, 0.0, 0)
    begin, top = sent.begin[order], np.maximum.accumulate(sent.end[order])
    gap = np.flatnonzero(begin[1:] > top[:-1])
    starts, stops = begin[np.concatenate([[0], gap + 1])], top[np.concatenate([gap, [len(top) - 1]])]
    starts, stops = np.minimum(starts, end_ns), np.minimum(stops, end_ns)
    before = np.concatenate([[0], np.cumsum(stops - starts)])
    edges, busy = np.ravel([starts, stops], "F"), np.ravel([before[:-1], before[1:]], "F")
    after = np.interp(starts + WINDOW_NS, edges, busy) - before[:-1]
    until = before[1:] - np.interp(stops - WINDOW_NS, edges, busy)
    begins, windows = np.concatenate([starts, np.maximum(stops - WINDOW_NS, 0)]), np.concatenate([after, until])
    most = int(np.argmax(windows))
    window_ns = min(WINDOW_NS, end_ns)
    return Use(hearer, medium, float(before[-1] / end_ns), float(windows[most] / window_ns), int(begins[most]))
