"""Envelopes: the attachment of a data frame."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.wire import Envelope, WireError

VECTORS = json.loads((Path(__file__).parent / "golden" / "wire.json").read_text())["envelopes"]
TIMES = st.integers(0, 2**63 - 1)
SHORTS = st.integers(0, 2**16 - 1)
LONGS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: v["hex"])
def test_golden_envelopes(vector: dict[str, Any]) -> None:
    envelope = Envelope(**vector["fields"])
    assert envelope.pack().hex() == vector["hex"]
    assert Envelope.unpack(bytes.fromhex(vector["hex"])) == envelope


@given(TIMES, SHORTS, SHORTS, LONGS, TIMES, st.none() | LONGS, TIMES)
def test_round_trip(
    sent_ns: int, incarnation: int, copy: int, seq: int, put_ns: int, version: int | None, preamble_ns: int
) -> None:
    longer = {} if version is None else {"preamble_ns": preamble_ns}
    envelope = Envelope(sent_ns, incarnation, copy, seq, put_ns, version, **longer)
    assert len(envelope.pack()) == (24 if version is None else 36 if preamble_ns else 28)
    assert Envelope.unpack(envelope.pack()) == envelope


@given(st.binary(max_size=40) | st.sampled_from([24, 28, 36]).flatmap(lambda n: st.binary(min_size=n, max_size=n)))
def test_no_bytes_crash_it(data: bytes) -> None:
    try:
        envelope = Envelope.unpack(data)
    except WireError as error:
        assert error.reason == ("range" if len(data) in (24, 28, 36) else "envelope")
    else:
        assert envelope.pack() == data


@pytest.mark.parametrize("data", [None, "x" * 24, 24, bytearray(24)])
def test_only_bytes_are_an_attachment(data: Any) -> None:
    with pytest.raises(WireError) as caught:
        Envelope.unpack(data)
    assert caught.value.reason == "envelope"


@pytest.mark.parametrize(
    "fields",
    [
        {"sent_ns": -1},
        {"sent_ns": 2**63},
        {"sent_ns": 0, "put_ns": -1},
        {"sent_ns": 0, "put_ns": 2**63},
        {"sent_ns": 0, "incarnation": -1},
        {"sent_ns": 0, "incarnation": 2**16},
        {"sent_ns": 0, "copy": 2**16},
        {"sent_ns": 0, "seq": 2**32},
        {"sent_ns": 0, "version": -1},
        {"sent_ns": 0, "version": 2**32},
        {"sent_ns": 0, "version": 0, "preamble_ns": -1},
        {"sent_ns": 0, "version": 0, "preamble_ns": 2**63},
        {"sent_ns": 0, "preamble_ns": 1},
        {"sent_ns": 0.5},
    ],
    ids=str,
)
def test_what_does_not_fit(fields: dict[str, Any]) -> None:
    with pytest.raises(WireError) as caught:
        Envelope(**fields).pack()
    assert caught.value.reason == "range"
