"""A gateway under test: event by event, and in a small backbone with those that it sends to (``tests/ether.py``)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Final

from gateway.gateway import Gateway, Memory
from tests.ether import ORIGIN_NS, Net
from tests.puppet import MS
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
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
from trackfield.wire.codec import decode, encode, kind_name
from trackfield.wire.interests import Arrived, Interest
from trackfield.wire.outside import Item, ItemAck, Subscribe
from trackfield.wire.passes import FIXES, FixReport

BASE: Final = "base"
PLACES: Final = {"n1": (0.0, 0.0), "n2": (100.0, 0.0)}
PATIENCE_NS: Final = 200 * MS
"""More than two frames of ``Net`` take."""
LASTS_S: Final = 60.0
ALL: Final = Subscribe(FIXES, 50.0, 0.0, 200.0, LASTS_S)
NO_MORE: Final = replace(ALL, lasts_s=0.0)
WEST: Final = replace(ALL, x_m=0.0, radius_m=10.0)


def gateway(**changes: Any) -> Gateway:
    """One that lets fixes of all heads through to anybody, and has room for four."""
    given = {"places": PLACES, "queue": 4, "passes": ["fixes"], "heads": [], "patience_ns": PATIENCE_NS, **changes}
    return Gateway(id=BASE, origin_ns=ORIGIN_NS, step_ns=NS, **given)


def fix(step: int, belief: bytes = b"somewhere") -> FixReport:
    return FixReport(0, step, 0, belief, b"")


def miss(step: int) -> FixReport:
    return FixReport(0, step, 1, b"", b"")


@dataclass
class Station:
    """A gateway, its time, its timers, and what the last event led to. It has started at step 0."""

    role: Gateway = field(default_factory=gateway)
    now: int = ORIGIN_NS
    stored: bytes = b""
    state: Memory = field(default_factory=Memory)
    timers: dict[str, int] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        self.give(Started(self.now, self.stored))

    def give(self, event: Event) -> Station:
        self.state, self.effects = self.role.handle(self.state, event)
        for effect in self.effects:
            match effect:
                case SetTimer(name, at):
                    self.timers[name] = at
                case CancelTimer(name):
                    self.timers.pop(name, None)
                case Store(data):
                    self.stored = data
        return self

    def arrives(self, message: Any, origin: str = "n1") -> Station:
        """The sink hands over what came out of the field."""
        payload = message if isinstance(message, bytes) else encode(message)
        return self.give(Received(self.now, Arrived(origin.encode(), payload), BASE))

    def told(self, message: Any, sender: str = "control") -> Station:
        """It comes over the backbone."""
        return self.give(Received(self.now, decode(encode(message)), sender, "backbone"))

    def acked(self, to: str = "control") -> Station:
        """A receiver acknowledges what was sent to it last."""
        first = self.state.queue.first(to)
        assert first is not None
        return self.told(ItemAck(first.item.number, first.item.life), to)

    def rings(self) -> Station:
        """The next of its timers is due."""
        name = min(self.timers, key=lambda name: self.timers[name])
        self.now = max(self.now, self.timers.pop(name))
        return self.give(Timer(self.now, name))

    def later(self, seconds: float) -> Station:
        """So much later; nobody acknowledges anything."""
        until_ns = self.now + round(seconds * NS)
        while self.timers and min(self.timers.values()) <= until_ns:
            self.rings()
        self.now = until_ns
        return self

    # --- what the last event led to ------------------------------------------------------------------------------

    @property
    def items(self) -> list[tuple[str, Item]]:
        """Those that were sent."""
        return [(str(one.to), one.message) for one in self._sends() if isinstance(one.message, Item)]

    @property
    def steps(self) -> list[int]:
        """Of the fixes in them."""
        return [decode(item.message).step for _, item in self.items]

    @property
    def interests(self) -> list[Interest]:
        """What the sink was told."""
        assert all(one.to == BASE for one in self._sends() if isinstance(one.message, Interest))
        return [one.message for one in self._sends() if isinstance(one.message, Interest)]

    @property
    def ignored(self) -> str:
        return next((one.reason for one in self.effects if isinstance(one, Ignored)), "")

    @property
    def note(self) -> str:
        return next((one.text for one in self.effects if isinstance(one, Note)), "")

    @property
    def shown(self) -> str:
        return next((one.name for one in self.effects if isinstance(one, State)), "")

    @property
    def counts(self) -> tuple[int | float | str, ...]:
        """Waiting, passed, refused, dropped, unwanted; empty if it tells nothing."""
        return next((one.values for one in self.effects if isinstance(one, Tell)), ())

    @property
    def queued(self) -> list[int]:
        """The steps of all that waits."""
        return [decode(one.item.message).step for one in self.state.queue.items]

    def _sends(self) -> Iterable[Send]:
        return [one for one in self.effects if isinstance(one, Send)]


def subscribed(**changes: Any) -> Station:
    """A gateway with one subscriber."""
    return Station(gateway(**changes)).told(ALL)


class Taker:
    """Wants all fixes, and says so anew every third of the time; acknowledges items, and keeps each once."""

    kinds: Final = frozenset({"item"})

    def __init__(self, wanted: Subscribe = ALL) -> None:
        self.wanted = wanted
        self.came = list[tuple[int, int]]()

    def begin(self) -> frozenset[tuple[int, int]]:
        return frozenset()

    def handle(
        self, state: frozenset[tuple[int, int]], event: Event
    ) -> tuple[frozenset[tuple[int, int]], tuple[Effect, ...]]:
        match event:
            case Started(now):
                return state, (SetTimer("ask", now),)
            case Timer(now, _):
                again = SetTimer("ask", now + round(self.wanted.lasts_s * NS / 3))
                return state, (Send(self.wanted, BASE, "backbone"), again)
            case Received(_, Item() as item, sender):
                ack, key = Send(ItemAck(item.number, item.life), sender, "backbone"), (item.life, item.number)
                if key in state:
                    return state, (ack, Ignored("repeated"))
                self.came.append((decode(item.message).step, item.life))
                return state | {key}, (ack,)
        return state, ()

    @property
    def steps(self) -> list[int]:
        """Of the fixes that came, in their order."""
        return [step for step, _ in self.came]


class Backbone(Net):
    """A gateway and those that want its items, all on the backbone; ``tells`` are what it told of itself."""

    def __init__(self, role: Gateway | None = None, **takers: Taker) -> None:
        super().__init__()
        self.takers, self.tells = takers or {"control": Taker()}, list[tuple[Any, ...]]()
        self.add(BASE, role or gateway(), (0.0, 0.0))
        for id, taker in self.takers.items():
            self.add(id, taker, (0.0, 0.0))
        self.run(ORIGIN_NS)
        for id in self.actors:
            self.start(id)

    def wait(self, seconds: float) -> Backbone:
        self.run(self.t_ns + round(seconds * NS))
        return self

    def fixed(self, step: int, origin: str = "n1") -> None:
        """The sink has a fix."""
        self.inject(BASE, Arrived(origin.encode(), encode(fix(step))), BASE)

    def cut(self, id: str) -> Any:
        """Nothing goes to this process, or comes from it, until the function is called."""
        before = self.reaches
        self.reaches = lambda src, dst: id not in (src, dst) and before(src, dst)

        def mend() -> None:
            self.reaches = before

        return mend

    def _give(self, id: str, event: Event) -> None:
        if isinstance(event, Received) and kind_name(event.message) != "arrived":
            event = replace(event, medium="backbone")
        super()._give(id, event)

    def _do(self, id: str, actor: Any, effect: Effect) -> None:
        if isinstance(effect, Tell):
            self.tells.append(effect.values)
        super()._do(id, actor, effect)
