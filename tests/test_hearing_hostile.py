"""Whatever well-formed message comes at whatever time from whomever: no ear, no head and no sink ever raises."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import msgpack
import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from head.hearing.memory import MOST_PASSES
from head.hearing.settings import Heads
from tests.ether import ORIGIN_NS
from tests.hearing import BASE, Field, Line, field_of
from tests.puppet import MS
from tests.test_peers_hostile import some_beliefs
from trackfield.filters.types import Gaussian
from trackfield.role import NS
from trackfield.tracking.stored import pack
from trackfield.wire import registry
from trackfield.wire.codec import encode
from trackfield.wire.interests import Arrived, Data, Interest
from trackfield.wire.messages import SyncReply, SyncRequest
from trackfield.wire.passes import CpaReport, CpaReportSds, FixReport

HEADS: tuple[Heads, ...] = get_args(Heads)
NODES = [f"n{number:02}" for number in range(5)]
SENDERS = (BASE, *NODES, "nobody")
LINE = Line(3.0, 2.0, 80.0, at_s=6.0)
OWN = [known for known in registry.product_kinds() if 60 <= known.number <= 67]

ids = st.sampled_from([one.encode() for one in SENDERS] + [b"", b"\xff", b"two words", b"x" * 32])
reports = st.builds(
    CpaReport, st.integers(0, 40) | st.just(65535), st.sampled_from([0.0, 1.2, 6.5535]), st.integers(0, 3),
    st.sampled_from([-100.0, -20.0, 0.0, 200.0]), st.sampled_from([0.0, 1.0, 6.375]),
)  # fmt: skip
SDS = [one for one in registry.kind_of_class(CpaReportSds).fields if one.name in ("time_sd_s", "strength_sd_db")]
sds = st.tuples(*[st.sampled_from([one.scaled.low, one.scaled.resolution, one.scaled.high])
                  | st.floats(one.scaled.low, one.scaled.high) for one in SDS])  # fmt: skip
reports_sds = st.builds(
    lambda one, said: CpaReportSds(one.step, one.early_s, one.event, one.strength_db, one.width_s, *said), reports, sds
)
fixes = st.builds(
    FixReport, st.integers(0, 3), st.sampled_from([0, 5, 12, 20, 65535]), st.sampled_from([0, 1, 99, 255]),
    some_beliefs().filter(lambda data: len(data) <= 800) | st.binary(max_size=40) | st.just(b""),
    st.binary(max_size=64) | st.just(bytes(16)),
)  # fmt: skip
payloads = (reports | fixes).map(encode) | st.binary(max_size=40)
BYTES: dict[str, st.SearchStrategy[bytes]] = {
    "sink": ids, "origin": ids, "message": payloads, "raw": st.binary(max_size=64), "belief": some_beliefs(),
}  # fmt: skip


def value(field: registry.Field) -> st.SearchStrategy[Any]:
    """Small numbers, which are of use, as often as the smallest and the largest."""
    if isinstance(field, registry.Bytes):
        return BYTES[field.name].filter(lambda data: len(data) <= field.blob.most)
    low, high = field.scaled.low, field.scaled.high
    if field.integral:
        return st.integers(int(low), min(int(high), 40)) | st.sampled_from([int(low), int(high)])
    return st.floats(low, high)


messages = st.sampled_from(OWN).flatmap(lambda known: st.builds(known.cls, *map(value, known.fields)))
others = (
    st.builds(SyncRequest, st.integers(0, 3), st.integers(0, 10**8))
    | st.builds(SyncReply, st.integers(0, 3), *[st.integers(-(10**9), 10**9)] * 3)
    | reports
    | fixes
    | reports_sds
)
event = st.tuples(
    st.sampled_from([0, 0, 1, 30 * MS, 400 * MS, NS, 4 * NS]),
    st.sampled_from(NODES) | st.just(BASE),
    st.sampled_from(NODES) | st.sampled_from(SENDERS),
    messages | messages | others,
)
SYNC = {"reference": BASE, "exchanges": 1, "resync_ns": 5 * NS, "timeout_ns": 100 * MS, "seed": 1}
TIMES = [NS, 12 * NS, ORIGIN_NS - NS // 2, ORIGIN_NS + 3 * NS, ORIGIN_NS + 8 * NS + 300 * MS]


def consumes(field: Field, dst: str, message: Any) -> bool:
    """Whether a driver would give it such a message."""
    return registry.kind_of_class(type(message)).name in field.actors[dst].role.kinds


@pytest.mark.parametrize("heads", HEADS)
@settings(max_examples=25, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(st.sampled_from(TIMES), st.lists(event, min_size=1, max_size=8), st.booleans())
def test_nothing_that_is_said_makes_a_role_fail(heads: Heads, at_ns: int, events: list[Any], timed: bool) -> None:
    field = field_of(LINE, heads=heads, sync=SYNC if timed else None, hand_m=100.0 if heads == "fixed" else 0.0)
    field.run(at_ns)
    for after_ns, dst, sender, message in events:
        field.run(field.t_ns + after_ns)
        if consumes(field, dst, message):
            field.inject(dst, message, sender)
    bounded(field.run(field.t_ns + 8 * NS))


PRIOR = {"mean": [-70.0, 0.0, 13.0, 2.0], "sd": [20.0, 20.0, 3.0, 3.0]}


@pytest.mark.parametrize("tracker", ["ml", "ecpa", "ukf"])
@pytest.mark.parametrize("heads", HEADS)
@settings(max_examples=6, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(sds, st.lists(st.tuples(st.sampled_from(NODES), st.sampled_from(NODES), reports_sds), max_size=4))
@example((0.0, 0.0), [])
@example((0.0, 1.0), [])
@example((0.01, 0.0), [])
def test_however_exact_a_report_says_it_is(tracker: str, heads: Heads, said: tuple[float, ...], others: Any) -> None:
    """The sds of a line's reports, and of some others, are any that their messages hold."""
    line = replace(LINE, sds=said)
    field = field_of(line, heads=heads, trackers=(tracker,), prior=PRIOR if tracker == "ukf" else None)
    field.until(7)
    for dst, sender, report in others:
        field.inject(dst, report, sender)
    bounded(field.until(12))
    if tracker != "ukf" and not others and max(said) <= 1.0:
        assert field.error(line)[0] < 0.2


