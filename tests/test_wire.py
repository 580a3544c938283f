"""Messages, their registry and their bytes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgpack
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from trackfield import wire
from trackfield.wire import (
    Blob,
    Doa,
    Range,
    Rss,
    Scaled,
    SyncReply,
    SyncRequest,
    Threshold,
    Track,
    WireError,
    decode,
    encode,
    kind,
    kind_name,
    registry,
)

VECTORS = json.loads((Path(__file__).parent / "golden" / "wire.json").read_text())

CLASSES = {known.name: known.cls for known in registry.product_kinds()}

steps = st.integers(0, 65535)
bearings = st.floats(0, 360)
levels = st.floats(-50, 200)
integers = st.integers(-(2**63), 2**64 - 1)
values = st.recursive(
    st.none() | st.booleans() | integers | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text() | integers, inner),
    max_leaves=12,
)


def any_of(field: registry.Field) -> st.SearchStrategy[Any]:
    if isinstance(field, registry.Bytes):
        return st.binary(max_size=field.blob.most)
    low, high = field.scaled.low, field.scaled.high
    return st.integers(int(low), int(high)) if field.integral else st.floats(low, high)


def any_value(field: registry.Field) -> st.SearchStrategy[Any]:
    return st.lists(any_of(field), min_size=1, max_size=26).map(tuple) if field.many else any_of(field)


messages = st.sampled_from(registry.product_kinds()).flatmap(
    lambda known: st.builds(known.cls, *map(any_value, known.fields))
)


@pytest.fixture
def own_kinds() -> Iterator[None]:
    """Forget the kinds that a test registers."""
    tables: tuple[dict[Any, Any], ...] = (
        registry._by_number, registry._by_name, registry._by_class, registry._most_bytes,
    )  # fmt: skip
    kept = [dict(table) for table in tables]
    yield
    for table, before in zip(tables, kept, strict=True):
        table.clear()
        table.update(before)


def reason_of(data: Any) -> str:
    with pytest.raises(WireError) as caught:
        decode(data)
    return caught.value.reason


def message_of(vector: dict[str, Any]) -> Any:
    """The message of a vector, where bytes are texts of hexadecimal digits."""
    read = {list: tuple, str: bytes.fromhex}
    fields = {name: read.get(type(value), lambda same: same)(value) for name, value in vector["fields"].items()}
    return CLASSES[vector["kind"]](**fields)


# --- golden vectors: written from the MessagePack specification, not from this codec ---


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda v: v["hex"][:60])
def test_golden_messages(vector: dict[str, Any]) -> None:
    message = message_of(vector)
    assert kind_name(message) == vector["kind"]
    assert encode(message).hex() == vector["hex"]
    assert decode(bytes.fromhex(vector["hex"])) == message


def test_every_kind_has_its_golden_messages() -> None:
    assert {vector["kind"] for vector in VECTORS["messages"]} == set(CLASSES)


@pytest.mark.parametrize("vector", VECTORS["spellings"], ids=lambda v: v["what"])
def test_other_spellings_of_the_same_integers_are_accepted(vector: dict[str, Any]) -> None:
    assert encode(decode(bytes.fromhex(vector["hex"]))).hex() == vector["canonical"]


@pytest.mark.parametrize("vector", VECTORS["refused"], ids=lambda v: v["what"])
def test_golden_refusals(vector: dict[str, Any]) -> None:
    assert reason_of(bytes.fromhex(vector["hex"])) == vector["reason"]


# --- round trip ---


@given(steps, bearings, levels)
@example(1, 359.996, 0.0)
@example(1, 360.0, 0.0)
@example(1, -0.0, -0.004)
def test_a_report_comes_back_within_half_a_resolution(step: int, bearing: float, level: float) -> None:
    data = encode(Doa(step, bearing, level))
    back = decode(data)
    assert len(data) <= 16
    assert back.step == step
    turn = abs(back.bearing_deg - bearing)
    assert min(turn, 360 - turn) <= 0.005 + 1e-9
    assert abs(back.level_db - level) <= 0.005 + 1e-9
    assert 0 <= back.bearing_deg < 360
    assert encode(back) == data


@pytest.mark.parametrize("cls", [Range, Rss])
@given(st.data())
def test_a_range_and_a_level_take_few_bytes(cls: Any, data: st.DataObject) -> None:
    """Whatever they are."""
    message = data.draw(st.builds(cls, *map(any_value, registry.kind_of_class(cls).fields)))
    assert len(encode(message)) <= 12


@settings(max_examples=400)
@given(messages)
def test_any_message_comes_back_within_half_a_resolution(message: Any) -> None:
    known = registry.kind_of(message)
    data = encode(message)
    back = decode(data)
    assert type(back) is type(message)
    assert encode(back) == data
    for field in known.fields:
        sent, came = getattr(message, field.name), getattr(back, field.name)
        if isinstance(field, registry.Bytes) or field.integral:
            assert came == sent
        else:
            off = abs(came - sent)
            turn = field.scaled.high - field.scaled.low + field.scaled.resolution
            near = field.scaled.resolution / 2 + math.ulp(sent) + 1e-9
            assert min(off, turn - off if field.scaled.cyclic else off) <= near


@pytest.mark.parametrize(
    ("bearing", "decoded"),
    [(359.994, 359.99), (359.996, 0.0), (360.0, 0.0), (360.004, 0.0), (-0.004, 0.0), (-1e-17 % 360, 0.0)],
)
def test_a_bearing_wraps_to_north(bearing: float, decoded: float) -> None:
    assert decode(encode(Doa(1, bearing, 0.0))).bearing_deg == decoded


def test_an_integer_will_do_for_a_float() -> None:
    back = decode(encode(Doa(3, 90, 70)))
    assert back == Doa(3, 90.0, 70.0)
    assert isinstance(back.bearing_deg, float)


def test_decoded_decimals_are_the_nearest_floats() -> None:
    assert [decode(encode(Doa(0, n / 100, 0.0))).bearing_deg for n in range(36000)] == [
        float(f"{n // 100}.{n % 100:02}") for n in range(36000)
    ]


# --- what cannot be sent ---


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Doa(-1, 0.0, 0.0), "range"),
        (Doa(65536, 0.0, 0.0), "range"),
        (Doa(10**5000, 0.0, 0.0), "range"),
        (Doa(0, -0.006, 0.0), "range"),
        (Doa(0, 360.006, 0.0), "range"),
        (Doa(0, 10**400, 0.0), "range"),
        (Doa(0, math.nan, 0.0), "range"),
        (Doa(0, math.inf, 0.0), "range"),
        (Doa(0, 0.0, -math.inf), "range"),
        (Doa(0, 0.0, 1.7e308), "range"),
        (Doa(0, 0.0, -50.006), "range"),
        (Doa(0, 0.0, 200.006), "range"),
        (Doa(1.0, 0.0, 0.0), "type"),  # type: ignore[arg-type]
        (Doa(True, 0.0, 0.0), "type"),
        (Doa(0, False, 0.0), "type"),
        (Doa(0, "90", 0.0), "type"),  # type: ignore[arg-type]
        (Doa(0, 0.0, None), "type"),  # type: ignore[arg-type]
        (SyncRequest(-1, 0), "range"),
        (SyncRequest(0, 10**15 + 1), "range"),
        (SyncRequest(0, 1.5), "type"),  # type: ignore[arg-type]
        (SyncReply(0, 0, -(10**15) - 1, 0), "range"),
        (Threshold(65536, 50.0), "range"),
        (Threshold(0, math.nan), "range"),
        (Track(0, 0, 0, 1, 4, bytes(1025), b""), "range"),
        (Track(0, 0, 0, 1, 4, bytearray(4), b""), "type"),  # type: ignore[arg-type]
        (Track(0, 0, 0, 1, 4, "", b""), "type"),  # type: ignore[arg-type]
        (Doa, "kind"),
        ("doa", "kind"),
        (None, "kind"),
        ([1, 1, 0, 0, 0], "kind"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_unsendable(message: object, reason: str) -> None:
    with pytest.raises(WireError) as caught:
        encode(message)
    assert caught.value.reason == reason
    assert isinstance(caught.value, ValueError)


def test_only_messages_have_a_kind() -> None:
    with pytest.raises(WireError) as caught:
        kind_name(object())
    assert caught.value.reason == "kind"


# --- what arrives ---


def refused_or_canonical(data: bytes) -> None:
    """Nothing but WireError may come out, and what is accepted is a message that encodes again."""
    try:
        message = decode(data)
    except WireError as error:
        assert error.reason in {"size", "malformed", "version", "kind", "fields", "type", "range"}
    else:
        assert decode(encode(message)) == message


@settings(max_examples=1000)
@given(st.binary(max_size=300))
@example(b"")
@example(b"\xc1")
@example(b"\x91" * 256)
@example(b"\xdd\xff\xff\xff\xff")
@example(b"\xc9\xff\xff\xff\xff\x01")
@example(b"\xd6\xff\xff\xff\xff\xff")
@example(b"\xd7\xff" + b"\xff" * 8)
@example(b"\xc7\x0c\xff" + b"\xff" * 12)
@example(b"\x81\x90\x01")
@example(b"\x81\xc4\x01\x00\x01")
@example(b"\xa1\xff")
def test_no_bytes_crash_the_decoder(data: bytes) -> None:
    refused_or_canonical(data)


@settings(max_examples=300)
@given(st.lists(values, max_size=7))
def test_no_messagepack_crashes_the_decoder(array: list[Any]) -> None:
    refused_or_canonical(_packed(array))


@settings(max_examples=300)
@given(st.sampled_from(registry.product_kinds()), st.data())
def test_no_field_crashes_the_decoder(known: registry.Kind, data: st.DataObject) -> None:
    wrong = [data.draw(values | any_of(field)) for field in known.fields]
    refused_or_canonical(_packed([1, known.number, *wrong]))


@settings(max_examples=800)
@given(messages, st.integers(0, 40), st.integers(1, 255))
def test_a_flipped_byte_never_crashes_the_decoder(message: object, at: int, mask: int) -> None:
    data = bytearray(encode(message))
    data[at % len(data)] ^= mask
    refused_or_canonical(bytes(data))


def _packed(array: list[Any]) -> bytes:
    packed: bytes = msgpack.packb(array, unicode_errors="surrogatepass")
    return packed


@pytest.mark.parametrize("data", [None, "\x95", 5, [1, 1, 0, 0, 0], bytearray(b"\x95"), memoryview(b"\x95")])
def test_only_bytes_are_a_payload(data: object) -> None:
    assert reason_of(data) == "type"


def test_a_long_payload_is_refused_unread() -> None:
    assert reason_of(bytes(wire.MAX_BYTES + 1)) == "size"
    assert reason_of(bytes(wire.MAX_BYTES)) == "malformed"


def test_each_kind_has_a_limit_of_its_own() -> None:
    """27 numbers are at most 256 bytes; others have as many more as their fields of bytes may hold."""
    limits = {known.name: known.most_bytes for known in registry.product_kinds()}
    assert [limits.pop(kind) - 256 for kind in ("route", "hop-ack")] == [32, 32]
    assert limits.pop("hop") == 256 + 2 * 32 + 3700 <= wire.MAX_BYTES
    assert limits.pop("track") == 256 + 1024 + 2048 <= wire.MAX_BYTES
    bytes_of_clusters = {
        "wake": 32 + 255, "merge": 512, "aggregate": 3500, "hand-over": 3700, "share": 32 + 1024, "roster": 512,
        "led-track": 512 + 1024, "doubt": 32, "alive": 32,
    }  # fmt: skip
    assert {kind: limits.pop(kind) - 256 for kind in bytes_of_clusters} == bytes_of_clusters
    bytes_of_peers = {"join-claim": 32, "poll": 100, "estimate": 1024, "local-estimate": 1024}
    assert {kind: limits.pop(kind) - 256 for kind in bytes_of_peers} == bytes_of_peers
    bytes_of_diffusion = {
        "interest": 32, "data": 2 * 32 + 1024, "reinforce": 2 * 32, "data-ack": 32, "arrived": 32 + 1024,
    }  # fmt: skip
    assert {kind: limits.pop(kind) - 256 for kind in bytes_of_diffusion} == bytes_of_diffusion
    bytes_of_passes = {"fix": 1024 + 8 * 8}
    assert {kind: limits.pop(kind) - 256 for kind in bytes_of_passes} == bytes_of_passes
    bytes_beyond = {"carried": 2 * 32 + 1400, "item": 32 + 1200, "visca": 16, "order": 8, "order-reply": 8}
    assert {kind: limits.pop(kind) - 256 for kind in bytes_beyond} == bytes_beyond
    assert set(limits.values()) == {256}
    assert reason_of(_packed([1, 1, 3, 100, bytes(300)])) == "size"
    assert reason_of(_packed([1, 1, 3, 100, bytes(200)])) == "type"
    largest = Track(10**15, 2**32 - 1, 255, 3, 16, bytes(1024), bytes(2048))
    assert decode(encode(largest)) == largest
    assert reason_of(_packed([1, 6, 0, 0, 0, 1, 4, bytes(1025), b""])) == "range"
    assert reason_of(_packed([1, 6, 0, 0, 0, 1, 4, bytes(1024), bytes(2049)])) == "range"
    assert reason_of(_packed([1, 6, 0, 0, 0, 1, 4, b"", bytes(3400)])) == "size"


@pytest.mark.parametrize(
    ("array", "reason"),
    [
        (5, "malformed"),
        ([], "malformed"),
        ([1], "malformed"),
        ({1: 1}, "malformed"),
        ([True, 1, 0, 0, 0], "type"),
        ([1.0, 1, 0, 0, 0], "type"),
        ([0, 1, 0, 0, 0], "version"),
        ([1, True, 0, 0, 0], "type"),
        ([1, [1], 0, 0, 0], "type"),
        ([1, 255, 0, 0, 0], "kind"),
        ([1, -1, 0, 0, 0], "kind"),
        ([1, 1], "fields"),
        ([1, 2, 0, 0, 0], "fields"),
        ([1, 3, 0, 0, 0], "fields"),
        ([1, 3, 0, 0, 0, 0.5], "type"),
        ([1, 4, 0, 20001], "range"),
        ([1, 1, 0, 0, "0"], "type"),
        ([1, 1, 0, 0, b"0"], "type"),
        ([1, 1, 0, 0, [0]], "type"),
        ([1, 1, 2**64 - 1, 0, 0], "range"),
        ([1, 1, -(2**63), 0, 0], "range"),
        ([1, 1, 0, 0, -5001], "range"),
    ],
    ids=str,
)
def test_refused(array: object, reason: str) -> None:
    assert reason_of(msgpack.packb(array)) == reason


# --- kinds of one's own ---


@pytest.mark.usefixtures("own_kinds")
def test_a_kind_of_ones_own() -> None:
    @kind(200, "wind")
    @dataclass(frozen=True, slots=True)
    class Wind:
        speed: Annotated[float, Scaled(0, 100, 0.5, "m/s")]
        count: Annotated[int, Scaled(-(2**63), 2**63 - 1)]

    gust = Wind(12.3, -(2**63))
    assert kind_name(gust) == "wind"
    assert encode(gust) == b"\x94\x01\xcc\xc8\x19\xd3\x80" + bytes(7)
    assert decode(encode(gust)) == Wind(12.5, -(2**63))
    own = ["doa", "sync-request", "sync-reply", "threshold", "measurement", "track", "range", "rss", "energy"]
    own += ["route", "hop", "hop-ack", "announce", "solicit", "join", "admit", "wake", "no-target", "merge"]
    own += ["aggregate", "hand-over", "hand-over-ack", "share", "roster", "led-track", "doubt", "alive"]
    own += ["claim", "join-claim", "poll", "result", "estimate", "dissolve", "local-estimate"]
    own += ["cpa-report", "cpa-report-sds", "interest", "data", "reinforce", "data-ack", "fix", "arrived"]
    own += ["carried", "item", "item-ack", "subscribe", "capture", "captured", "visca", "order", "order-reply"]
    assert [known.name for known in registry.product_kinds()] == own


@pytest.mark.usefixtures("own_kinds")
def test_a_kind_that_ends_in_any_number_of_numbers() -> None:
    @kind(201, "spectrum")
    @dataclass(frozen=True, slots=True)
    class Spectrum:
        levels: tuple[Annotated[float, Scaled(-10, 10, 0.5)], ...]

    assert encode(Spectrum((1.0, -2.26))) == b"\x94\x01\xcc\xc9\x02\xfb"
    assert decode(encode(Spectrum((1.0, -2.26)))) == Spectrum((1.0, -2.5))
    for levels in ((), (0.0,) * 28):
        with pytest.raises(WireError, match="spectrum has 1 to 27"):
            encode(Spectrum(levels))
    with pytest.raises(TypeError, match="two: up to 6256 bytes, at most 4096 fit a message"):

        @kind(202, "two")
        @dataclass(frozen=True, slots=True)
        class Large:
            one: Annotated[bytes, Blob(3000)]
            other: Annotated[bytes, Blob(3000)]

    with pytest.raises(TypeError, match="only the last field may be a tuple"):

        @kind(202, "two")
        @dataclass(frozen=True, slots=True)
        class Two:
            levels: tuple[Annotated[float, Scaled(-10, 10, 0.5)], ...]
            step: Annotated[int, Scaled(0, 1)]


@pytest.mark.usefixtures("own_kinds")
@pytest.mark.parametrize(
    ("number", "name"), [(1, "other"), (201, "doa"), (0, "zero"), (256, "big"), (-1, "less"), (202, "a/b")]
)
def test_a_number_or_name_that_is_taken_or_invalid(number: int, name: str) -> None:
    @dataclass(frozen=True)
    class Other:
        x: Annotated[int, Scaled(0, 1)]

    with pytest.raises(ValueError, match=r"collides|not in 1\.\.255|not an id"):
        kind(number, name)(Other)
    with pytest.raises(WireError):
        encode(Other(0))


@pytest.mark.usefixtures("own_kinds")
@pytest.mark.parametrize(
    "hint",
    [
        int,
        Annotated[int, "metres"],
        Annotated[str, Scaled(0, 1)],
        Annotated[int, Scaled(0, 1), Scaled(0, 1)],
        Annotated[int, Scaled(0, 1, 0.5)],
        Annotated[float, Scaled(0, 1, 0.3)],
        Annotated[float, Scaled(1, 0)],
        Annotated[float, Scaled(0, 1e18, 0.01)],
        bytes,
        Annotated[bytes, Scaled(0, 1)],
        Annotated[int, Blob(4)],
        Annotated[bytes, Blob(0)],
        Annotated[bytes, Blob(3841)],
        tuple[Annotated[bytes, Blob(4)], ...],
    ],
    ids=str,
)
def test_a_field_that_cannot_be_encoded(hint: Any) -> None:
    with pytest.raises(TypeError, match=r"^x: "):
        registry.field_of("x", hint)


@pytest.mark.usefixtures("own_kinds")
def test_the_largest_message_fits() -> None:
    hint = Annotated[int, Scaled(-(2**63), 0)]
    names = [f"f{i}" for i in range(registry.MAX_FIELDS + 1)]

    def make(count: int) -> type:
        return dataclass(type("Long", (), {"__annotations__": dict.fromkeys(names[:count], hint)}))

    with pytest.raises(TypeError, match="at most 27"):
        kind(254, "longer")(make(registry.MAX_FIELDS + 1))
    longest = kind(255, "long")(make(registry.MAX_FIELDS))
    message = longest(*[-(2**63)] * registry.MAX_FIELDS)
    assert len(encode(message)) <= wire.MAX_BYTES
    assert decode(encode(message)) == message


def test_an_error_says_what_and_why() -> None:
    assert str(WireError("range", "step: 7")) == "range: step: 7"
    assert str(WireError("key")) == "key"
