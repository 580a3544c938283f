"""Who led when, as the frames and the points of a run tell it: terms, how they began, and hand-overs that were lost.

All of it is in the tables of a run folder too, so a report finds what the recorder found.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from launcher.records import MessageRow
from trackfield.wire.clusters import HandOver, HandOverAck, Merge, Share, Wake
from trackfield.wire.codec import decoded
from trackfield.wire.peers import Claim, Dissolve, HeadEstimate, Poll, Result

KINDS: Final = frozenset(
    {"wake", "merge", "share", "hand-over", "hand-over-ack", "claim", "poll", "result", "estimate", "dissolve"}
)
"""The kinds of message that say who leads, or wants to."""
START: Final = "start"
HAND_OVER: Final = "hand-over"
TAKE_OVER: Final = "take-over"
ELECTION: Final = "election"
MOST_NS: Final = 1 << 62
"""Beyond any instant of a run."""
Key = tuple[int, str]
"""A term: its number, and who leads."""
Life = tuple[str, int]
"""A process and which life of it."""


class Point(NamedTuple):
    """That a process published a point of a track of its own, in a term, at ``told_ns``."""

    source: str
    incarnation: int
    term: int
    told_ns: int


class Turn(NamedTuple):
    """A term that began, and was first seen at ``begun_ns``; ``how``: by a hand-over, an election, or by itself.

    A ``TAKE_OVER`` is one that began by itself while an earlier term was not over. It, or an ``ELECTION`` at such a
    time, is ``false`` if the leader of that one lived on.
    """

    number: int
    leader: str
    begun_ns: int
    how: str
    false: bool = False


class Lost(NamedTuple):
    """A hand-over that was sent at ``sent_ns``, and whose term never began at the process that it was for."""

    sent_ns: int
    number: int
    src: str
    dst: str


class Claimed(NamedTuple):
    """That process ``src`` claimed to lead in the term of this number, with which ``key``."""

    sent_ns: int
    number: int
    src: str
    key: int


@dataclass
class Seen:
    """What frames and points say: when each term was seen first, and in which life of its leader; ``until`` when.

    ``acks`` are the terms that were acknowledged, ``offers`` the hand-overs that were sent, ``claims`` those to lead.
    ``polls`` and ``words`` are when a head first polled sensors in a term, and first said what it knew.
    ``over`` is when a leader said that its term is over, and ``last`` when each life sent or published something last.
    """

    first: dict[Key, tuple[int, int]] = field(default_factory=dict)
    until: dict[Key, int] = field(default_factory=dict)
    claims: set[Claimed] = field(default_factory=set)
    polls: dict[Key, int] = field(default_factory=dict)
    words: dict[Key, int] = field(default_factory=dict)
    acks: set[Key] = field(default_factory=set)
    offers: set[Lost] = field(default_factory=set)
    over: dict[Key, int] = field(default_factory=dict)
    last: dict[Life, int] = field(default_factory=dict)

    def led(self, number: int, leader: str, at_ns: int, incarnation: int) -> None:
        """This process led in this term."""
        key = number, leader
        self.first[key] = min(self.first.get(key, (at_ns, incarnation)), (at_ns, incarnation))
        self.until[key] = max(self.until.get(key, at_ns), at_ns)

    def lives(self, id: str, incarnation: int, at_ns: int) -> None:
        """This process was alive."""
        self.last[id, incarnation] = max(self.last.get((id, incarnation), at_ns), at_ns)

    def frame(self, row: MessageRow, message: Any) -> None:
        """A process sent a frame of one of the ``KINDS``."""
        match message:
            case HandOver(number=number):
                self.offers.add(Lost(row.sent_ns, number, row.src, row.dst))
            case HandOverAck(number=number):
                self.acks.add((number, row.src))
                self.led(number, row.src, row.sent_ns, row.incarnation)
            case Share(number=number, beliefs=b"") | Dissolve(number=number):
                self.over.setdefault((number, row.src), row.sent_ns)
            case Claim(number=number, key=key):
                self.claims.add(Claimed(row.sent_ns, number, row.src, key))
            case Wake(number=number, leader=leader) if leader.decode("ascii", "replace") != row.src or not number:
                pass
            case Wake(number=number) | Merge(number=number) | Share(number=number):
                self.led(number, row.src, row.sent_ns, row.incarnation)
            case Poll(number=number) | Result(number=number) | HeadEstimate(number=number):
                self.led(number, row.src, row.sent_ns, row.incarnation)
                times = self.polls if isinstance(message, Poll) else self.words
                times[number, row.src] = min(times.get((number, row.src), row.sent_ns), row.sent_ns)

    def elected(self) -> set[Key]:
        """The terms that began by an election: of those who claimed to lead in them.

        One that was handed the term acknowledged that. One that takes over says at once what it knows, before it polls.
        """
        claimed = {(claim.number, claim.src) for claim in self.claims} & self.first.keys() - self.acks
        return {key for key in claimed if key not in self.words or self.polls.get(key, MOST_NS) <= self.words[key]}


def seen(frames: Iterable[MessageRow], points: Iterable[Point]) -> Seen:
    """What is to be known of the terms of a run; of the frames all count as signs of life."""
    found = Seen()
    for row, message in said(frames, found):
        found.frame(row, message)
    for one in points:
        found.lives(one.source, one.incarnation, one.told_ns)
        if one.term:
            found.led(one.term, one.source, one.told_ns, one.incarnation)
    return found


def said(frames: Iterable[MessageRow], found: Seen | None = None) -> Iterable[tuple[MessageRow, Any]]:
    """The frames of these ``KINDS`` with their messages, a broadcast once for each hearer."""
    known: dict[bytes, Any] = {}
    for row in frames:
        if found is not None:
            found.lives(row.src, row.incarnation, row.sent_ns)
        if row.kind not in KINDS:
            continue
        if row.payload not in known:
            known[row.payload] = decoded(row.payload)
        if known[row.payload] is not None:
            yield row, known[row.payload]


def turns(found: Seen) -> list[Turn]:
    """The terms in the order in which they began."""
    ordered = sorted(found.first, key=lambda key: (found.first[key][0], key))
    elected = found.elected()
    return [_turn(found, ordered[:index], key, elected=key in elected) for index, key in enumerate(ordered)]


def _turn(found: Seen, before: Sequence[Key], key: Key, *, elected: bool) -> Turn:
    begun_ns = found.first[key][0]
    if key in found.acks:
        return Turn(*key, begun_ns, HAND_OVER)
    running = [one for one in before if one < key and found.over.get(one, begun_ns) >= begun_ns]
    if not running:
        return Turn(*key, begun_ns, ELECTION if elected else START)
    old = max(running)
    life = old[1], found.first[old][1]
    false = old[1] != key[1] and found.last.get(life, -1) >= begun_ns
    return Turn(*key, begun_ns, ELECTION if elected else TAKE_OVER, false)


def lost_hand_overs(found: Seen) -> list[Lost]:
    """Those whose term never began at the process that they were for, in the order of sending."""
    return sorted(one for one in found.offers if (one.number, one.dst) not in found.acks)
