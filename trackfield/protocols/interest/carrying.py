"""How data goes from neighbour to neighbour: along reinforced paths and gradients, and by floods where these fail.

A process that takes a message acknowledges it. A neighbour that does not, twice, is passed over until it is heard
again: the message goes to the next neighbour that is no further from the sink, and after ``MOST_TURNS`` of them, or if
there are no more, to all neighbours and to theirs (``REPAIR``). Where such a flood ends, data goes on along gradients.
The sink has the message by another path then, and reinforces that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trackfield.draw import uniform
from trackfield.protocols.interest.interests import NUMBERS, Key
from trackfield.protocols.interest.state import Spread, Step
from trackfield.protocols.interest.timed import PATIENCE, Due
from trackfield.protocols.interest.traffic import CARRIED, LOOPED, SPREAD, Parcel
from trackfield.role import NEIGHBOURHOOD, CancelTimer, Effect, Ignored, Note, Received, Send, SetTimer
from trackfield.wire.codec import WireError, decode
from trackfield.wire.interests import Data, DataAck, Reinforce

MOST_TRIES: Final = 2
"""How often a message is sent to the same neighbour."""
MOST_TURNS: Final = 3
"""To how many neighbours in turn a message is sent before it is spread."""
MOST_HOPS: Final = 64
REPAIR: Final = 2
"""How many hops a flood makes that is to find another way."""


@dataclass(frozen=True)
class Carrier:
    """What process ``id`` does with data; see ``piece.Diffusion`` for the others."""

    id: str
    seed: int
    patience_ns: int
    hop_ns: int
    queue: int

    def own(self, state: Spread, now: int, key: Key, message: bytes) -> Step:
        """A message of this process for another one that wants it."""
        state, parcel = self.numbered(state, key, message)
        traffic, notes = state.traffic.noting(parcel, CARRIED).add(parcel, self.queue)
        return self.go(replace(state, traffic=traffic), now, notes)

    def numbered(self, state: Spread, key: Key, message: bytes) -> tuple[Spread, Parcel]:
        """The next own message."""
        serial = state.traffic.serial
        traffic = replace(state.traffic, serial=(serial + 1) % NUMBERS)
        return replace(state, traffic=traffic), Parcel(key, self.id, serial, 0, message)

    # --- data comes ----------------------------------------------------------------------------------------------

    def came(self, state: Spread, now: int, data: Data, sender: str) -> Step:
        """Data from a neighbour, to this process alone or to all."""
        try:
            parcel = Parcel.of(data, sender)
        except WireError as error:
            return Step(state, (Ignored(error.reason),))
        if self.id in (parcel.origin, sender):
            return Step(state, (Ignored("unexpected"),))
        if parcel.key[0] == self.id:
            return self._at_sink(state, now, parcel, spread=data.spread)
        if state.interests.at(now, parcel.key) is None:
            return Step(state, (Ignored("no interest"),))
        return self._flooded(state, now, parcel, data.spread) if data.spread else self._taken(state, now, parcel)

    def _at_sink(self, state: Spread, now: int, parcel: Parcel, *, spread: int) -> Step:
        ack: tuple[Effect, ...] = () if spread else (self._ack(parcel),)
        if state.traffic.was(parcel):
            return Step(state, (*ack, Ignored("repeated")))
        state = replace(state, traffic=state.traffic.noting(parcel, CARRIED))
        if parcel.key[1] not in state.timed.own:
            return Step(state, (*ack, Ignored("outdated")))
        if spread or state.paths.onward.get(parcel.flow) != parcel.via:
            paths, _ = state.paths.reinforced(parcel.flow, parcel.via)
            state, ack = replace(state, paths=paths), (*ack, self._reinforce(parcel.key, parcel.origin, parcel.via))
        if not parcel.message:
            return Step(state, ack)
        try:
            message = decode(parcel.message)
        except WireError as error:
            return Step(state, (*ack, Ignored(error.reason)))
        return Step(state, ack, (Received(now, message, parcel.origin),))

    def _flooded(self, state: Spread, now: int, parcel: Parcel, spread: int) -> Step:
        """Data for all: it is handed on to all once, or where its flood ends, along a gradient.

        An empty message, by which an origin says where it is, goes on only where it may reach the sink.
        """
        was, entry = state.traffic.was(parcel), state.interests.known[parcel.key]
        if was & SPREAD or parcel.hops >= MOST_HOPS:
            return Step(state, (Ignored("repeated" if was else "too many hops"),))
        paths = state.paths if was else state.paths.by(parcel.flow, parcel.via)
        state = Spread(state.interests, paths, state.traffic.noting(parcel, SPREAD), state.timed)
        left = spread - 1
        if parcel.message and not was and entry.nearer(parcel.via):
            return self._queued(state, now, parcel, ())
        if left and (parcel.message or entry.hops <= left):
            key = (self.id, "interest", "data", parcel.origin, parcel.serial)
            due = Due(now + int(self.hop_ns * uniform(self.seed, *key)), parcel.key, parcel, left)
            return Step(replace(state, timed=state.timed.later(due)))
        if was or left or not parcel.message:
            return Step(state)
        return self._queued(state, now, parcel, ())

    def _taken(self, state: Spread, now: int, parcel: Parcel) -> Step:
        """Data for this process: it takes it if it knows another neighbour than the one it came from."""
        traffic, looped = state.traffic, state.traffic.returns(parcel)
        was = traffic.was(parcel)
        if was & CARRIED and not looped:
            return Step(state, (self._ack(parcel), Ignored("repeated")))
        if looped:
            state, traffic = replace(state, paths=state.paths.broken(parcel.flow)), traffic.noting(parcel, LOOPED)
        if not self._ways(state, now, parcel):
            return Step(state, (Ignored("no way"),))
        if parcel.hops >= MOST_HOPS or len(traffic.queue) >= self.queue:
            return Step(state, (Ignored("too many hops" if parcel.hops >= MOST_HOPS else "queue full"),))
        paths = state.paths if was else state.paths.by(parcel.flow, parcel.via)
        return self._queued(replace(state, paths=paths, traffic=traffic), now, parcel, (self._ack(parcel),))

    def _queued(self, state: Spread, now: int, parcel: Parcel, effects: tuple[Effect, ...]) -> Step:
        traffic, notes = state.traffic.noting(parcel, CARRIED).add(parcel, self.queue)
        return self.go(replace(state, traffic=traffic), now, (*effects, *notes))

    def reinforced(self, state: Spread, now: int, message: Reinforce, sender: str) -> Step:
        """A neighbour wants data of an origin, and so does this process then of the one it has it from."""
        try:
            parcel = Parcel.of(Data(message.sink, message.number, message.origin, 0, 0, 0, b""), sender)
        except WireError as error:
            return Step(state, (Ignored(error.reason),))
        if state.interests.at(now, parcel.key) is None:
            return Step(state, (Ignored("no interest"),))
        own = parcel.origin == self.id
        if not own and parcel.flow not in state.paths.came:
            return Step(state, (Ignored("unexpected"),))
        paths, back = state.paths.reinforced(parcel.flow, sender)
        told = () if own else (self._reinforce(parcel.key, parcel.origin, back),)
        return Step(replace(state, paths=paths), told)

    # --- data goes -----------------------------------------------------------------------------------------------

    def go(self, state: Spread, now: int, effects: tuple[Effect, ...] = ()) -> Step:
        """Send the first message that waits, unless one is under way; ``effects`` come before."""
        while state.traffic.queue and not state.traffic.next:
            traffic, first = state.traffic, state.traffic.queue[0]
            ways = [one for one in self._ways(state, now, first) if one not in traffic.tried]
            if ways and len(traffic.tried) < MOST_TURNS:
                return self._try(state, now, ways[0], effects)
            if state.interests.at(now, first.key) is None:
                traffic, notes = traffic.drop("nobody wants it any longer")
                effects = (*effects, *notes)
            elif traffic.was(first) & SPREAD:
                traffic, notes = traffic.drop("no neighbour takes it, and it was spread before")
                effects = (*effects, *notes)
            else:
                traffic = traffic.noting(first, SPREAD).done()
                note = Note(f"message {first.serial} of {first.origin} is spread: no neighbour takes it")
                effects = (*effects, Send(first.data(REPAIR), NEIGHBOURHOOD), note)
            state = replace(state, traffic=traffic)
        return Step(state, effects)

    def _ways(self, state: Spread, now: int, parcel: Parcel) -> tuple[str, ...]:
        """The neighbours by which a message may go, the best first."""
        entry = state.interests.at(now, parcel.key)
        if entry is None:
            return ()
        onward = state.paths.onward.get(parcel.flow)
        known = (*((onward,) if onward else ()), *entry.ways(now, state.paths.silent, parcel.via))
        return tuple(one for one in dict.fromkeys(known) if one not in (parcel.via, parcel.origin))

    def _try(self, state: Spread, now: int, to: str, effects: tuple[Effect, ...]) -> Step:
        """Send the first message to this neighbour, once more or for the first time."""
        traffic = state.traffic
        first, tries = traffic.queue[0], traffic.tries + 1 if to == traffic.next else 1
        key = (self.id, "interest", "again", first.origin, first.serial, len(traffic.tried), tries)
        until = now + int(self.patience_ns * (1 + 0.5 * uniform(self.seed, *key)))
        state = replace(state, traffic=replace(traffic, next=to, tries=tries))
        return Step(state, (*effects, Send(first.data(), to), SetTimer(PATIENCE, until)))

    def acknowledged(self, state: Spread, now: int, ack: DataAck, sender: str) -> Step:
        """A neighbour has the message that is under way, be it one that was given up too soon."""
        traffic = state.traffic
        first = traffic.queue[0] if traffic.next else None
        if first is None or sender not in (traffic.next, *traffic.tried):
            return Step(state, (Ignored("outdated"),))
        if (ack.origin, ack.serial) != (first.origin.encode(), first.serial):
            return Step(state, (Ignored("outdated"),))
        return self.go(replace(state, traffic=traffic.done()), now, (CancelTimer(PATIENCE),))

    def unanswered(self, state: Spread, now: int) -> Step:
        """Nobody acknowledged the first message in time: it is sent again, or to another neighbour."""
        traffic = state.traffic
        if traffic.tries < MOST_TRIES:
            return self._try(state, now, traffic.next, ())
        paths = state.paths.lost(traffic.next)
        traffic = replace(traffic, next="", tries=0, tried=(*traffic.tried, traffic.next))
        return self.go(replace(state, paths=paths, traffic=traffic), now)

    def _ack(self, parcel: Parcel) -> Send:
        return Send(DataAck(parcel.origin.encode(), parcel.serial), parcel.via)

    def _reinforce(self, key: Key, origin: str, to: str) -> Send:
        return Send(Reinforce(key[0].encode(), key[1], origin.encode()), to)
