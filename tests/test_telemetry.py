"""Telemetry survives its way to the recorder, to the last bit."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.samples import MAX_NS, event_of
from trackfield.drivers.engine.frames import Charge, Died, Frame, Overflowed, Queued, Refused, Told, Undone
from trackfield.drivers.exchange.telemetry import Telemetry, pack
from trackfield.role import NS, Corrected, Note, Publish, Radio, State, TrackPoint
from trackfield.wire.error import WireError

WORDS = st.text(max_size=20)
IDS = st.from_regex(r"[a-z_][a-z0-9_.-]{0,31}", fullmatch=True)
TIMES = st.integers(-MAX_NS, MAX_NS)
NUMBERS = st.floats(allow_nan=False)
MEDIA = st.sampled_from(["field", "backbone"])

KEYS = st.one_of(
    st.tuples(TIMES, st.just(0), WORDS),
    st.tuples(TIMES, st.just(1), WORDS, WORDS, TIMES, st.integers(0, 99), st.integers(0, 9), WORDS, MEDIA),
    st.tuples(TIMES, st.just(2), st.integers(0, 2**32), WORDS),
    st.tuples(TIMES, st.just(3), TIMES, WORDS),
    st.tuples(TIMES, st.just(4)),
)
POINTS = st.builds(
    lambda unknowns, **fields: TrackPoint(
        unknowns=tuple(value for value, _ in unknowns), unknown_sds=tuple(sd for _, sd in unknowns), **fields
    ),
    unknowns=st.lists(st.tuples(NUMBERS, NUMBERS), max_size=3),
    tracker=WORDS,
    target=WORDS,
    at_ns=TIMES,
    status=st.sampled_from(["waiting", "tracking", "coasting"]),
    mean=st.tuples(*[NUMBERS] * 4),
    covariance=st.tuples(*[NUMBERS] * 16),
    sensors=st.lists(WORDS, max_size=4).map(tuple),
    particles=st.binary(max_size=8).map(lambda pair: pair * 8),
    lag=st.integers(0, 9),
    term=st.integers(0, 99),
    known_step=st.none() | st.integers(0, 99),
    event_ns=st.none() | TIMES,
    refused=WORDS,
    source=WORDS,
    origin=st.just("") | IDS,
    step=st.one_of(st.none(), st.integers(0, 65535)),
)
EFFECTS = st.one_of(
    st.builds(State, WORDS, WORDS),
    st.builds(Radio, st.booleans(), MEDIA),
    st.builds(Publish, POINTS),
    st.builds(Note, WORDS),
    st.builds(Corrected, TIMES),
    st.builds(Died, WORDS),
    st.builds(Charge, NUMBERS),
    st.builds(Queued, WORDS, TIMES, TIMES, st.integers(0, 99)),
    st.builds(
        Overflowed,
        st.builds(Frame, IDS, st.integers(0, 9), IDS, TIMES, st.integers(0, 99), WORDS, MEDIA, st.binary(max_size=64)),
    ),
)


@given(st.one_of(st.builds(Told, KEYS, EFFECTS), st.builds(Refused, KEYS, WORDS), st.builds(Undone, KEYS)))
def test_what_is_told_arrives_as_it_was_told(output: Telemetry) -> None:
    assert event_of(pack(output)) == output


def test_keys_still_sort_among_those_of_frames() -> None:
    """The ledger looks a refusal up by the key that it makes of the frame itself."""
    frame = Frame("n0", 0, "doa", 5, 0, "fusion", "field", b"")
    arrived = event_of(pack(Refused(frame.key(7), "late")))
    assert isinstance(arrived, Refused)
    assert arrived.key == frame.key(7)
    assert {frame.key(7): "found"}[arrived.key] == "found"
    assert (7, 0, "start") < arrived.key < (7, 3, 7, "deadline") < (7, 4)


@pytest.mark.parametrize("body", [("rumour", (1, 2)), ("told", (1, 2), "x"), ("", ())])
def test_telemetry_of_no_known_kind_is_refused(body: tuple[Any, ...]) -> None:
    with pytest.raises(WireError, match="malformed"):
        event_of(msgpack.packb(body))


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"origin": "no id!"}, "key"),
        ({"unknowns": (1.0,)}, "malformed"),
        ({"unknowns": (1.0,), "unknown_sds": (1.0, 2.0)}, "malformed"),
        ({"mean": (1.0, 2.0)}, "malformed"),
        ({"known_step": 2**40}, "malformed"),
        ({"event_ns": 2**63}, "malformed"),
        ({"event_ns": 0.5}, "malformed"),
        ({"refused": 7}, "malformed"),
    ],
)
def test_a_point_that_is_none_is_refused(wrong: dict[str, Any], reason: str) -> None:
    point = TrackPoint(**{"tracker": "t", "target": "x", "at_ns": NS, "status": "waiting"} | wrong)
    with pytest.raises(WireError, match=reason):
        event_of(pack(Told((1, 3, 1, "t"), Publish(point))))


def test_half_a_message_is_refused() -> None:
    whole = pack(Told((1, 3, 1, "t"), Publish(TrackPoint("t", "x", NS, "tracking", (1.0,) * 4, (1.0,) * 16))))
    for length in range(len(whole)):
        with pytest.raises(WireError, match=r"malformed"):
            event_of(whole[:length])
