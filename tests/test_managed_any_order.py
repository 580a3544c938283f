"""Orders, events and deaths in any sequence, against a plain reading of docs/control.md."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import Puppet
from tests.test_managed import ID, OPERATOR, SECRET, managed, replies
from tests.toys import Request
from trackfield.protocols.managed import Managed, Wrapped
from trackfield.protocols.orders import (
    OK,
    REFUSED,
    TRIES,
    UNKNOWN,
    order_for,
)
from trackfield.role import (
    CancelTimer,
    ClockSet,
    Effect,
    Event,
    Note,
    PortRead,
    Radio,
    Received,
    SetTimer,
    Started,
    State,
    Store,
    Tell,
    Timer,
)
from trackfield.wire.outside import ITEMS, START, STOP, VERBS


@dataclass
class World:
    """A driver of one role, and what a plain reading of docs/control.md says of it."""

    role: Managed
    state: Wrapped
    timers: dict[str, int]
    stored: bytes = b""
    now: int = 0
    runs: bool = True
    last: tuple[int, int] | None = None
    again: int = 0

    def give(self, event: Event) -> tuple[Effect, ...]:
        self.state, effects = self.role.handle(self.state, event)
        for effect in effects:
            if isinstance(effect, SetTimer):
                self.timers[effect.name] = effect.at
            elif isinstance(effect, CancelTimer):
                self.timers.pop(effect.name, None)
            elif isinstance(effect, Store):
                self.stored = effect.data
        return effects

    def begin(self) -> None:
        self.state, self.timers = self.role.begin(), {}
        self.give(Started(self.now, self.stored))

    def order(self, number: int, verb: int, *, genuine: bool, sender: str) -> None:
        message = order_for(ID, number, verb, SECRET if genuine else bytes(16))
        given = self.give(Received(self.now, message, sender, "backbone"))
        said = [one.answer for one in replies(given)]
        refused = [one for one in given if isinstance(one, Tell)]
        if not genuine or sender != OPERATOR:
            assert said in ([], [REFUSED])
        elif self.last is None or 0 < (number - self.last[0]) % ITEMS < ITEMS // 2:
            self.last, self.again = (number, verb), 0
            self.runs = {START: True, STOP: False}.get(verb, self.runs)
            assert said == [OK if verb < len(VERBS) else UNKNOWN]
        elif self.last == (number, verb) and self.again < TRIES - 1:
            self.again += 1
            assert said == [OK if verb < len(VERBS) else UNKNOWN]
            assert refused == []
        else:
            assert said in ([], [REFUSED])
            assert len(refused) == 1
        assert self.state.runs == self.runs


class Strict(Puppet):
    """Sets timers, stores, and does not survive a timer that it did not set, or an event before its start."""

    def handle(self, state: Any, event: Event) -> Any:
        assert isinstance(event, Started) == (state == ()), "each life has one start, which comes first"
        return super().handle(state, event)


def react(event: Event) -> Iterable[Effect]:
    match event:
        case Started(now):
            return SetTimer("tick", now + 3), SetTimer("once", now + 2), State("up")
        case Timer(now, "tick"):
            return SetTimer("tick", now + 3), Store(b"%d" % now), Note("tick")
        case Received():
            return CancelTimer("once"), SetTimer("once", event.now + 1), Radio(False, "serial")
    return ()


deeds = st.one_of(
    st.tuples(st.just("order"), st.integers(0, 8), st.integers(0, 3), st.booleans(), st.sampled_from([OPERATOR, "x"])),
    st.tuples(st.just("order"), st.integers(0, 8), st.sampled_from([START, STOP]), st.just(True), st.just(OPERATOR)),
    st.tuples(st.sampled_from(["wait", "wait", "message", "port", "die"])),
)


@given(st.lists(deeds, max_size=40))
def test_whatever_happens_a_stopped_role_gets_nothing_and_a_running_one_all(what: list[Any]) -> None:
    world = World(managed(Strict(react, kinds=["request"])), Wrapped(()), {})
    world.begin()
    for name, *rest in what:
        world.now += 1
        before = world.state.role
        if name == "order":
            number, verb, genuine, sender = rest
            world.order(number, verb, genuine=genuine, sender=sender)
            continue
        if name == "die":
            world.begin()
            world.again = 0
            assert world.state.runs == world.runs
            assert bool(world.state.role) == world.runs
            continue
        if name == "wait":
            due = [timer for timer, at in world.timers.items() if at <= world.now]
            for timer in due:
                del world.timers[timer]
            events: list[Event] = [Timer(world.now, timer) for timer in due]
        else:
            events = [Received(world.now, Request(1), "far") if name == "message" else PortRead(world.now, "p", b"x")]
        for event in events:
            world.give(event)
        assert world.state.role == ((*before, *events) if world.runs else ())
        assert world.runs or not world.timers


def unpacked(effects: tuple[Effect, ...], inside: bytes) -> list[Effect]:
    """The effects as the role inside asked for them."""
    return [Store(inside) if isinstance(one, Store) else one for one in effects]


@given(st.lists(st.sampled_from(["wait", "message", "port", "clock"]), max_size=30))
def test_without_orders_it_is_as_if_it_were_not_there(what: list[str]) -> None:
    bare, around = Puppet(react, kinds=["request"]), managed(Puppet(react, kinds=["request"]))
    inside, outside = bare.begin(), around.begin()
    events: list[Event] = [Started(0)]
    made: dict[str, Received | PortRead | ClockSet] = {
        "message": Received(0, Request(1), "far"),
        "port": PortRead(0, "p", b"x"),
        "clock": ClockSet(0, 3),
    }
    events += [replace(made.get(name, Timer(0, "tick")), now=now) for now, name in enumerate(what, 1)]
    for event in events:
        inside, expected = bare.handle(inside, event)
        outside, effects = around.handle(outside, event)
        assert unpacked(effects, outside.stored) == list(expected)
        assert outside.role == inside
    last = [one.now for one in events if isinstance(one, Timer)][-1:]
    assert outside.stored == (b"%d" % last[0] if last else b"")
