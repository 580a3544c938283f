"""The seal on orders, answers and telemetry, and how samples are taken apart that may be anything."""

from __future__ import annotations

import logging
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.drivers.exchange.intake import LOGGED, SHOWN, Refusals, begun, nanoseconds, printable, read, unpacked
from trackfield.drivers.exchange.seal import TOKEN, Seal, token_from
from trackfield.wire.error import WireError

KEY, DATA = "control/end", b"3000000000"


def stamped(token: bytes = b"secret", key: str = KEY, data: bytes = DATA) -> bytes:
    stamp = Seal(token).stamp(key, data)
    assert stamp is not None
    return stamp


def reason(call: Any, *arguments: Any) -> str:
    with pytest.raises(WireError) as caught:
        call(*arguments)
    return caught.value.reason


def test_what_a_holder_of_the_token_sent_passes_once() -> None:
    mine, theirs = Seal(b"secret"), Seal(b"secret")
    first, second = mine.stamp(KEY, DATA), mine.stamp(KEY, DATA)
    theirs.check(KEY, DATA, first)
    theirs.check(KEY, DATA, second)
    assert [reason(theirs.check, KEY, DATA, stamp) for stamp in (first, second)] == ["seal", "seal"]
    theirs.check("control/stop", b"", mine.stamp("control/stop", b""))


def test_all_else_does_not() -> None:
    for key, data, stamp in [
        (KEY, DATA, None),
        (KEY, DATA, b""),
        (KEY, DATA, bytes(24)),
        (KEY, DATA, stamped()[:-1]),
        (KEY, DATA, stamped() + b"\0"),
        (KEY, DATA, stamped(b"another")),
        ("control/start", DATA, stamped()),
        (KEY, b"2000000000", stamped()),
    ]:
        assert reason(Seal(b"secret").check, key, data, stamp) == "seal"


@given(st.integers(0, 23), st.integers(1, 255))
def test_no_byte_of_it_can_be_changed(at: int, by: int) -> None:
    stamp = bytearray(stamped())
    stamp[at] ^= by
    assert reason(Seal(b"secret").check, KEY, DATA, bytes(stamp)) == "seal"


def test_without_a_token_everything_passes() -> None:
    open_run = Seal()
    assert open_run.stamp(KEY, DATA) is None
    open_run.check(KEY, DATA, b"anything")
    assert (open_run.mark("live/n001"), len(Seal(b"secret").mark("live/n001"))) == ("", 32)


def test_the_token_of_the_environment_may_be_any_text() -> None:
    assert token_from({}, "run") == token_from({TOKEN: ""}, "run") == b""
    tokens = [token_from({TOKEN: text}, "run") for text in ("a", "b", "a" * 1000, "\udcff")]
    tokens.append(token_from({TOKEN: "a"}, "another run"))
    assert len(set(tokens)) == 5
    assert all(Seal(token).stamp(KEY, DATA) for token in tokens)


# --- samples ----------------------------------------------------------------------------------------------------------


@given(st.binary(max_size=40))
def test_any_bytes_are_a_value_or_refused(data: bytes) -> None:
    try:
        unpacked(data)
    except WireError as error:
        assert error.reason == "malformed"


def test_what_is_too_long_or_too_deep_is_refused() -> None:
    assert reason(unpacked, bytes(11), 10) == "size"
    assert reason(unpacked, b"\x91" * 100_000) == "malformed"
    assert unpacked(msgpack.packb({1: [2, (3,)]})) == {1: (2, (3,))}


@pytest.mark.parametrize(
    "error", [KeyError("a"), TypeError("b"), AttributeError("c"), OverflowError("d"), IndexError()]
)
def test_whatever_is_wrong_with_a_value_is_one_error(error: Exception) -> None:
    def parse(_: object) -> None:
        raise error

    assert reason(read, parse, 5) == "malformed"


@pytest.mark.parametrize("order", [b"", b"-1", b"1e3", b"5 ", b"\xb2", b"9" * 21, str(2**63).encode()])
def test_times_of_orders_are_digits(order: bytes) -> None:
    assert reason(nanoseconds, order) == "malformed"


def test_a_run_starts_once() -> None:
    assert begun(None, b"17") == begun(17, b"17") == 17
    assert reason(begun, 17, b"18") == "order"


def test_of_many_refusals_a_log_has_a_few_and_no_control_characters(caplog: pytest.LogCaptureFixture) -> None:
    refusals = Refusals()
    with caplog.at_level(logging.WARNING):
        for _ in range(10_000):
            refusals.add("data/\x1b[31m\n\u202e", WireError("key", "x" * 10_000))
    assert refusals.total == refusals.counts["key"] == 10_000
    assert len(caplog.messages) == LOGGED + 4
    assert all(message.isprintable() and len(message) < 3 * SHOWN for message in caplog.messages)


def test_what_is_printed_is_short_and_plain() -> None:
    assert printable("n001") == "n001"
    assert printable("\x1b[2J\x00\u00e9\u202e") == "\\x1b[2J\\x00\u00e9\\u202e"
    assert len(printable("y" * 500)) <= SHOWN + 3
