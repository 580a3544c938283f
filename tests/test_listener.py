"""What a recorder takes from the wire, and what it refuses: samples by hand, no session."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import msgpack
import pytest
import zenoh

from launcher.record.listener import SETTLE_S, Listener
from launcher.records import Plan
from tests.simulated import spcpf
from trackfield.drivers.engine.frames import Frame, Told
from trackfield.drivers.exchange.incoming import HORIZON_S
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.exchange.telemetry import pack
from trackfield.drivers.exchange.versions import SEEN
from trackfield.drivers.spec import life_name
from trackfield.role import NS, State
from trackfield.wire.codec import encode
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError
from trackfield.wire.messages import Doa

NOW = 5 * NS
REPORT = encode(Doa(1, 90.0, 60.0))
FINAL = {
    "sent": 1, "sent_hash": 0, "heard": 0, "heard_hash": 0, "puts": 1, "retractions": 0, "told": 1,
    "incarnation": 0, "stored": b"", "activity": {"field": [0] * 5}, "inherited": {}, "metered_ns": 0,
    "slip": {}, "latency": {}, "lag": {}, "cpu_s": 0.1,
}  # fmt: skip


@pytest.fixture
def plan() -> Plan:
    return spcpf(1, ["target.steps=5"])


@pytest.fixture
def listener(plan: Plan) -> Listener:
    no_session: Any = None
    return Listener(no_session, plan, Seal())


def report(listener: Listener, sent_ns: int, *, src: str = "n060", to: str = "fusion", **more: Any) -> None:
    payload = more.pop("payload", REPORT)
    listener.take(f"data/field/to/{to}/{src}/doa", payload, Envelope(sent_ns, **more).pack(), NOW)


def sent_by(listener: Listener) -> Counter[str]:
    """How many frames of each life came; none of them is settled."""
    frames = [entry.frame for entry in listener.ledger.leaving._entries.values()]
    return Counter(life_name(frame.src, frame.incarnation) for frame in frames)


def refused(call: Any, *arguments: Any, **more: Any) -> str:
    with pytest.raises(WireError) as caught:
        call(*arguments, **more)
    return caught.value.reason


def test_a_frame_of_a_node_is_entered(listener: Listener) -> None:
    report(listener, NOW)
    report(listener, NOW)
    assert sent_by(listener) == {"n060": 1}


@pytest.mark.parametrize(
    ("reason", "frame"),
    [
        ("future", {"sent_ns": NOW + 51_000_000}),
        ("sender", {"sent_ns": 1, "src": "stranger"}),
        ("receiver", {"sent_ns": 1, "to": "n061"}),
        ("receiver", {"sent_ns": 1, "to": "nobody"}),
        ("receiver", {"sent_ns": 1, "src": "fusion", "to": "fusion"}),
        ("life", {"sent_ns": 1, "incarnation": 1}),
        ("size", {"sent_ns": 1, "payload": bytes(257)}),
        ("size", {"sent_ns": 1, "payload": bytes(10_000_000)}),
    ],
)
def test_a_frame_that_no_process_can_have_sent_is_refused(listener: Listener, reason: str, frame: Any) -> None:
    assert refused(report, listener, **frame) == reason
    assert not sent_by(listener)


def test_a_frame_may_say_that_it_leaves_after_the_end(listener: Listener) -> None:
    """It waited for its radio, and is counted as in flight."""
    end_ns = listener.plan.run.end_ns
    assert refused(report, listener, end_ns) == "future"
    key, queue = "data/field/to/fusion/n060/doa", (listener.plan.run.queue() + 1) * 10 * NS
    assert refused(listener.take, key, REPORT, Envelope(end_ns + queue + 1).pack(), end_ns) == "future"
    listener.take(key, REPORT, Envelope(end_ns + queue).pack(), end_ns)
    assert sent_by(listener) == {"n060": 1}


def test_the_same_frame_with_another_payload_is_a_forgery(listener: Listener) -> None:
    report(listener, 1)
    assert refused(report, listener, 1, payload=encode(Doa(1, 91.0, 60.0))) == "conflict"


def test_a_frame_that_is_taken_back_counts_as_none(listener: Listener) -> None:
    report(listener, 1, version=0)
    report(listener, 1, version=1, payload=b"")
    report(listener, 1, version=0)
    report(listener, 2, version=1, payload=b"")  # overtook the frame
    report(listener, 2, version=0)
    listener.ledger.close()
    assert (listener.ledger.rows, listener.ledger.balance.puts) == ([], {"n060": 4})
    record = {**FINAL, "puts": 4, "sent": 0, "sent_hash": 0, "told": 0}
    listener.take("telemetry/n060/final", msgpack.packb(record), None, NOW)
    assert (listener.ledger.interference()["frames"], listener.ledger.dropped()) == (0, 0)


def test_only_its_own_source_takes_a_frame_back(listener: Listener) -> None:
    """Another sender, life, medium or copy is another frame."""
    report(listener, 1, version=0)
    report(listener, 1, version=1, payload=b"", src="n061")
    report(listener, 1, version=1, payload=b"", copy=1)
    assert refused(report, listener, 1, version=1, payload=b"", incarnation=1) == "life"
    listener.ledger.close()
    assert [row.src for row in listener.ledger.rows] == ["n060"]


@pytest.mark.parametrize("back", [b"", encode(Doa(1, 91.0, 60.0))])
def test_a_frame_without_a_version_is_final(listener: Listener, back: bytes) -> None:
    report(listener, 1)
    assert refused(report, listener, 1, version=1, payload=back) == "conflict"
    report(listener, 2, version=0)
    assert refused(report, listener, 2, payload=REPORT) == "conflict"
    with pytest.raises(WireError):
        report(listener, 3, payload=b"")
    assert sent_by(listener) == {"n060": 2}


def test_a_place_that_sends_without_versions_is_a_foreign_device(plan: Plan) -> None:
    listener = arrived(replace(plan, run=replace(plan.run, speed=1.0)), ("control/start", b"0", None))
    for src, attachment in (("n061", Envelope(1).pack()), ("n062", None), ("n063", Envelope(1, version=0).pack())):
        listener.take(f"data/field/to/fusion/{src}/doa", REPORT, attachment, NOW)
    assert listener.ledger.foreign == {"n061", "n062"}


def test_versions_are_known_for_longer_than_anybody_can_take_a_frame_back(listener: Listener) -> None:
    """However many frames come meanwhile; a recorder has settled it by then."""
    horizon_ns = round(HORIZON_S * listener.plan.run.speed * NS)
    report(listener, 0, version=1, payload=b"")
    for copy in range(SEEN + 10):
        listener._versions.take(Frame("n061", 0, "doa", 5, copy, "fusion", "field", b"?"), 0, NOW)
    listener._versions.take(Frame("n061", 0, "doa", 6, 0, "fusion", "field", b"?"), 0, NOW + horizon_ns)
    report(listener, 0, version=0)
    assert not [entry for entry in listener.ledger.leaving._entries.values() if entry.frame.payload]
    assert round(SETTLE_S * listener.plan.run.speed * NS) > horizon_ns


@pytest.mark.parametrize(
    ("key", "payload", "reason"),
    [
        ("telemetry/ghost/final", msgpack.packb(FINAL), "process"),
        ("telemetry/n060~1/final", msgpack.packb(FINAL), "life"),
        ("telemetry/n060/final", msgpack.packb(5), "malformed"),
        ("telemetry/n060/final", msgpack.packb({**FINAL, "sent": "many"}), "malformed"),
        ("telemetry/n060/final", msgpack.packb({**FINAL, "latency": {5000: 1}}), "malformed"),
        ("telemetry/n060/counts", msgpack.packb({"delivered": 1.5}), "malformed"),
        ("telemetry/n060/event", msgpack.packb(["state", [1, 3], 5, ""]), "malformed"),
        ("telemetry/n060/event", pack(Told((NOW + NS, 4), State("lost"))), "future"),
        ("telemetry/n060/event", pack(Told((2**61, 4), State("lost"))), "future"),
        ("telemetry/n060/rumour", b"", "key"),
        ("telemetry/**", b"", "key"),
        ("**", b"", "key"),
        ("control/start", b"soon", "malformed"),
        ("control/recorder/life", msgpack.packb({"a": 1}), "malformed"),
        ("control/recorder/life", b"\xc1", "malformed"),
        ("control/launcher", b"", "key"),
    ],
)
def test_telemetry_and_orders_that_are_none_are_refused(
    listener: Listener, key: str, payload: bytes, reason: str
) -> None:
    assert refused(listener.take, key, payload, None, NOW) == reason
    assert not listener.ledger.finals
    assert not listener.ledger.counts


def test_a_life_may_be_announced_after_its_first_frame(plan: Plan) -> None:
    """The two come by ways of their own, and a recorder that stood still has both before it."""
    told: list[tuple[str, bytes, bytes | None]] = [
        ("data/field/to/fusion/n060/doa", REPORT, Envelope(NOW, incarnation=1).pack()),
        ("data/field/to/fusion/n060/doa", REPORT, Envelope(NOW, incarnation=2).pack()),
    ]
    listener = arrived(plan, *told)
    assert not sent_by(listener)
    life = next(p for p in plan.processes if p.id == "n060")
    order = msgpack.packb(replace(life, incarnation=1, start_ns=NS).plain())
    come(listener, ("control/start", b"0", None), ("control/recorder/life", order, None))
    assert sent_by(listener) == {"n060~1": 1}
    listener.give_up()
    assert listener.ledger.refused == {"life": 1}
    assert listener.ledger.interference()["frames"] == 1


def arrived(plan: Plan, *samples: tuple[str, bytes, bytes | None], seal: Seal | None = None) -> Listener:
    """A listener that has processed these samples, as if they had come through Zenoh."""
    no_session: Any = None
    listener = Listener(no_session, plan, seal or Seal())
    come(listener, *samples)
    return listener


def come(listener: Listener, *samples: tuple[str, bytes, bytes | None]) -> None:
    for key, payload, attachment in samples:
        listener._inbox.append((NOW, _Sample(key, payload, attachment)))  # type: ignore[arg-type]
    listener.drain()


class _Sample:
    """As much of a ``zenoh.Sample`` as a listener looks at."""

    def __init__(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        self.key_expr = key
        self.payload = zenoh.ZBytes(payload)
        self.attachment = None if attachment is None else zenoh.ZBytes(attachment)


def test_what_has_no_seal_is_refused_and_told(plan: Plan) -> None:
    seal = Seal(b"secret")
    event = pack(Told((1, 4), State("reporting")))
    start = ("control/start", b"0", seal.stamp("control/start", b"0"))
    good = ("telemetry/n060/event", event, seal.stamp("telemetry/n060/event", event))
    forged = [("telemetry/n060/event", event, None), good, ("**", b"", None), ("control/end", b"3", None)]
    listener = arrived(plan, start, good, *forged, seal=Seal(b"secret"))
    assert listener.ledger.balance.told == {"n060": 1}
    assert listener.ledger.interference() == {"frames": 0, "telemetry": 3, "answers": 0}
    assert listener.ledger.run.end_ns == plan.run.end_ns


def test_more_than_a_process_says_it_sent_is_interference(listener: Listener) -> None:
    for t in range(3):
        report(listener, t)
        listener.take("telemetry/n060/event", pack(Told((t, 4), State("reporting"))), None, NOW)
    listener.take("telemetry/n060/final", msgpack.packb({**FINAL, "forged": 4}), None, NOW)
    listener.ledger.close()
    assert listener.ledger.interference() == {"frames": 2, "telemetry": 2, "answers": 4}
    listener.take("telemetry/n060/final", msgpack.packb({**FINAL, "cpu_s": 9.0}), None, NOW)
    assert listener.ledger.interference()["telemetry"] == 3


def test_before_the_start_nothing_can_have_been_sent(plan: Plan) -> None:
    """Frames that only overtook the order to start are entered when it comes."""
    frame = ("data/field/to/fusion/n060/doa", REPORT)
    listener = arrived(plan, *((*frame, Envelope(t).pack()) for t in (1, NOW + NS, 2**62)))
    assert not sent_by(listener)
    come(listener, ("control/start", b"0", None))
    assert sent_by(listener) == {"n060": 1}
    assert listener.ledger.refused == {"future": 2}
