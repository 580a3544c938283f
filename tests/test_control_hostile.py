"""Orders and replies by strangers: other devices of the backbone, and a program at the router of a run."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.controlled import CONTROL, KEY, SYSTEM, VIDEO, Outside
from tests.running import Run, until
from tests.test_control_command import FIELD
from trackfield.drivers.session import open_client
from trackfield.protocols.managed import REFUSAL_NS
from trackfield.protocols.orders import REFUSED, order_for, reply_to
from trackfield.role import NS
from trackfield.wire import decode, encode, keys
from trackfield.wire.outside import RUNNING, STOPPED, Carried, Order, OrderReply

SECRET = bytes.fromhex(KEY)
IDS = ("base", "hop1", CONTROL, VIDEO, SYSTEM, "nobody")

macs = st.binary(max_size=8) | st.sampled_from(
    [order_for(VIDEO, n, verb, SECRET).mac for n in (1, 2) for verb in (1, 2)]
)
orders = st.builds(Order, st.integers(0, 3) | st.just(65535), st.integers(0, 255), macs)
replies = st.builds(
    OrderReply, st.integers(0, 3), st.integers(0, 255), st.integers(0, 255), st.integers(0, 65535), macs
) | st.builds(
    reply_to, orders, st.sampled_from(IDS), st.sampled_from(IDS),
    st.tuples(st.integers(0, 2), st.integers(1, 2), st.just(0)), st.just(bytes(16)),
)  # fmt: skip
origins = st.sampled_from([id.encode() for id in IDS]) | st.binary(max_size=32)
carried = st.builds(
    Carried, origins, origins, st.integers(0, 65535), st.integers(0, 255),
    (orders | replies).map(encode) | st.binary(max_size=30),
)  # fmt: skip
deed = st.tuples(st.floats(0.0, 0.3), st.sampled_from(IDS[:-1]), st.sampled_from(IDS), orders | replies | carried)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2), st.lists(deed, max_size=12))
def test_whatever_strangers_say_orders_are_done_and_nothing_else_is(hops: int, deeds: list[Any]) -> None:
    """Without the key nobody stops anything, and no answer is believed that was not given."""
    field = Outside((1.0, "stop", VIDEO), (2.0, "status", "base"), hops=hops).until(0.9)
    for after_s, dst, src, message in deeds:
        field.until(field.t_ns / NS + after_s)
        if dst in field.actors and not made_by_system(message):
            kind = "order" if isinstance(message, Order) else "order-reply"
            taken = field.actors[dst].role.kinds
            if (kind if not isinstance(message, Carried) else "carried") in taken:
                field.inject(dst, message, src)
    field.until(9)
    assert field.answers() == [(1, "stop", VIDEO, "ok"), (2, "status", "base", "ok")]
    assert {id: field.count(id) == -1 for id in field.managed} == {id: id == VIDEO for id in field.managed}
    assert all(one.dst in field.actors for one in field.sent)


def made_by_system(message: Any) -> bool:
    """Whether this is, or hands on, what only system control can make."""
    inner = message
    if isinstance(message, Carried):
        try:
            inner = decode(message.message)
        except ValueError:
            return False
    return isinstance(inner, Order) and any(
        inner == order_for(id, inner.number, inner.verb, SECRET) for id in IDS
    )  # fmt: skip


def test_overheard_orders_are_of_no_use_to_other_devices() -> None:
    """Said again by themselves, or in the name of system control, at once or later, as they were or for others."""
    field = Outside((1.0, "stop", VIDEO), (2.0, "start", VIDEO)).until(3)
    stop, start = (one.message for one in field.frames("order"))
    for overheard in (stop, start):
        for src in (CONTROL, SYSTEM, "base"):
            for dst in (VIDEO, CONTROL, "base"):
                field.inject(dst, overheard, src)
    field.until(5)
    assert all(field.count(id) > 0 for id in field.managed)
    whys = Counter((id, why) for id, _, why in field.refused())
    # of the 6 that video heard: the last order, in the name of system control, is only answered again
    assert whys == {
        (VIDEO, "old number"): 1,
        (VIDEO, "wrong sender"): 4,
        (CONTROL, "wrong authentication"): 6,
        ("base", "wrong authentication"): 6,
    }


def test_a_flood_costs_a_process_one_answer_a_second() -> None:
    field = Outside().until(1)
    forged = replace(order_for(VIDEO, 1, 2, SECRET), mac=bytes(8))
    for number in range(500):
        field.until(1 + number / 100)
        field.inject(VIDEO, forged, CONTROL)
    assert len(field.frames("order-reply", src=VIDEO)) == 5 * NS // REFUSAL_NS
    assert field.count(VIDEO) > 40


def test_a_program_at_the_router_of_a_run(tmp_path: Path) -> None:
    """It overhears the orders of a run, says them again, and forges others and their answers, a hundred a second."""
    planned = '[[1, "stop", "video"], [2, "start", "video"], [8, "status", "video"]]'
    run = Run(tmp_path / "run", *FIELD, "--set", f"camera.orders={planned}")
    overheard = list[bytes]()

    def hear(sample: zenoh.Sample) -> None:
        overheard.append(sample.payload.to_bytes())

    try:
        manifest = run.manifest()
        with open_client(manifest["endpoint"], manifest["run"]) as stranger:
            key = keys.unicast("backbone", VIDEO, SYSTEM, "order")
            listening = stranger.declare_subscriber(key, hear)
            until(lambda: len(overheard) >= 2)
            listening.undeclare()  # type: ignore[no-untyped-call]
            stop, start = (decode(one) for one in overheard[:2])
            forged = [replace(stop, number=number, mac=bytes(8)) for number in range(3, 43)]
            told: list[tuple[str, str, Any]] = [(VIDEO, SYSTEM, stop), (VIDEO, CONTROL, start), (CONTROL, SYSTEM, stop)]
            told += [(VIDEO, SYSTEM, one) for one in forged]
            told += [(SYSTEM, VIDEO, OrderReply(one.number, 0, 2, 0, bytes(8))) for one in forged]
            begun = time.monotonic()
            for dst, src, message in told:
                kind = "order" if isinstance(message, Order) else "order-reply"
                stranger.put(keys.unicast("backbone", dst, src, kind), encode(message))
                stranger.put(keys.unicast("backbone", dst, src, kind), encode(message)[:-1])
                time.sleep(0.02)
            took_s = time.monotonic() - begun
        code, said = run.finish()
    finally:
        run.process.kill()
        run.process.wait()
    assert code == 0, said
    assert run.metrics()["processes"]["died"] == []
    rows = pq.read_table(run.folder / "messages.parquet").to_pylist()  # of the processes of the run alone
    answered = [decode(row["payload"]) for row in rows if row["kind"] == "order-reply" and row["src"] == VIDEO]
    own = [(one.number, one.state) for one in answered if one.answer != REFUSED]
    assert own[0] == (1, STOPPED)
    assert own[-1] == (3, RUNNING)  # nothing stopped it again
    assert 1 <= len(answered) - len(own) <= took_s * NS / REFUSAL_NS + 2
