"""Collection: messages of all processes of a field to a base, over several hops, and the base's answers back.

The tree is built and mended by frames alone: beacons (``routes``), from which and from acknowledgements each process
learns how good its links are (``links``), and the messages themselves (``traffic``). A message goes to the parent until
it is acknowledged, three times at most; then the parent is lost, and it goes to the next best at once. A process
without any way keeps its messages, the newest if they are too many, and asks its neighbours.

An answer takes the way back by which the last message of its receiver came: each process remembers from which neighbour
that was.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

from trackfield.draw import bits, uniform
from trackfield.protocols.collection.routes import NUMBERS, Router, Routes
from trackfield.protocols.collection.traffic import MOST_HOPS, MOST_TRIES, MOST_TURNS, Parcel, Traffic
from trackfield.role import (
    NS,
    CancelTimer,
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
from trackfield.wire.codec import WireError, decode, encode
from trackfield.wire.messages import Hop, HopAck, Route

KINDS: Final = ("route", "hop", "hop-ack")
LEAST_NS: Final = NS // 4
MOST_NS: Final = 32 * NS
"""The intervals of beacons, at first and at last."""
PATIENCE_NS: Final = NS // 20
QUEUE: Final = 16
SPREAD_NS: Final = NS


@dataclass(frozen=True, slots=True)
class Tree:
    """What a process knows of the tree, and what it has to hand on."""

    routes: Routes = field(default_factory=Routes)
    traffic: Traffic = field(default_factory=Traffic)


class Step(NamedTuple):
    """What an event leads to; ``arrived`` is a message that was for this process, from its origin."""

    tree: Tree
    effects: tuple[Effect, ...] = ()
    arrived: Received | None = None


class Collection:
    """A protocol piece: process ``id`` in a tree to the ``base``. If it is that itself, it is the root.

    The role that it is part of keeps its ``Tree``, gives it ``Started``, its timers and the frames of its
    ``kinds``, sends by ``send``, and takes what ``arrived``. Its receiver has to be on all the time.

    Beacons come every ``least_ns`` to ``most_ns``. A process waits for an acknowledgement for ``patience_ns`` to one
    and a half times that. At most ``queue`` messages wait. One that ``announces`` itself sends the base an empty
    message when it has a new parent, so that the base can answer before it has anything to say.
    """

    kinds: Final = frozenset(KINDS)

    def __init__(
        self,
        *,
        id: str,
        base: str,
        seed: int,
        least_ns: int = LEAST_NS,
        most_ns: int = MOST_NS,
        patience_ns: int = PATIENCE_NS,
        queue: int = QUEUE,
        announces: bool = False,
    ) -> None:
        self.router = Router(id, base, seed, least_ns, most_ns)
        self.id, self.root, self.seed = id, id == base, seed
        self.patience_ns, self.queue, self.announces = patience_ns, queue, announces and id != base

    def begin(self) -> Tree:
        """A process that has not started."""
        return Tree()

    def handle(self, tree: Tree, event: Event) -> Step:
        """What it does with an event. Raises ``IllegalEvent`` for one that is not its own."""
        step = self._react(tree, event)
        if self.announces and step.tree.routes.parent not in ("", tree.routes.parent):
            share = uniform(self.seed, self.id, "announce", step.tree.routes.number)
            timer = SetTimer("announce", event.now + int(SPREAD_NS * share))
            return step._replace(effects=(*step.effects, timer))
        return step

    def send(self, tree: Tree, now: int, message: Any, to: str = "") -> Step:
        """Send a message: to the base, or from there ``to`` a process."""
        return self._sent(tree, now, encode(message), to)

    def _react(self, tree: Tree, event: Event) -> Step:
        match event:
            case Started(now):
                routes, effects = self.router.start(tree.routes, now)
                number = bits(self.seed, self.id, "hop", "first", now) % NUMBERS
                return Step(Tree(routes, replace(tree.traffic, number=number)), effects)
            case Timer(now, name):
                return self._ring(tree, now, name)
            case Received():
                return self._receive(tree, event)
        raise IllegalEvent(f"collection cannot handle {event}")

    def _ring(self, tree: Tree, now: int, timer: str) -> Step:
        match timer:
            case "beacon":
                routes, effects = self.router.tell(tree.routes, now)
                return Step(replace(tree, routes=routes), effects)
            case "patience" if tree.traffic.next:
                return self._unanswered(tree, now)
            case "announce" if self.announces:
                return self._sent(tree, now, b"", "")
        raise IllegalEvent(f"collection has no timer {timer!r} now")

    def _receive(self, tree: Tree, event: Received) -> Step:
        match event:
            case Received(sender=self.id):
                return Step(tree, (Ignored("unexpected"),))
            case Received(now, Route() as route, sender):
                routes, effects = self.router.hear(tree.routes, now, route, sender)
                return self._go(replace(tree, routes=routes), now, effects)
            case Received(now, HopAck(origin, number), sender):
                return self._answered(tree, now, (origin, number), sender)
            case Received(now, Hop() as hop, sender):
                return self._came(tree, now, hop, sender)
        return Step(tree, (Ignored("unexpected"),))

    # --- messages come -------------------------------------------------------------------------------------------

    def _sent(self, tree: Tree, now: int, message: bytes, to: str) -> Step:
        traffic = tree.traffic
        parcel = Parcel(self.id, traffic.number, 0, to, message)
        traffic = replace(traffic.remembering(parcel), number=(traffic.number + 1) % NUMBERS)
        traffic, notes = traffic.add(parcel, self.queue)
        return self._go(replace(tree, traffic=traffic), now, notes)

    def _came(self, tree: Tree, now: int, hop: Hop, sender: str) -> Step:
        try:
            parcel, up = Parcel.of(hop), not hop.to
        except WireError as error:
            return Step(tree, (Ignored(error.reason),))
        if up and self.router.base in (parcel.origin, sender):
            return Step(tree, (Ignored("unexpected"),))
        effects: tuple[Effect, ...] = (Send(HopAck(hop.origin, hop.number), sender),)
        before, here = tree.traffic.hops_of(parcel), self.root if up else parcel.to == self.id
        if before is not None and (here or parcel.hops <= before):
            return Step(tree, (*effects, Ignored("repeated")))
        routes, traffic = tree.routes, tree.traffic.remembering(parcel)
        if up:
            routes, told = self.router.child(routes, now, sender, hop.cost)
            traffic, effects = traffic.by(parcel.origin, sender), (*effects, *told)
        tree = Tree(routes, traffic)
        if here:
            return self._arrived(tree, now, parcel, effects)
        if parcel.hops >= MOST_HOPS:
            traffic = replace(traffic, dropped=traffic.dropped + 1)
            return self._go(Tree(routes, traffic), now, (*effects, Ignored("too many hops")))
        traffic, notes = traffic.add(parcel, self.queue)
        return self._go(Tree(routes, traffic), now, (*effects, *notes))

    def _arrived(self, tree: Tree, now: int, parcel: Parcel, effects: tuple[Effect, ...]) -> Step:
        """A message that was for this process; an empty one only says where its origin is."""
        if not parcel.message:
            return Step(tree, effects)
        try:
            message = decode(parcel.message)
        except WireError as error:
            return Step(tree, (*effects, Ignored(error.reason)))
        return Step(tree, effects, Received(now, message, parcel.origin))

    # --- messages go ---------------------------------------------------------------------------------------------

    def _go(self, tree: Tree, now: int, effects: tuple[Effect, ...] = ()) -> Step:
        """Send the first message that waits, unless one is under way, or there is no way; ``effects`` come before."""
        traffic = tree.traffic
        while traffic.queue and not traffic.next:
            first = traffic.queue[0]
            if to := _way(Tree(tree.routes, traffic), first):
                return self._try(Tree(tree.routes, traffic), now, to, effects)
            if not first.to:
                break
            traffic, notes = traffic.drop(f"no way to {first.to} is known")
            effects = (*effects, *notes)
        return Step(Tree(tree.routes, traffic), effects)

    def _try(self, tree: Tree, now: int, to: str, effects: tuple[Effect, ...]) -> Step:
        """Send the first message to this neighbour, once more or for the first time."""
        traffic = tree.traffic
        first, tries = traffic.queue[0], traffic.tries + 1 if to == traffic.next else 1
        key = (self.id, "again", first.origin, first.number, first.hops, traffic.turns, tries)
        until = now + int(self.patience_ns * (1 + 0.5 * uniform(self.seed, *key)))
        hop = Send(first.hop(self.router.cost(tree.routes)), to)
        traffic = replace(traffic, next=to, tries=tries)
        return Step(Tree(tree.routes, traffic), (*effects, hop, SetTimer("patience", until)))

    def _answered(self, tree: Tree, now: int, key: tuple[bytes, int], sender: str) -> Step:
        traffic = tree.traffic
        first = traffic.queue[0] if traffic.next == sender else None
        if first is None or key != (first.origin.encode(), first.number):
            return Step(tree, (Ignored("outdated"),))
        routes, effects = self.router.tried(tree.routes, now, sender, acked=True)
        return self._go(Tree(routes, traffic.done()), now, (CancelTimer("patience"), *effects))

    def _unanswered(self, tree: Tree, now: int) -> Step:
        """Nobody acknowledged the first message in time: it is sent again, to another neighbour, or given up."""
        traffic = tree.traffic
        first, to = traffic.queue[0], traffic.next
        routes, effects = self.router.tried(tree.routes, now, to, acked=False)
        if traffic.tries < MOST_TRIES and _way(Tree(routes, traffic), first) == to:
            return self._try(Tree(routes, traffic), now, to, effects)
        if traffic.tries >= MOST_TRIES:
            traffic = replace(traffic, turns=traffic.turns + 1)
            if not first.to:
                routes, more = self.router.lose(routes, now, to)
                effects = (*effects, *more)
            elif traffic.ways.get(first.to) == to:
                traffic = traffic.without_way(first.to)
        traffic = replace(traffic, next="", tries=0)
        if traffic.turns >= MOST_TURNS:
            traffic, notes = traffic.drop(f"{MOST_TURNS} neighbours do not answer")
            effects = (*effects, *notes)
        return self._go(Tree(routes, traffic), now, effects)


def _way(tree: Tree, parcel: Parcel) -> str:
    """The neighbour by which this message goes; empty: none is known."""
    return tree.traffic.ways.get(parcel.to, "") if parcel.to else tree.routes.parent
