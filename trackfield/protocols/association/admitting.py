"""The master's side of association: it announces itself, admits slaves up to its capacity, and keeps their list.

A member is kept as long as it is heard of: any message of it renews its place. One that was told to report and is
silent for ``MOST_SILENT`` steps in a row, or is not heard of for ``keep_ns``, has left. Other masters are told of each
change of the list (``Roster``), ``TOLD`` times, as any of these messages may be lost.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import msgpack

from trackfield.draw import uniform
from trackfield.protocols.association.joining import NO_PLACE
from trackfield.role import (
    NEIGHBOURHOOD,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.clusters import Admit, Announce, Join, Roster, Solicit
from trackfield.wire.listed import packed

MOST_SILENT: Final = 5
"""Steps in a row in which a member may be silent although it was told to report."""
TOLD: Final = 3
"""How often a list is told."""
KINDS: Final = frozenset({"join", "solicit"})
TIMERS: Final = frozenset({"announce", "solicited", "roster"})


@dataclass(frozen=True, slots=True)
class Member:
    """A slave's ``place`` in the list, when it was last ``heard`` of (ns), and for how many steps it is ``silent``."""

    place: int
    heard: int
    silent: int = 0


@dataclass(frozen=True, slots=True)
class Members:
    """The members by id; how often the master ``announced`` itself, and how often it still has to tell its list."""

    list: Mapping[str, Member] = field(default_factory=dict)
    announced: int = 0
    untold: int = 0
    answering: bool = False

    @property
    def ids(self) -> tuple[str, ...]:
        """The members in the order of their places."""
        return tuple(sorted(self.list, key=lambda id: self.list[id].place))


Step = tuple[Members, tuple[Effect, ...]]


