"""Bad orders and questions at ``control``, and bad liveliness tokens."""

from __future__ import annotations

import time
from dataclasses import replace

import msgpack

from tests.hostile.samples import ALARM, REFUSED, Draw, Means, Sample, bad
from trackfield.role import NS
from trackfield.wire import keys

CONTROL, LIVE = "control", "live"


def number(draw: Draw) -> bytes:
    """What might be an instant, or not."""
    now_ns = draw.known.now_ns
    numbers = [0, 1, -5, 3 * NS, now_ns, now_ns + NS, time.monotonic_ns(), time.monotonic_ns() + NS, 10**30]
    return draw.choice([str(draw.choice(numbers)).encode(), b"", b"nan", b"\xff\xfe", b"9" * 5000, draw.junk()])


@bad(CONTROL, REFUSED | ALARM)
def forged_start(draw: Draw) -> Sample:
    return Sample(keys.START, number(draw))


@bad(CONTROL, REFUSED | ALARM)
def forged_end(draw: Draw) -> Sample:
    return Sample(keys.END, number(draw))


@bad(CONTROL, REFUSED | ALARM)
def forged_stop(draw: Draw) -> Sample:
    return Sample(keys.STOP, draw.choice([b"", number(draw)]))


@bad(CONTROL, REFUSED | ALARM)
def forged_finish(draw: Draw) -> Sample:
    deaths = [[draw.anyone(), 3.0, "signal 9"]]
    values = [5, None, {"a": 1}, deaths, [], [[1, 2]], [["\x1b[2J", None, "\x07"]], draw.value()]
    return Sample(keys.FINISH, draw.choice([msgpack.packb(draw.choice(values)), draw.junk()]))


@bad(CONTROL, REFUSED | ALARM)
def forged_life(draw: Draw) -> Sample:
    plain = {"id": draw.anyone(), "role": "node", "factory": "subprocess:check_call", "incarnation": 7, "start_ns": 0}
    values = [{"a": 1}, 5, [], plain, draw.value()]
    return Sample(keys.LIFE, draw.choice([msgpack.packb(draw.choice(values)), draw.junk()]))


@bad(CONTROL, REFUSED | ALARM)
def mutated_order(draw: Draw) -> Sample | None:
    orders = draw.known.heard_below("control/")
    if not orders:
        return None
    order = draw.choice(orders)
    if draw.random() < 0.3:  # as it is, but at the key of another
        key = draw.choice([k for k in (keys.START, keys.END, keys.STOP, keys.FINISH) if k != order.key])
        return replace(order, key=key)
    return replace(order, payload=draw.mutated(order.payload))


@bad(CONTROL, REFUSED)
def order_once_more(draw: Draw) -> Sample | None:
    orders = draw.known.heard_below("control/")
    return draw.choice(orders) if orders else None


@bad(CONTROL, REFUSED)
def order_that_is_none(draw: Draw) -> Sample:
    key = draw.choice(["control/go", "control/\x1b[2J", "control/recorder/death", "control/join/n000", "control/claim"])
    return Sample(key, number(draw))


@bad(CONTROL, REFUSED)
def deleted_order(draw: Draw) -> Sample:
    return Sample(draw.choice([keys.START, keys.END, keys.STOP, keys.FINISH, keys.LIFE]), means=Means.DELETE)


@bad(CONTROL, REFUSED)
def question_for_a_place(draw: Draw) -> Sample:
    names = [b"", b"ghost", b"\xff\xfe", draw.anyone().encode(), b"n000~1", b"a" * 10_000, b"\x1b[2J", draw.junk()]
    return Sample(f"{keys.JOIN}/{draw.anyone()}", draw.choice(names), means=Means.QUERY)


@bad(CONTROL, REFUSED)
def claim_of_a_place(draw: Draw) -> Sample:
    values = [["node", "host"], ["fusion", "h"], ["ghost", "h"], ["\x1b[2J", "h"], 5, [], {}, draw.value()]
    return Sample(keys.CLAIM, draw.choice([msgpack.packb(draw.choice(values)), b"", draw.junk()]), means=Means.QUERY)


@bad(CONTROL, REFUSED)
def question_of_a_slice(draw: Draw) -> Sample:
    """For a share of the field, or for the time."""
    words = [draw.choice(["join", "confirm", "leave", "\x1b[2J"]), draw.choice(["1", "auto", "-1", "9" * 400, "²"])]
    values = [
        [*words, "2", "h", "0.0.0", "0" * 48, b"12345678"],
        [*words, "0", "h", "", "", b""],
        words,
        5,
        {},
        draw.value(),
    ]
    payload = draw.choice([msgpack.packb(draw.choice(values)), b"", draw.junk()])
    return Sample(draw.choice([keys.SLICE, keys.CLOCK]), payload, means=Means.QUERY)


@bad(CONTROL, REFUSED)
def question_to_all(draw: Draw) -> Sample:
    return Sample(draw.choice(["control/*", "**", "*/join"]), draw.choice([b"n000", b"", b"\xff"]), means=Means.QUERY)


# --- liveliness tokens ------------------------------------------------------------------------------------------------


@bad(LIVE, REFUSED)
def token_of_a_stranger(draw: Draw) -> Sample:
    name = draw.choice([draw.stranger(), "\x1b[2J", "n000~3", "a/b/c", "recorder~1"])
    return Sample(f"live/{name}", means=Means.TOKEN)


@bad(LIVE, REFUSED)
def token_of_another(draw: Draw) -> Sample:
    return Sample(keys.live(draw.choice([draw.anyone(), "recorder"])), means=Means.TOKEN)


@bad(LIVE, REFUSED)
def token_of_a_launcher(draw: Draw) -> Sample:
    session = draw.choice(["", "/", "/0123456789abcdef", "/\x1b[2J", "/a/b"])
    return Sample(f"{keys.LAUNCHER}{session}".rstrip("/"), means=Means.TOKEN)


@bad(LIVE, REFUSED)
def sample_in_place_of_a_token(draw: Draw) -> Sample:
    return Sample(keys.live(draw.anyone()), draw.junk(), means=draw.choice([Means.PUT, Means.DELETE]))
