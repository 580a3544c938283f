"""Messages over several hops of a backbone: chains of wrappers that hear each other (``tests/ether.py``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.plan.architectures.outside.chain import Chain
from tests.ether import DELAY_NS, Net
from tests.puppet import MS
from trackfield.protocols.carried import DUE, MOST_HELD, MOST_HOPS, REMEMBERED, REMEMBERED_NS, Carried, Wrapped
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    PortRead,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.outside import Capture, Captured, Order
from trackfield.wire.outside import Carried as Parcel

CHAIN: Final = Chain(["base", "hop1", "hop2", "hop3"], ["control", "video", "system"])
ALL: Final = (*CHAIN.links, *CHAIN.end)
HOLD_NS: Final = 50 * MS


class Talker:
    """A role that sends what is ``next`` (at ``PortRead``), and keeps what it gets; a timer sends to its name."""

    kinds: Final = frozenset({"capture", "captured"})

    def __init__(self) -> None:
        self.got = list[Received]()
        self.next: Send | None = None

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Received():
                self.got.append(event)
            case PortRead():
                assert self.next is not None
                return state + 1, (self.next,)
            case Timer(now, name):
                return state, (Send(Capture(now // MS % 1000, 1.0), name, "backbone"),)
        return state, ()


class Line(Net):
    """The processes of a chain, each with a ``Talker``; those next to each other hear each other."""

    def __init__(self, hold_ns: int = 0, chain: Chain = CHAIN) -> None:
        super().__init__()
        for id in (*chain.links, *chain.end):
            held = hold_ns if id in chain.links[1:] else 0
            self.add(id, Carried(Talker(), id=id, next=chain.next(id), hold_ns=held), (0.0, 0.0))
        self.reaches = lambda src, dst: dst in chain.near(src)
        for id in self.actors:
            self.start(id)

    def says(self, id: str, message: Any, to: str | frozenset[str]) -> None:
        """The role of a process sends a message."""
        self.actors[id].role.role.next = Send(message, to, "backbone")
        self._give(id, PortRead(self.local(id), "mouth", b""))

    def wait(self, seconds: float) -> Line:
        self.run(self.t_ns + round(seconds * NS))
        return self

    def got(self, id: str) -> list[tuple[str, int]]:
        """From whom, and the numbers."""
        return [(one.sender, one.message.number) for one in self.actors[id].role.role.got]

    def way(self) -> list[tuple[str, str]]:
        """The hops of parcels."""
        return [(one.src, one.dst) for one in self.frames("carried")]

    def _give(self, id: str, event: Event) -> None:
        super()._give(id, replace(event, medium="backbone") if isinstance(event, Received) else event)


def test_neighbours_are_sent_to_as_if_there_were_no_chain() -> None:
    line = Line()
    line.says("control", Capture(1, 1.0), "video")
    line.says("hop1", Capture(2, 1.0), "base")
    line.wait(1)
    assert line.frames("carried") == []
    assert line.got("video") == [("control", 1)]
    assert line.got("base") == [("hop1", 2)]


@pytest.mark.parametrize(("start", "end"), [("base", "control"), ("system", "base"), ("video", "hop1")])
def test_a_message_goes_over_all_hops_and_seems_to_come_from_its_origin(start: str, end: str) -> None:
    line = Line(HOLD_NS)
    line.says(start, Capture(7, 2.0), end)
    line.wait(1)
    (got,) = line.actors[end].role.role.got
    assert (got.sender, got.medium, got.message) == (start, "backbone", Capture(7, 2.0))
    hops = [*CHAIN.links, start if start in CHAIN.end else end]
    ways = hops[hops.index(start) :] if start in CHAIN.links else hops[hops.index(end) :][::-1]
    assert line.way() == list(pairwise(ways))
    assert got.now == len(line.way()) * DELAY_NS + (len(line.way()) - 1) * HOLD_NS
    assert [one.message.hops for one in line.frames("carried")] == list(range(len(line.way())))


def test_of_a_set_of_ids_each_has_the_message() -> None:
    line = Line()
    line.says("hop2", Capture(1, 1.0), frozenset({"base", "hop1", "hop3", "video", "control"}))
    line.wait(1)
    assert all(line.got(id) == [("hop2", 1)] for id in ("base", "hop1", "hop3", "video", "control"))
    assert sorted((one.src, one.dst) for one in line.frames("capture")) == [("hop2", "hop1"), ("hop2", "hop3")]
    assert line.got("system") == line.got("hop2") == []


def test_other_media_broadcasts_and_timers_are_none_of_its_business() -> None:
    one = Carried(Talker(), id="base", next=CHAIN.next("base"))
    state, _ = one.handle(one.begin(), Started(0))
    for send in (Send(Capture(1, 1.0), "control"), Send(Capture(1, 1.0), NEIGHBOURHOOD, "backbone")):
        one.role.next = send
        _, effects = one.handle(state, PortRead(0, "mouth", b""))
        assert effects == (send,)
    _, effects = one.handle(state, Timer(0, "control"))
    assert isinstance(effects[0], Send)
    assert isinstance(effects[0].message, Parcel)
    _, effects = one.handle(state, Received(0, parcel(), "hop1", "field"))
    assert effects == (Ignored("unexpected"),)


def test_a_burst_is_held_and_goes_on_in_order() -> None:
    line = Line(HOLD_NS)
    for number in range(20):
        line.says("base", Capture(number, 1.0), "control")
        line.wait(0.003)
    line.wait(2)
    assert line.got("control") == [("base", number) for number in range(20)]
    last = line.actors["control"].role.role.got[-1]
    assert last.now == 19 * 3 * MS + 4 * DELAY_NS + 3 * HOLD_NS


def test_a_parcel_that_comes_twice_is_handed_on_once() -> None:
    line = Line(HOLD_NS)
    line.rule("carried", "base", "hop1", delays=(0, 5 * MS))
    line.rule("carried", "hop3", "control", delays=(0, 5 * MS))
    for number in (1, 2):
        line.says("base", Capture(number, 1.0), "control")
    line.wait(1)
    assert line.got("control") == [("base", 1), ("base", 2)]
    assert line.reasons("hop1") == line.reasons("control") == ["repeated", "repeated"]
    assert len(line.way()) == 8


def test_a_parcel_is_lost_and_the_next_arrives() -> None:
    line = Line()
    line.rule("carried", "hop1", "hop2", count=1)
    for number in (1, 2):
        line.says("base", Capture(number, 1.0), "control")
    line.wait(1)
    assert line.got("control") == [("base", 2)]


def test_a_hop_that_starts_again_forgets_what_it_held_and_goes_on_with_the_rest() -> None:
    line = Line(HOLD_NS)
    line.says("base", Capture(1, 1.0), "control")
    line.wait(0.03)
    line.kill("hop1")
    line.start("hop1")
    line.says("base", Capture(2, 1.0), "control")
    line.wait(1)
    assert line.got("control") == [("base", 2)]


@pytest.mark.parametrize("after_s", [0.01, 1.0, 29.0, 65.536, 65.540])
def test_what_an_origin_sends_in_its_next_life_is_not_taken_for_a_repeat(after_s: float) -> None:
    line = Line()
    for number in range(5):
        line.says("base", Capture(number, 1.0), "control")
    line.wait(after_s)
    line.start("base")
    for number in range(5):
        line.says("base", Capture(10 + number, 1.0), "control")
    line.wait(1)
    assert line.got("control") == [("base", n) for n in (*range(5), *range(10, 15))]


# --- one process, parcel by parcel --------------------------------------------------------------------------------


def parcel(**changes: Any) -> Parcel:
    given = {"origin": b"base", "destination": b"control", "number": 1, "hops": 0, "message": encode(Capture(1, 1.0))}
    return Parcel(**{**given, **changes})


class Hop:
    """A process of the chain: ``hop2``, unless another is named."""

    def __init__(self, id: str = "hop2", hold_ns: int = 0, next: Mapping[str, str] | None = None) -> None:
        self.role = Carried(Talker(), id=id, next=next or CHAIN.next(id), hold_ns=hold_ns)
        self.state: Wrapped = self.role.begin()
        self.effects = self.does(Started(0))

    def does(self, event: Event) -> tuple[Effect, ...]:
        self.state, self.effects = self.role.handle(self.state, event)
        return self.effects

    def comes(self, one: Parcel, now: int = 0) -> tuple[Effect, ...]:
        return self.does(Received(now, one, "hop1", "backbone"))

    @property
    def got(self) -> list[Received]:
        return self.role.role.got  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"destination": b"nobody"}, "no way"),
        ({"destination": b""}, "key"),
        ({"destination": b"\xff\x00"}, "key"),
        ({"origin": b"stranger"}, "no way"),
        ({"origin": b"no id"}, "key"),
        ({"origin": b"hop2"}, "no way"),
        ({"hops": MOST_HOPS}, "too many hops"),
        ({"hops": 255}, "too many hops"),
    ],
)
def test_what_has_no_way_is_ignored_and_counted(changes: dict[str, Any], why: str) -> None:
    hop = Hop()
    before = hop.state
    assert hop.comes(parcel(**changes)) == (Ignored(why),)
    assert hop.state == before


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (b"", "malformed"),
        (b"\xc1", "malformed"),
        (encode(Order(1, 1, b"12345678")), "unexpected"),
        (encode(parcel()), "unexpected"),
    ],
)
def test_a_payload_that_its_role_does_not_take_is_ignored(message: bytes, why: str) -> None:
    hop = Hop()
    assert hop.comes(parcel(destination=b"hop2", message=message)) == (Ignored(why),)
    assert hop.got == []
    assert hop.comes(parcel(destination=b"hop2", number=2)) == ()
    assert [one.sender for one in hop.got] == ["base"]


@given(message=st.binary(max_size=80), origin=st.binary(max_size=32), destination=st.binary(max_size=32))
def test_a_stranger_may_send_any_bytes(message: bytes, origin: bytes, destination: bytes) -> None:
    hop = Hop()
    (effect,) = hop.comes(parcel(origin=origin, destination=destination, message=message))
    assert isinstance(effect, Ignored)
    (effect,) = hop.comes(parcel(message=message))
    assert effect == Send(parcel(hops=1, message=message), "hop3", "backbone")


def test_tables_that_lead_in_a_circle_do_not_lead_for_ever() -> None:
    there = Hop("hop1", next={"hop2": "hop2", "z": "hop2", "base": "base"})
    back = Hop("hop2", next={"hop1": "hop1", "z": "hop1", "base": "hop1"})
    (sent,) = there.comes(parcel(destination=b"z"))
    assert isinstance(sent, Send)
    (sent,) = back.comes(sent.message)
    assert isinstance(sent, Send)
    assert there.comes(sent.message) == (Ignored("repeated"),)


def test_of_too_many_that_are_held_the_oldest_is_dropped() -> None:
    hop = Hop(hold_ns=HOLD_NS)
    for number in range(MOST_HELD):
        assert hop.comes(parcel(number=number), now=number) == (SetTimer(DUE, HOLD_NS),)
    note, timer = hop.comes(parcel(number=99), now=MOST_HELD)
    assert note == Note("a message of base for control is dropped: 32 wait already")
    assert timer == SetTimer(DUE, HOLD_NS + 1)
    sent = hop.does(Timer(HOLD_NS + 100, DUE))
    assert [one.message.number for one in sent if isinstance(one, Send)] == [*range(1, MOST_HELD), 99]
    assert len(sent) == MOST_HELD
    with pytest.raises(IllegalEvent):
        hop.does(Timer(HOLD_NS + 200, DUE))


def test_the_order_is_kept_if_a_clock_jumps_back() -> None:
    hop = Hop(hold_ns=HOLD_NS)
    for number, now in ((1, 0), (2, 30 * MS), (3, -20 * MS)):
        assert hop.comes(parcel(number=number), now) == (SetTimer(DUE, HOLD_NS),)
    sent = [*hop.does(Timer(HOLD_NS, DUE)), *hop.does(Timer(HOLD_NS + 30 * MS, DUE))]
    assert [one.message.number for one in sent if isinstance(one, Send)] == [1, 2, 3]


def test_it_remembers_so_many_parcels_for_so_long() -> None:
    hop = Hop()
    for number in range(REMEMBERED):
        hop.comes(parcel(number=number))
    assert hop.comes(parcel(number=0)) == (Ignored("repeated"),)
    assert isinstance(hop.comes(parcel(number=0, origin=b"hop1"))[0], Send)
    assert isinstance(hop.comes(parcel(number=0))[0], Send)
    assert len(hop.state.seen) == REMEMBERED
    assert hop.comes(parcel(number=9), now=REMEMBERED_NS - 1) == (Ignored("repeated"),)
    assert isinstance(hop.comes(parcel(number=9), now=REMEMBERED_NS)[0], Send)
    assert len(hop.state.seen) == 1


def test_numbers_are_cyclic() -> None:
    hop = Hop("base")
    hop.does(Started(65_535 * MS))
    hop.role.role.next = Send(Captured(1, 1), frozenset({"control", "video"}), "backbone")
    sent = hop.does(PortRead(65_535 * MS, "mouth", b""))
    assert [one.message.number for one in sent if isinstance(one, Send)] == [0, 1]
    sent = hop.does(PortRead(65_535 * MS, "mouth", b""))
    assert [one.message.number for one in sent if isinstance(one, Send)] == [2, 3]


@given(
    hops=st.integers(0, 3),
    hold_ms=st.sampled_from([0, 1, 50]),
    fates=st.lists(st.lists(st.integers(0, 200), max_size=2), max_size=40),
    pause_ms=st.integers(0, 60),
)
def test_whatever_befalls_frames_each_message_comes_once_at_most(
    hops: int, hold_ms: int, fates: list[list[int]], pause_ms: int
) -> None:
    """Frames are lost, come late, come twice; those that arrive each time on time are in order among them."""
    chain = Chain(CHAIN.links[: hops + 1], CHAIN.end)
    line = Line(hold_ms * MS, chain)
    left = iter(fates)
    late = False

    def delays(kind: str, src: str, dst: str) -> tuple[int, ...]:
        nonlocal late
        fate = next(left, [0])
        late |= any(fate)
        return tuple(ms * MS for ms in fate) if dst in chain.near(src) else ()

    line._delays = delays  # type: ignore[method-assign]
    for number in range(10):
        line.says("base", Capture(number, 1.0), "control")
        line.wait(pause_ms / 1000)
    line.wait(5)
    numbers = [number for _, number in line.got("control")]
    if hops:
        assert len(set(numbers)) == len(numbers)
        assert late or numbers == sorted(numbers)
    assert len(fates) > 0 or numbers == list(range(10))
    assert all(kind_name(one.message) == "carried" for one in line.sent) or not hops
