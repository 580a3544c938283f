"""The gateway of a field: inside, data have names; outside, messages have addresses.

Inside there are no addresses: who wants data says of which class and from where, and the network finds who has it
(``trackfield/protocols/interest``). Outside each process has one. So the gateway

- keeps *subscriptions*: a process of the backbone wants data of a class from a region, for some time. The gateway makes
  an interest of it, which it gives to its other half, the sink (``fusion/sink.py``), and withdraws it with the last;
- makes a numbered *item* of each message that comes out of the field from the region of a subscription, and sends it to
  the subscriber until that acknowledges it (``queue``);
- lets nothing else through (``rules``), and counts what it refuses.

Either side may be away: items wait for a receiver that cannot be reached, and subscriptions hold while nothing comes
from the field. A next life knows the subscriptions, but not what waited.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import msgpack

from gateway.queue import Queue, Waiting
from gateway.rules import Refused, Rules
from gateway.subscriptions import Subscriptions
from trackfield.role import (
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Tell,
    Timer,
)
from trackfield.wire.interests import Arrived
from trackfield.wire.keys import Medium
from trackfield.wire.outside import ITEMS, Item, ItemAck, Subscribe

BACKBONE: Final[Medium] = "backbone"
TOPIC: Final = "gateway"
EXPIRY: Final = "expiry"
PATIENCE: Final = "item:"
"""With the id of a receiver, the name of a timer."""
LIVES: Final = 65536
NO_LIFE: Final = -1


class Counts(NamedTuple):
    """How many items were acknowledged, messages and subscriptions refused, items dropped, and messages unwanted."""

    passed: int = 0
    refused: int = 0
    dropped: int = 0
    unwanted: int = 0


@dataclass(frozen=True, slots=True)
class Memory:
    """Who wants what, what waits, the number of the last item, which life this is, and what is counted."""

    wanted: Subscriptions = field(default_factory=Subscriptions)
    queue: Queue = field(default_factory=Queue)
    number: int = 0
    life: int = 0
    counts: Counts = field(default_factory=Counts)

    def counting(self, **more: int) -> Memory:
        """The same, with some counts higher."""
        counted = {name: getattr(self.counts, name) + by for name, by in more.items()}
        return replace(self, counts=self.counts._replace(**counted))

    @property
    def told(self) -> tuple[int, ...]:
        """What it tells of itself."""
        return (len(self.queue.items), *self.counts)

    @property
    def phase(self) -> str:
        """Its state, as shown."""
        return "sending" if self.queue.under else "waiting"


Step = tuple[Memory, tuple[Effect, ...]]


class Gateway:
    """Process ``id``. ``passes``, ``heads`` and ``subscribers`` are rules (``Rules``), ``places`` those of sensors (m).

    At most ``queue`` items wait; one is sent again after ``patience_ns``, and then after up to eight times that.
    Step 0 is at ``origin_ns``, and a step lasts ``step_ns``: lives are numbered by the step in which they begin.
    """

    kinds: Final = frozenset({"arrived", "subscribe", "item-ack"})

    def __init__(
        self,
        *,
        id: str,
        origin_ns: int,
        step_ns: int,
        places: Mapping[str, Sequence[float]],
        queue: int,
        passes: Sequence[str],
        heads: Sequence[str],
        patience_ns: int,
        subscribers: Sequence[str] = (),
    ) -> None:
        self.id, self.origin_ns, self.step_ns = id, origin_ns, step_ns
        self.most, self.patience_ns = queue, patience_ns
        at = {id: (float(x), float(y)) for id, (x, y) in places.items()}
        self.rules = Rules(at, frozenset(passes), frozenset(heads), frozenset(subscribers))

    def begin(self) -> Memory:
        """A gateway that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        if isinstance(event, Started):
            return self._start(state, event)
        after, effects = self._react(state, event)
        return self._settled(state, after, event.now, effects)

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Received(now, Arrived() as arrived, self.id):
                return self._arrived(memory, now, arrived)
            case Received(now, Subscribe() as wanted, sender, "backbone"):
                return self._subscribed(memory, now, wanted, sender)
            case Received(_, ItemAck() as ack, sender, "backbone"):
                return self._acknowledged(memory, ack, sender)
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer(now, "expiry"):
                return replace(memory, wanted=memory.wanted.live(now)), ()
            case Timer(now, name) if name.startswith(PATIENCE) and name.removeprefix(PATIENCE) in memory.queue.under:
                return self._sent(memory, now, name.removeprefix(PATIENCE))
        raise IllegalEvent(f"a gateway cannot handle {event}")

    # --- a life begins -------------------------------------------------------------------------------------------

    def _start(self, memory: Memory, start: Started) -> Step:
        life, effects = (start.now - self.origin_ns) // self.step_ns % LIVES, tuple[Effect, ...]()
        if start.stored:
            try:
                before, plain = msgpack.unpackb(start.stored)
                memory = replace(memory, wanted=Subscriptions.from_plain(plain, start.now))
                life = (life + 1) % LIVES if life == before else life
            except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
                effects = (Note(f"What an earlier life stored cannot be used: {error}"),)
        after = replace(memory, life=life)
        told = (State(after.phase), Tell(TOPIC, after.told))
        return self._settled(Memory(life=NO_LIFE), after, start.now, (*effects, *told))

    def _stored(self, memory: Memory) -> Store:
        packed: bytes = msgpack.packb((memory.life, memory.wanted.plain()))
        return Store(packed)

    # --- from either side ----------------------------------------------------------------------------------------

    def _arrived(self, memory: Memory, now: int, arrived: Arrived) -> Step:
        """A message comes out of the field."""
        try:
            found = self.rules.passing(arrived)
        except Refused as why:
            return memory.counting(refused=1), (Ignored(f"refused: {why}"),)
        wanting = memory.wanted.live(now).wanting(found.task, found.place)
        if not wanting:
            return memory.counting(unwanted=1), (Ignored("nobody wants it"),)
        for to in wanting:
            number = (memory.number + 1) % ITEMS
            one = Waiting(to, Item(number, memory.life, found.task, found.origin, found.message), found.fix)
            queue, dropped = memory.queue.add(one, self.most)
            memory = replace(memory, queue=queue, number=number).counting(dropped=dropped)
        return memory, ()

    def _subscribed(self, memory: Memory, now: int, wanted: Subscribe, sender: str) -> Step:
        """A process of the backbone wants something, or no longer does."""
        key = sender, wanted.task
        if not wanted.lasts_s:
            if key not in memory.wanted.known:
                return memory, (Ignored("no such subscription"),)
            queue, lost = memory.queue.without(*key)
            return replace(memory, wanted=memory.wanted.without(key), queue=queue).counting(unwanted=lost), ()
        try:
            self.rules.check(*key)
        except Refused as why:
            return memory.counting(refused=1), (Ignored(f"refused: {why}"),)
        after = memory.wanted.live(now).subscribed(sender, wanted, now)
        if after is None:
            return memory.counting(refused=1), (Ignored("refused: too many subscriptions"),)
        under = memory.queue.under.get(sender)
        again = under is not None and under.tries > 1
        return replace(memory, wanted=after, queue=memory.queue.heard(sender) if again else memory.queue), ()

    def _acknowledged(self, memory: Memory, ack: ItemAck, sender: str) -> Step:
        """A receiver has what was sent to it."""
        queue = memory.queue.acknowledged(sender, ack.number, ack.life)
        if queue is None:
            return memory, (Ignored("outdated"),)
        return replace(memory, queue=queue).counting(passed=1), ()

    # --- what follows of it --------------------------------------------------------------------------------------

    def _settled(self, before: Memory, after: Memory, now: int, effects: tuple[Effect, ...]) -> Step:
        """After a change: what is sent, told, stored, and when it will look again."""
        done = list(effects)
        done += [Send(interest, self.id) for interest in after.wanted.told(before.wanted, self.id)]
        if (after.life, after.wanted) != (before.life, before.wanted):
            done.append(self._stored(after))
        if (at := after.wanted.next_ns) != before.wanted.next_ns:
            done.append(CancelTimer(EXPIRY) if at is None else SetTimer(EXPIRY, at))
        for to in sorted({one.to for one in after.queue.items} | set(after.queue.under)):
            after, more = self._onward(after, now, to)
            done += more
        if after.told != before.told:
            done.append(Tell(TOPIC, after.told))
        if after.phase != before.phase:
            done.append(State(after.phase))
        return after, tuple(done)

    def _onward(self, memory: Memory, now: int, to: str) -> Step:
        """The next item of a receiver is sent, unless it is under way; nothing is if its subscription has expired."""
        first, under = memory.queue.first(to), memory.queue.under.get(to)
        if first is None or to not in memory.wanted.subscribers:
            waits = (CancelTimer(PATIENCE + to),) if under else ()
            return replace(memory, queue=memory.queue.resting(to)), waits
        if under and under.tries and under.number == first.item.number:
            return memory, ()
        return self._sent(memory, now, to)

    def _sent(self, memory: Memory, now: int, to: str) -> Step:
        """Its next item is sent."""
        first = memory.queue.first(to)
        if first is None:
            raise IllegalEvent(f"nothing is under way to {to}")
        queue = memory.queue.sent(to, first.item.number)
        again = SetTimer(PATIENCE + to, now + queue.patience_ns(to, self.patience_ns))
        return replace(memory, queue=queue), (Send(first.item, to, BACKBONE), again)