def bounded(field: Field) -> None:
    """What a node remembers is of nodes of the field, and not more than so much."""
    for id in field.nodes:
        ear, head = field.ear(id), field.head(id)
        assert len(ear.recent) <= 20
        assert len(head.passes) <= MOST_PASSES
        assert {one.sensor for one in head.passes} <= set(field.nodes)
        if head.leads is not None:
            assert len(head.leads.used) <= MOST_PASSES
    assert len(field.state(BASE).ended) <= 20


@pytest.mark.parametrize("heads", HEADS)
def test_much_that_is_said_is_not_remembered(heads: Heads) -> None:
    field = field_of(LINE, heads=heads).run(ORIGIN_NS + 3 * NS)
    for number in range(500):
        stranger = f"stranger{number}"
        for sender in (stranger, NODES[number % 5]):
            field.inject("n01", Interest(stranger.encode(), number, 0, 1, 0.0, 0.0, 50.0, 0.0, 9.0, 0, 4), sender)
            field.inject("n01", CpaReport(6, number / 1000, number % 256, -20.0, 1.0), sender)
            data = Data(b"n01", 0, sender.encode(), number, 0, 0, encode(CpaReport(6, 1.0, number % 256, -20.0, 1.0)))
            field.inject("n01", data, sender)
    bounded(field)


def belief(*mean: float, sd: float = 1.0, step: int = 6) -> bytes:
    return pack(step, None, {"ml": Gaussian(np.array(mean), sd**2 * np.eye(4))})


@pytest.mark.parametrize("heads", HEADS)
@pytest.mark.parametrize(
    "message",
    [
        FixReport(1, 6, 0, belief(1e30, -1e30, 1e30, 0.0), b""),
        FixReport(1, 6, 0, belief(0.0, 0.0, 0.0, 0.0), bytes(16)),
        FixReport(1, 6, 0, belief(0.0, 0.0, 1.0, 0.0, step=65535), bytes(16)),
        FixReport(1, 6, 0, pack(6, None, {"ml": None}), bytes(16)),
        FixReport(1, 6, 0, pack(6, None, {"other": Gaussian(np.zeros(4), np.eye(4))}), bytes(16)),
        FixReport(65535, 6, 255, b"", b""),
    ],
)
def test_what_no_head_tells(heads: Heads, message: FixReport) -> None:
    """It comes as data for each sink, as if of a head, and from a neighbour; the field goes on, and makes its fix."""
    field = field_of(Line(3.0, 2.0, 80.0, at_s=10.0), heads=heads, radius_m=80.0).run(ORIGIN_NS + 3500 * MS)
    for id in (BASE, *field.nodes):
        for number in range(4):
            field.inject(id, Data(id.encode(), number, b"n02", number, 0, 0, encode(message)), "n02")
        if consumes(field, id, message):
            field.inject(id, message, "n02")
    field.until(18)
    assert [point.refused for point in field.events(BASE)][-1] == ""
    assert field.error(field.lines[0])[0] < 0.1


def test_only_its_own_ear_hands_anything_over() -> None:
    field = field_of(LINE).until(3)
    field.inject("n00", Arrived(b"n02", encode(CpaReport(6, 1.0, 0, -20.0, 1.0))), "n02")
    assert field.head("n00").passes == ()
    assert field.reasons("n00")[-1] == "unexpected"


stored = st.binary(max_size=60) | st.lists(st.integers(0, 3) | st.text(max_size=3), max_size=6).map(msgpack.packb)


@settings(max_examples=15, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(stored, st.booleans(), st.sampled_from(HEADS))
def test_whatever_was_stored_a_life_begins(data: bytes, wrapped: bool, heads: Heads) -> None:
    field = field_of(LINE, heads=heads).until(3)
    for id in ("n00", BASE):
        field.kill(id)
        whole = wrapped and id != BASE
        field.actors[id].stored = msgpack.packb({"ear": data, "hearing": b"x"}) if whole else data
        field.start(id)
    field.until(8)