@dataclass(frozen=True)
class Admitting:
    """How the master ``id`` at ``x_m``, ``y_m`` admits slaves, ``capacity`` at most; ``sensors`` are all of the field.

    It makes ``announcements`` in the first ``announce_ns`` of a run, in turn with the others: its turn comes at this
    ``share`` of each round. Until ``setup_ns`` its answers are for all to hear; then it tells its list, in such rounds.
    It answers who asks who is there within ``answers_ns``.
    """

    id: str
    x_m: float
    y_m: float
    capacity: int
    sensors: Sequence[str]
    seed: int
    share: float
    announcements: int
    announce_ns: int
    answers_ns: int
    setup_ns: int
    keep_ns: int

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The numbers of the sensors by id."""
        return {id: number for number, id in enumerate(self.sensors)}

    def begin(self) -> Members:
        """A master that has not started."""
        return Members()

    def handle(self, members: Members, event: Event) -> Step:
        """What it does with an event. Raises ``IllegalEvent`` for one that is not its own."""
        match event:
            case Started(now):
                return self._start(members, now)
            case Received(now, Join() | Solicit() as asks, sender):
                members, told = self._left(members, now, self._forgotten(members, now) - {sender})
                members, answer = self._asked(members, now, asks, sender)
                return members, (*told, *answer)
            case Timer(now, name):
                return self._ring(members, now, name)
        raise IllegalEvent(f"association cannot handle {event}")

    def _ring(self, members: Members, now: int, timer: str) -> Step:
        match timer:
            case "announce":
                return self._announce(members)
            case "solicited":
                return replace(members, answering=False), (self._here(members, 0, 0),)
            case "roster":
                return self._tell(members, now)
        raise IllegalEvent(f"association has no timer {timer!r}")

    def free(self, members: Members) -> int:
        """How many places are left."""
        return self.capacity - len(members.list)

    # --- what a life leaves to the next --------------------------------------------------------------------------

    def pack(self, members: Members) -> bytes:
        """The list, to be stored."""
        packed: bytes = msgpack.packb({id: one.place for id, one in members.list.items()})
        return packed

    def unpack(self, members: Members, data: bytes, now: int) -> Members:
        """With the list that another life stored. Raises ``ValueError`` for other bytes."""
        try:
            places = msgpack.unpackb(data)
        except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
            raise ValueError(f"not MessagePack: {error}") from None
        good = type(places) is dict and all(
            id in self.numbers and type(place) is int and 0 <= place < self.capacity for id, place in places.items()
        )
        if not good or len(set(places.values())) < len(places):
            raise ValueError("not a list of members")
        return replace(members, list={id: Member(place, now) for id, place in places.items()}, untold=TOLD)

    # --- slaves come and go --------------------------------------------------------------------------------------

    def heard(self, members: Members, now: int, id: str) -> Members:
        """After a message of a member."""
        if id not in members.list:
            return members
        renewed = replace(members.list[id], heard=now, silent=0)
        return replace(members, list={**members.list, id: renewed})

    def judged(self, members: Members, now: int, told: Iterable[str], reported: Collection[str]) -> Step:
        """After a step for which these were told to report and these did: who was silent for too long has left."""
        listed = dict(members.list)
        for id in told:
            if id in listed and id not in reported:
                listed[id] = replace(listed[id], silent=listed[id].silent + 1)
        silent = {id for id, one in listed.items() if one.silent >= MOST_SILENT}
        return self._left(replace(members, list=listed), now, silent | self._forgotten(members, now))

    def _forgotten(self, members: Members, now: int) -> set[str]:
        """Those that were not heard of for too long."""
        return {id for id, one in members.list.items() if now - one.heard > self.keep_ns}

    def _left(self, members: Members, now: int, gone: Collection[str]) -> Step:
        if not gone:
            return members, ()
        listed = {id: one for id, one in members.list.items() if id not in gone}
        return self._changed(replace(members, list=listed), now)

    def _changed(self, members: Members, now: int) -> Step:
        """The list is other than what was told."""
        if now < self.setup_ns:
            return members, ()
        return replace(members, untold=TOLD), (SetTimer("roster", now + self._share(now, "roster")),)

    # --- announcements -------------------------------------------------------------------------------------------

    def _start(self, members: Members, now: int) -> Step:
        told = SetTimer("roster", max(now, self.setup_ns) + self._turn_ns)
        if now >= self.announce_ns:
            return replace(members, untold=TOLD), (told,)
        return replace(members, untold=TOLD), (told, self._next(members))

    @property
    def _round_ns(self) -> int:
        """How long it takes until all masters have announced themselves once."""
        return self.announce_ns // self.announcements

    @property
    def _turn_ns(self) -> int:
        """From the beginning of a round to its own turn."""
        return int(self._round_ns * self.share)

    def _next(self, members: Members) -> SetTimer:
        """The timer of the next announcement."""
        return SetTimer("announce", self._round_ns * members.announced + self._turn_ns)

    def _announce(self, members: Members) -> Step:
        after = replace(members, announced=members.announced + 1)
        here = self._here(members, after.announced, self.announcements)
        return after, (here, self._next(after)) if after.announced < self.announcements else (here,)

    def _here(self, members: Members, number: int, of: int) -> Send:
        return Send(Announce(number, of, self.free(members), self.x_m, self.y_m), NEIGHBOURHOOD)

    def _solicited(self, members: Members, now: int, sender: str) -> Step:
        if members.answering or not (self.free(members) or sender in members.list):
            return members, ()
        return replace(members, answering=True), (SetTimer("solicited", now + self._share(now, "solicited")),)

    def _tell(self, members: Members, now: int) -> Step:
        """Tell the list to other masters; again after some time, as the message may be lost."""
        after = replace(members, untold=max(members.untold - 1, 0))
        roster = Send(Roster(packed(self.numbers[id] for id in members.ids)), NEIGHBOURHOOD)
        if not after.untold:
            return after, (roster,)
        return after, (roster, SetTimer("roster", now + self._round_ns))

    def _share(self, now: int, what: str) -> int:
        """A time of its own below ``answers_ns``, so that masters do not answer at the same time."""
        return int(0.8 * self.answers_ns * uniform(self.seed, self.id, what, now))

    # --- requests ------------------------------------------------------------------------------------------------

    def _asked(self, members: Members, now: int, asks: Join | Solicit, sender: str) -> Step:
        return (
            self._join(members, now, asks, sender) if isinstance(asks, Join) else self._solicited(members, now, sender)
        )

    def _join(self, members: Members, now: int, join: Join, sender: str) -> Step:
        if self.numbers.get(sender) != join.sensor:
            return members, (Ignored("unknown sensor"),)
        if sender in members.list:
            members = self.heard(members, now, sender)
            return members, (self._answer(members, now, join, sender),)
        if not self.free(members):
            return members, (self._answer(members, now, join, sender),)
        taken = {one.place for one in members.list.values()}
        place = next(place for place in range(self.capacity) if place not in taken)
        admitted = replace(members, list={**members.list, sender: Member(place, now)})
        admitted, told = self._changed(admitted, now)
        return admitted, (self._answer(admitted, now, join, sender), *told)

    def _answer(self, members: Members, now: int, join: Join, sender: str) -> Send:
        place = members.list[sender].place if sender in members.list else NO_PLACE
        answer = Admit(join.sensor, place, self.free(members))
        return Send(answer, NEIGHBOURHOOD if now < self.setup_ns else sender)
