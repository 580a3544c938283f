"""Whatever well-formed message comes at whatever time from whomever: no role of a field of clusters ever raises."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.clustered import EAST, around, field_of
from tests.ether import ORIGIN_NS, Net
from tests.puppet import MS
from trackfield.filters.belief import Particles
from trackfield.filters.types import Gaussian
from trackfield.role import NS
from trackfield.tracking.stored import pack
from trackfield.wire import registry
from trackfield.wire.clusters import HandOver, Merge, Share, Wake
from trackfield.wire.codec import encode
from trackfield.wire.listed import packed
from trackfield.wire.messages import Range, SyncReply, SyncRequest

KINDS = [known for known in registry.product_kinds() if 30 <= known.number < 50]
SENDERS = ("base", "m0", "m1", "m2", "s00", "s05", "s11", "nobody")
SYNC = {"reference": "base", "exchanges": 1, "resync_ns": 5 * NS, "timeout_ns": 100 * MS, "seed": 1, "id": "any"}

floats = st.sampled_from([0.0, 1.0, -1.0, 1e-30, 1e30, -1e30, 200.0])


@st.composite
def some_beliefs(draw: st.DrawFn) -> bytes:
    """Bytes of a belief that is one, of any size and of any numbers."""
    n = draw(st.sampled_from([4, 4, 4, 5, 6, 16]))
    mean = np.array(draw(st.lists(floats, min_size=n, max_size=n)))
    if draw(st.booleans()):
        spread = np.diag(draw(st.lists(st.sampled_from([1e-9, 1.0, 1e12]), min_size=n, max_size=n)))
        one: Any = Gaussian(mean, spread)
    else:
        one = Particles(np.full(3, 1 / 3), np.stack([mean, mean + 1.0, mean - 1.0]))
    return pack(draw(st.sampled_from([0, 3, 70, 65535, 10**6])), None, {draw(st.sampled_from(["ukf", "other"])): one})


def listed(sensor: int, report: bytes) -> bytes:
    return packed([sensor]) + bytes([len(report)]) + report


reports = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 70), floats), max_size=4).map(
    lambda each: b"".join(listed(n, encode(Range(k, min(max(x, 0.0), 1e5)))) for n, k, x in each)
)
BYTES: dict[str, st.SearchStrategy[bytes]] = {
    "leader": st.sampled_from([one.encode() for one in SENDERS] + [b"", b"\xff"]),
    "heir": st.sampled_from([one.encode() for one in SENDERS] + [b"", b"\xff"]),
    "beliefs": some_beliefs() | st.just(b"") | st.binary(max_size=40),
    "sensors": st.lists(st.integers(0, 11), min_size=1, max_size=6, unique=True).map(packed) | st.binary(max_size=9),
    "places": st.binary(max_size=6),
    "reports": reports | st.binary(max_size=20),
}


def value(field: registry.Field) -> st.SearchStrategy[Any]:
    """Small numbers, which are of use, as often as the smallest and the largest."""
    if isinstance(field, registry.Bytes):
        return BYTES[field.name]
    low, high = field.scaled.low, field.scaled.high
    if field.integral:
        return st.integers(int(low), min(int(high), 40)) | st.sampled_from([int(low), int(high)])
    return st.floats(low, high)


messages = st.sampled_from(KINDS).flatmap(lambda known: st.builds(known.cls, *map(value, known.fields)))
others = (
    st.builds(Range, st.integers(0, 40) | st.just(65535), st.floats(0, 500))
    | st.builds(SyncRequest, st.integers(0, 3), st.integers(0, 10**8))
    | st.builds(SyncReply, st.integers(0, 3), *[st.integers(-(10**9), 10**9)] * 3)
)
masters = st.sampled_from(["m0", "m1", "m2"])
event = st.tuples(
    st.sampled_from([0, 0, 1, 30 * MS, 400 * MS, NS, 4 * NS]),
    masters | st.sampled_from(SENDERS[:-1]),
    masters | st.sampled_from(SENDERS),
    messages | messages | others,
)


def attacked(at_ns: int, unasked: bool, events: list[Any]) -> Net:
    """A field to which all this is said from that time on, each so long after the one before; and its next steps."""
    net = field_of(
        EAST, around(EAST, 4), policy="merge_until_3", unasked=unasked, joining={"sync": SYNC}, sync=SYNC
    ).run(at_ns)
    for after_ns, dst, sender, message in events:
        net.run(net.t_ns + after_ns)
        net.inject(dst, message, sender)
    return net.run(net.t_ns + 6 * NS)


@pytest.mark.parametrize("unasked", [False, True])
@settings(max_examples=60, phases=[Phase.explicit, Phase.generate])  # to make a failure small takes minutes
@given(
    st.sampled_from([NS, 12 * NS, ORIGIN_NS - NS // 2, ORIGIN_NS + 3 * NS, ORIGIN_NS + 7 * NS]),
    st.lists(event, min_size=1, max_size=8),
)
def test_nothing_that_is_said_makes_a_role_fail(unasked: bool, at_ns: int, events: list[Any]) -> None:
    attacked(at_ns, unasked, events)


FAR = pack(10**6, None, {"ukf": Gaussian(np.zeros(4), np.eye(4))})


@pytest.mark.parametrize(
    ("at_ns", "message"),
    [
        (3 * NS, Merge(1, 3, 10, 0, packed([4, 5]))),
        (3 * NS, Merge(1, 65535, 255, 65535, packed([4, 5]))),
        (ORIGIN_NS + 3 * NS, Share(5, 65535, b"m1", FAR)),
        (ORIGIN_NS + 3 * NS, Wake(2**31 - 1, b"m0", 4, 0, 0, b"")),
        (ORIGIN_NS + 3 * NS, HandOver(2**31 - 1, 3, pack(3, None, {"ukf": Gaussian(np.zeros(4), np.eye(4))}))),
    ],
    ids=["before step 0", "the last step", "a belief of the future", "a term beyond any", "such a term handed over"],
)
def test_what_no_master_says(at_ns: int, message: Any) -> None:
    """Each of these once made a master say what no message can hold."""
    net = attacked(at_ns, False, [(0, "m1", "m0", message)])
    net.kill("m0")
    net.run(net.t_ns + 20 * NS)


@settings(max_examples=50)
@given(st.binary(max_size=60), st.sampled_from(["m0", "m1", "base", "s03"]))
def test_whatever_was_stored_a_life_begins(stored: bytes, id: str) -> None:
    net = field_of().to_step(3)
    net.kill(id)
    net.actors[id].stored = stored
    net.start(id)
    net.to_step(6)
