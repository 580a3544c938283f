"""Whatever well-formed message comes at whatever time from whomever: no member and no header ever raises."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.ether import ORIGIN_NS
from tests.peered import ANNOUNCEMENTS, BASE, MANNERS, Field, Manner, field_of, grid
from tests.puppet import MS
from tests.test_clusters_hostile import BYTES as OF_CLUSTERS
from trackfield.filters.belief import Modes, Particles
from trackfield.filters.types import Gaussian
from trackfield.protocols.lease import MOST_NUMBER
from trackfield.role import NS
from trackfield.tracking.stored import pack
from trackfield.wire import registry
from trackfield.wire.clusters import BELIEFS_BYTES, Alive, HandOver
from trackfield.wire.listed import packed
from trackfield.wire.messages import Range, SyncReply, SyncRequest
from trackfield.wire.peers import Claim, HeadEstimate, JoinClaim, Poll, Result

KINDS = [known for known in registry.product_kinds() if 30 <= known.number < 60]
NODES = [f"n{number:02}" for number in range(6)]
SENDERS = (BASE, *NODES, "nobody")
SYNC = {"reference": BASE, "exchanges": 1, "resync_ns": 5 * NS, "timeout_ns": 100 * MS, "seed": 1}

floats = st.sampled_from([0.0, 1.0, -1.0, 1e-30, 1e30, -1e30, 60.0])


@st.composite
def some_beliefs(draw: st.DrawFn) -> bytes:
    """Bytes of a belief that is one, of any size and of any numbers."""
    n = draw(st.sampled_from([4, 4, 4, 5, 6, 16]))
    mean = np.array(draw(st.lists(floats, min_size=n, max_size=n)))
    form = draw(st.sampled_from(["gaussian", "particles", "modes"]))
    spread = np.diag(draw(st.lists(st.sampled_from([1e-9, 1.0, 1e12]), min_size=n, max_size=n)))
    one: Any = Gaussian(mean, spread)
    if form == "particles":
        one = Particles(np.full(3, 1 / 3), np.stack([mean, mean + 1.0, mean - 1.0]))
    elif form == "modes":
        one = Modes(np.full(2, 0.5), np.stack([mean, mean + 1.0]), np.stack([spread, spread]))
    step = draw(st.sampled_from([0, 3, 5, 9, 70, 65535, 10**6]))
    return pack(step, None, {draw(st.sampled_from(["ukf", "other"])): draw(st.sampled_from([one, one, None]))})


ids = st.sampled_from([one.encode() for one in SENDERS] + [b"", b"\xff", b"two words", b"x" * 32])
BYTES: dict[str, st.SearchStrategy[bytes]] = {
    **OF_CLUSTERS,
    "leader": ids,
    "head": ids,
    "heir": ids,
    "beliefs": some_beliefs().filter(lambda data: len(data) <= BELIEFS_BYTES) | st.just(b"") | st.binary(max_size=40),
    "sensors": st.lists(st.integers(0, 7), max_size=6).map(packed)
    | st.just(packed(range(50)))
    | st.binary(max_size=100),
}


def value(field: registry.Field) -> st.SearchStrategy[Any]:
    """Small numbers, which are of use, as often as the smallest and the largest."""
    if isinstance(field, registry.Bytes):
        return BYTES[field.name]
    low, high = field.scaled.low, field.scaled.high
    if field.integral:
        special = [int(low), int(high), min(MOST_NUMBER, int(high)), min(65534, int(high))]
        return st.integers(int(low), min(int(high), 20)) | st.sampled_from(special)
    return st.floats(low, high)


messages = st.sampled_from(KINDS).flatmap(lambda known: st.builds(known.cls, *map(value, known.fields)))
own = st.sampled_from([known for known in KINDS if known.number >= 50 or known.name in ("hand-over", "alive", "doubt")])
peers = own.flatmap(lambda known: st.builds(known.cls, *map(value, known.fields)))
others = (
    st.builds(Range, st.integers(0, 40) | st.just(65535), st.floats(0, 500))
    | st.builds(SyncRequest, st.integers(0, 3), st.integers(0, 10**8))
    | st.builds(SyncReply, st.integers(0, 3), *[st.integers(-(10**9), 10**9)] * 3)
)
event = st.tuples(
    st.sampled_from([0, 0, 1, 30 * MS, 400 * MS, NS, 4 * NS]),
    st.sampled_from(NODES),
    st.sampled_from(NODES) | st.sampled_from(SENDERS),
    peers | peers | messages | others,
)


def attacked(manner: Manner, at_ns: int, events: list[Any], *, timed: bool = True, **given_settings: Any) -> Field:
    """A field to which all this is said from that time on, each so long after the one before; and its next steps."""
    field = field_of(manner, grid(3), sync=SYNC if timed else None, **given_settings).run(at_ns)
    for after_ns, dst, sender, message in events:
        field.run(field.t_ns + after_ns)
        field.inject(dst, message, sender)
    return field.run(field.t_ns + 6 * NS)


TIMES = [NS, 12 * NS, ORIGIN_NS - NS // 2, ORIGIN_NS + 3 * NS, ORIGIN_NS + 7 * NS + 300 * MS]


@pytest.mark.parametrize("manner", MANNERS)
@settings(max_examples=50, phases=[Phase.explicit, Phase.generate])  # to make a failure small takes minutes
@given(st.sampled_from(TIMES), st.lists(event, min_size=1, max_size=8), st.booleans())
def test_nothing_that_is_said_makes_a_role_fail(manner: Manner, at_ns: int, events: list[Any], timed: bool) -> None:
    bounded(attacked(manner, at_ns, events, timed=timed))


@settings(max_examples=30, phases=[Phase.explicit, Phase.generate])
@given(
    st.sampled_from(TIMES),
    st.lists(event, min_size=1, max_size=8),
    st.sampled_from(["particles", "gaussian"]),
    st.sampled_from(["product", "intersection"]),
    st.booleans(),
)
def test_nor_with_other_settings(at_ns: int, events: list[Any], hands: str, local: str, always_on: bool) -> None:
    """Members that filter, and a base over a tree."""
    others: dict[str, Any] = {"base": BASE, "base_every": 3, "sticky": False}
    bounded(attacked("elected", at_ns, events, local=local, hands=hands, always_on=always_on, **others))


def bounded(field: Field) -> None:
    """What a header remembers is of nodes of the field, whoever spoke."""
    for id in field.nodes:
        memory = field.header(id)
        for known in (memory.near, memory.joined):
            assert set(known) <= set(field.nodes)
        assert all(count <= ANNOUNCEMENTS for count in memory.near.values())
        assert len(memory.polled.ids) <= 50
        assert set(memory.race.sensing) | memory.race.supporters <= set(field.nodes)
        if memory.leads:
            leads = memory.leads
            assert set(leads.chosen) | set(leads.asked) | leads.came | leads.deaf <= set(field.nodes)
            assert set(leads.missing) | set(leads.avoided) <= set(field.nodes)
            assert set(leads.concluded) <= set(field.nodes)


@pytest.mark.parametrize("manner", MANNERS)
def test_much_that_is_said_is_not_remembered(manner: Manner) -> None:
    """Thousands of messages of ever new senders, heads and terms leave as much behind as a few."""
    field = field_of(manner, grid(3)).run(ORIGIN_NS + 3 * NS)
    head = field.leader()
    for number in range(2000):
        sender = f"stranger{number}"
        for message in (
            Claim(number, number, 65535),
            JoinClaim(number, number, sender.encode(), number, 65535),
            Range(4 + number % 3, 10.0),
        ):
            field.inject(head, message, sender)
            field.inject("n05", message, NODES[number % 5])
        field.inject("n05", Alive(number, sender.encode()), "n01")
    for id in field.nodes:
        memory = field.header(id)
        assert len(memory.near) + len(memory.joined) + len(memory.race.sensing) <= 3 * len(NODES)
        if memory.leads is not None:
            assert len(memory.leads.progress.collected.recent) <= 2
    bounded(field.run(field.t_ns + 3 * NS))


def believed(*numbers: float, sd: float = 1.0, step: int = 3) -> bytes:
    return pack(step, None, {"ukf": Gaussian(np.array(numbers), sd**2 * np.eye(4))})


@pytest.mark.parametrize("manner", MANNERS)
@pytest.mark.parametrize(
    "message",
    [
        HandOver(9, 3, believed(1e30, -1e30, 1e30, 0.0)),
        HandOver(9, 3, believed(5e6, 5e6, 0.0, 0.0)),
        HandOver(9, 3, believed(10.0, 10.0, 1e6, -1e6, sd=1e9)),
        HandOver(9, 3, pack(3, None, {"ukf": None})),
        HandOver(9, 0, believed(10.0, 10.0, 0.0, 0.0, step=65535)),
        HandOver(MOST_NUMBER, 3, believed(10.0, 10.0, 0.0, 0.0)),
        HandOver(2**31 - 1, 3, believed(10.0, 10.0, 0.0, 0.0)),
        Result(2**31 - 1, 4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        Result(9, 4, 1e6, -1e6, 1000.0, 1000.0, 0.0, 0.0),
        Result(9, 65535, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        HeadEstimate(9, 4, b""),
        HeadEstimate(9, 4, believed(1e30, 0.0, 0.0, 0.0, step=4)),
        Poll(9, 5, packed([1, 1, 1])),
        Poll(9, 5, packed(range(50))),
        Poll(9, 65535, packed([1])),
        Poll(MOST_NUMBER, 5, b"\x01"),
        Alive(MOST_NUMBER, b"\xff"),
        Alive(9, b""),
    ],
    ids=lambda message: type(message).__name__,
)
def test_what_no_head_says(manner: Manner, message: Any) -> None:
    """It is said to one and to all, and the sender is dead after that; the field goes on."""
    for to in (["n01"], [id for id in NODES if id != "n02"]):
        field = attacked(manner, ORIGIN_NS + 3 * NS + 500 * MS, [(0, id, "n02", message) for id in to])
        field.kill("n02")
        field.run(field.t_ns + 12 * NS)


stored = st.binary(max_size=60) | st.tuples(
    st.integers(-(2**62), 2**63) | st.floats() | st.text(max_size=3) | st.none(),
    st.dictionaries(st.text(max_size=3) | st.integers(0, 9), st.integers(-9, 2**40) | st.floats() | st.none())
    | st.integers(0, 3)
    | st.lists(st.integers(0, 3), max_size=3),
).map(msgpack.packb)


@settings(max_examples=30, phases=[Phase.explicit, Phase.generate])
@given(stored, st.booleans(), st.sampled_from(MANNERS))
def test_whatever_was_stored_a_life_begins(data: bytes, wrapped: bool, manner: Manner) -> None:
    """Bytes of no header, as they are or as a host keeps them."""
    field = field_of(manner, grid(3)).to_step(3)
    id = field.leader()
    field.kill(id)
    field.actors[id].stored = msgpack.packb({"header": data, "member": b"x"}) if wrapped else data
    field.start(id)
    field.to_step(9)
    assert 0 <= field.header(id).held.term.number <= MOST_NUMBER
