"""Any role of the backbone, with its messages going over several hops where their receiver is no neighbour.

A table (``next``) says to which neighbour a message goes for whom; the role sends and gets messages as if all were its
neighbours. Between neighbours messages go as they are. A message for another process travels in a *parcel* (kind
``carried``), which each process on its way hands on, in order, some time after it came. No parcel is acknowledged: what
must arrive is sent again by the role that sent it. A parcel that comes again soon, or too far, is ignored, so none goes
round for ever.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from trackfield.protocols.interest.interests import id_of
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Received,
    Role,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.codec import WireError, decode, encode, kind_name
from trackfield.wire.keys import Medium
from trackfield.wire.outside import ITEMS
from trackfield.wire.outside import Carried as Parcel

BACKBONE: Final[Medium] = "backbone"
DUE: Final = "carried"
"""The timer at which the first of those that are held goes on."""
MOST_HELD: Final = 32
MOST_HOPS: Final = 32
REMEMBERED: Final = 64
"""A process remembers so many parcels."""
REMEMBERED_NS: Final = 30 * NS
"""For so long: an origin that starts again may use the same numbers."""
MS: Final = NS // 1000


class Seen(NamedTuple):
    """A parcel was here at local time ``at_ns``."""

    origin: bytes
    number: int
    at_ns: int


class Held(NamedTuple):
    """A parcel goes on at local time ``due_ns``."""

    due_ns: int
    parcel: Parcel


@dataclass(frozen=True, slots=True)
class Wrapped:
    """The state of the role, the number of the last parcel of this process, what is held, and what was here."""

    role: Any
    number: int = 0
    held: tuple[Held, ...] = ()
    seen: tuple[Seen, ...] = ()


Step = tuple[Wrapped, tuple[Effect, ...]]


class Carried:
    """The ``role`` of process ``id``; what it hands on it holds for ``hold_ns``.

    Parcels are numbered from the time of the start on, in ms: so the numbers of two lives differ.
    """

    def __init__(self, role: Role[Any], *, id: str, next: Mapping[str, str], hold_ns: int = 0) -> None:
        self.role, self.id, self.next, self.hold_ns = role, id, dict(next), hold_ns
        self.kinds = frozenset(role.kinds) | {"carried"}
        self.follows = bool(getattr(role, "follows", False))

    def begin(self) -> Wrapped:
        """The state before ``Started``."""
        return Wrapped(self.role.begin())

    def handle(self, state: Wrapped, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        match event:
            case Started(now):
                return self._told(Wrapped(state.role, number=now // MS % ITEMS), event)
            case Received(_, Parcel() as parcel):
                return self._came(state, event, parcel)
            case Timer(now, "carried"):
                return self._due(state, now)
        return self._told(state, event)

    # --- parcels -------------------------------------------------------------------------------------------------

    def _came(self, state: Wrapped, event: Received, parcel: Parcel) -> Step:
        """A parcel from a neighbour, for this process or for another one."""
        if why := self._unfit(event, parcel):
            return state, (Ignored(why),)
        recent = tuple(one for one in state.seen if event.now - one.at_ns < REMEMBERED_NS)
        if any((one.origin, one.number) == (parcel.origin, parcel.number) for one in recent):
            return replace(state, seen=recent), (Ignored("repeated"),)
        seen = Seen(parcel.origin, parcel.number, event.now)
        state = replace(state, seen=(*recent, seen)[-REMEMBERED:])
        if parcel.destination.decode() == self.id:
            return self._opened(state, event, parcel)
        return self._taken(state, event.now, replace(parcel, hops=parcel.hops + 1))

    def _unfit(self, event: Received, parcel: Parcel) -> str:
        """Why a parcel is of no use; empty: it is."""
        try:
            origin, destination = id_of(parcel.origin), id_of(parcel.destination)
        except WireError as error:
            return error.reason
        if event.medium != BACKBONE:
            return "unexpected"
        if origin not in self.next or (destination != self.id and destination not in self.next):
            return "no way"
        return "too many hops" if parcel.hops >= MOST_HOPS else ""

    def _opened(self, state: Wrapped, event: Received, parcel: Parcel) -> Step:
        """The role gets what a parcel carries, as if its origin were next to it."""
        try:
            message = decode(parcel.message)
        except WireError as error:
            return state, (Ignored(error.reason),)
        if kind_name(message) not in self.role.kinds:
            return state, (Ignored("unexpected"),)
        return self._told(state, replace(event, message=message, sender=parcel.origin.decode()))

    def _taken(self, state: Wrapped, now: int, parcel: Parcel) -> Step:
        """A parcel that goes on, now or after it was held; of too many the oldest is dropped."""
        if not self.hold_ns:
            return state, (self._on(parcel),)
        held, effects = state.held, tuple[Effect, ...]()
        if len(held) >= MOST_HELD:
            effects = (Note(f"a message of {_text(held[0].parcel)} is dropped: {MOST_HELD} wait already"),)
            held = held[1:]
        due_ns = max(now + self.hold_ns, held[-1].due_ns if held else 0)
        held = (*held, Held(due_ns, parcel))
        return replace(state, held=held), (*effects, SetTimer(DUE, held[0].due_ns))

    def _due(self, state: Wrapped, now: int) -> Step:
        """What was held for long enough goes on."""
        if not state.held:
            raise IllegalEvent(f"{self.id} holds no message")
        ripe = [one for one in state.held if one.due_ns <= now]
        left = state.held[len(ripe) :]
        again = (SetTimer(DUE, left[0].due_ns),) if left else ()
        return replace(state, held=left), (*(self._on(one.parcel) for one in ripe), *again)

    def _on(self, parcel: Parcel) -> Send:
        return Send(parcel, self.next[parcel.destination.decode()], BACKBONE)

    # --- the role ------------------------------------------------------------------------------------------------

    def _told(self, state: Wrapped, event: Event) -> Step:
        """The role handles an event."""
        role, asked = self.role.handle(state.role, event)
        number, effects = state.number, list[Effect]()
        for effect in asked:
            if isinstance(effect, Send) and effect.medium == BACKBONE and effect.to != NEIGHBOURHOOD:
                sent = list(self._sent(effect, number))
                number = (number + sum(isinstance(one.message, Parcel) for one in sent)) % ITEMS
                effects += sent
            else:
                effects.append(effect)
        return replace(state, role=role, number=number), tuple(effects)

    def _sent(self, send: Send, number: int) -> Iterator[Send]:
        """What the role sends, as it leaves: to neighbours as it is, to others in parcels, numbered on."""
        ids = frozenset({send.to}) if isinstance(send.to, str) else send.to
        far = sorted(id for id in ids if self.next.get(id, id) != id)
        if len(far) < len(ids):
            yield send if not far else replace(send, to=ids.difference(far))
        for i, id in enumerate(far, 1):
            message = encode(send.message)
            yield self._on(Parcel(self.id.encode(), id.encode(), (number + i) % ITEMS, 0, message))


def _text(parcel: Parcel) -> str:
    """From whom a parcel is, and for whom."""
    return f"{parcel.origin.decode()} for {parcel.destination.decode()}"
