"""Tracks handed on by radio: what arrives is what was sent, with its origin and age; what is of no use is ignored."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.plan.prepare import load, planned
from launcher.record.samples import event_of
from trackfield.drivers.engine.frames import Told
from trackfield.drivers.exchange.telemetry import pack
from trackfield.errors import ScenarioError
from trackfield.role import NS, Ignored, Publish, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.forwarding import (
    Forwarding,
    Gathered,
    Gathering,
    Numbering,
    forwarding,
    message_of,
    point_of,
    sent_dimension,
)
from trackfield.tracking.threshold import position_sd
from trackfield.wire import Track, decode, encode

SENSORS = tuple(f"n{i}" for i in range(300))
BOTH = Numbering(("ekf", "ukf"), SENSORS, NS, origin_ns=5 * NS)
COVARIANCE = (9.0, 0.5, 1.0, 0.0, 0.5, 4.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
POINT = TrackPoint(
    "ukf", "target", 12 * NS, "tracking", (120.5, -80.25, 3.0, -4.0), COVARIANCE, ("n3", "n299"), step=7, source="a"
)
NOW = 12 * NS + 300_000_000


def sent(point: TrackPoint, now: int = NOW, numbering: Numbering = BOTH) -> Track:
    message = message_of(point, numbering, now)
    assert message is not None
    received = decode(encode(message))
    assert isinstance(received, Track)
    return received


def arrived(message: Track, now: int = NOW, numbering: Numbering = BOTH) -> TrackPoint:
    point = point_of(message, "a", numbering, now)
    assert isinstance(point, TrackPoint)
    return point


# --- there and back ---------------------------------------------------------------------------------------------------


def test_a_point_arrives_with_its_instant_and_its_origin() -> None:
    """All of these numbers are float32, so nothing is rounded."""
    message = sent(POINT)
    assert (message.at_us, message.age_ms, message.tracker, message.form, message.dimension) == (
        12_000_000,
        300,
        1,
        1,
        4,
    )
    assert message.sensors == struct.pack("<2H", 3, 299)
    assert arrived(message) == replace(POINT, source="", origin="a")


def test_a_point_with_four_reports_is_82_bytes() -> None:
    point = replace(POINT, at_ns=60 * NS, sensors=SENSORS[:4])
    message = message_of(point, BOTH, 60 * NS + 300_000_000)
    assert len(encode(message)) == 82
    assert len(encode(message_of(replace(point, sensors=()), BOTH, 60 * NS + 300_000_000))) == 74


def test_a_point_without_reports_coasts() -> None:
    point = replace(POINT, sensors=(), status="coasting")
    assert arrived(sent(point)) == replace(point, source="", origin="a")


@pytest.mark.parametrize(
    "change", [{"tracker": "mine"}, {"sensors": ("n3", "x")}, {"at_ns": 10**18 + 501}, {"at_ns": -(10**18) - 501}]
)
def test_what_has_no_number_is_not_sent(change: dict[str, Any]) -> None:
    assert message_of(replace(POINT, **change), BOTH, NOW) is None


def test_all_sensors_of_a_bank_have_numbers() -> None:
    bank = Bank(**planned(load("spcpf", settings=["field.nodes=9"])).tracking)
    assert forwarding(bank, "base").numbering.sensors == tuple(f"n{i:03}" for i in range(9))
    with pytest.raises(ScenarioError, match="do not list 'n000'; expected all sensors of the field"):
        forwarding(bank, "base", sensors=["n001"])


def test_of_a_state_too_long_for_a_message_the_longest_is_that_of_position_and_velocity() -> None:
    assert [sent_dimension(n) for n in (4, 16, 17)] == [4, 16, 4]


def test_unknowns_of_the_sensors_kind_come_along() -> None:
    point = replace(POINT, unknowns=(-1.5, 20.0), unknown_sds=(0.5, 3.0))
    assert sent(point).dimension == 6
    assert arrived(sent(point)) == replace(point, source="", origin="a")
    many = replace(POINT, unknowns=(1.0,) * 13, unknown_sds=(1.0,) * 13)
    assert arrived(sent(many)) == replace(POINT, source="", origin="a")


@pytest.mark.parametrize("step_s", [1.0, 0.1, 1 / 3, 0.0123456789])
def test_an_instant_is_that_of_its_step_to_the_nanosecond(step_s: float) -> None:
    """The message has microseconds; tables and bounds are keyed by instants."""
    numbering = replace(BOTH, step_ns=round(step_s * NS), origin_ns=123_456_789)
    for step in (0, 1, 2, 3, 1000, 65535):
        at_ns = numbering.origin_ns + step * numbering.step_ns
        point = arrived(sent(replace(POINT, at_ns=at_ns), at_ns, numbering), at_ns, numbering)
        assert (point.at_ns, point.step) == (at_ns, step)
    event_ns = numbering.origin_ns + numbering.step_ns // 2
    point = arrived(sent(replace(POINT, at_ns=event_ns), NOW, numbering), NOW, numbering)
    assert abs(point.at_ns - event_ns) <= 500
    assert point.step is None


@given(
    st.tuples(*[st.floats(-1e5, 1e5)] * 4),
    st.lists(st.floats(-100, 100), min_size=16, max_size=16),
    st.lists(st.sampled_from(SENSORS), max_size=9, unique=True),
)
def test_any_point_arrives_to_the_precision_of_float32(
    mean: tuple[float, ...], roots: list[float], sensors: list[str]
) -> None:
    root = np.reshape(roots, (4, 4))
    covariance = root @ root.T + np.eye(4)
    point = replace(POINT, mean=mean, covariance=tuple(covariance.ravel().tolist()), sensors=tuple(sensors))
    back = arrived(sent(point))
    assert back.mean == pytest.approx(mean, rel=2**-24, abs=1e-30)
    sds = np.sqrt(covariance.diagonal())
    off = (np.reshape(back.covariance, (4, 4)) - covariance) / np.outer(sds, sds)
    assert np.abs(off).max() < 1e-5
    assert np.linalg.eigvalsh(np.reshape(back.covariance, (4, 4)))[0] > 0.0
    assert back.sensors == tuple(sensors)


# --- what is not sent -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "other",
    [
        {"mean": (), "covariance": (), "status": "waiting"},
        {"lag": 3},
        {"mean": (float("nan"), 0.0, 0.0, 0.0)},
        {"mean": (1e39, 0.0, 0.0, 0.0)},
        {"covariance": (float("inf"),) * 16},
        {"unknowns": (1.0,), "unknown_sds": (float("nan"),)},
    ],
)
def test_a_point_without_a_track_is_not_sent(other: dict[str, Any]) -> None:
    assert message_of(replace(POINT, **other), BOTH, NOW) is None
    assert Forwarding("base", BOTH).sends([replace(POINT, **other)], NOW) == ()


def test_points_are_sent_in_their_order_to_all_that_are_to_know() -> None:
    to = frozenset({"base", "head"})
    points = [POINT, replace(POINT, tracker="ekf"), replace(POINT, lag=2), replace(POINT, at_ns=11 * NS)]
    sends = Forwarding(to, BOTH, "backbone").sends(points, NOW)
    assert [(send.to, send.medium) for send in sends] == [(to, "backbone")] * 3
    assert [(send.message.tracker, send.message.age_ms) for send in sends] == [(1, 300), (0, 300), (1, 1300)]


def test_of_very_many_reports_a_message_names_the_first() -> None:
    many = replace(BOTH, sensors=[f"m{i}" for i in range(2000)])
    point = replace(POINT, sensors=tuple(many.sensors))
    assert arrived(sent(point, NOW, many), NOW, many).sensors == point.sensors[:1024]


def test_a_clock_that_jumped_makes_no_message_impossible() -> None:
    assert sent(POINT, 0).age_ms == 0
    assert sent(POINT, 2**61).age_ms == 2**32 - 1


@pytest.mark.parametrize("what", [{"trackers": ["t"] * 257}, {"sensors": ["n"] * 65537}])
def test_lists_that_two_bytes_cannot_count_are_refused(what: dict[str, list[str]]) -> None:
    with pytest.raises(ScenarioError, match="cannot be handed on with"):
        replace(BOTH, **what)


# --- what a peer may send ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"tracker": 2}, "unknown tracker"),
        ({"at_us": 13_300_001}, "from the future"),
        ({"at_us": 10**15}, "from the future"),
        ({"at_us": 4_999_999}, "before the first step"),
        ({"at_us": -(10**15)}, "before the first step"),
        ({"sensors": b"\x01"}, "unknown sensor"),
        ({"sensors": struct.pack("<H", 300)}, "unknown sensor"),
        ({"sensors": struct.pack("<2H", 3, 3)}, "unknown sensor"),
        ({"belief": b""}, "unusable belief"),
        ({"belief": bytes(55)}, "unusable belief"),
        ({"dimension": 5}, "unusable belief"),
        ({"form": 2}, "unusable belief"),
        ({"belief": struct.pack("<14f", float("nan"), *[1.0] * 13)}, "unusable belief"),
        ({"belief": struct.pack("<14f", *[0.0] * 4, -1.0, *[0.0] * 9)}, "unusable belief"),
    ],
)
def test_a_message_of_no_use_is_ignored(wrong: dict[str, Any], reason: str) -> None:
    message = replace(sent(POINT), **wrong)
    assert point_of(message, "a", BOTH, NOW) == Ignored(reason)
    gathering = Gathering(BOTH, 10 * NS)
    assert gathering.take(gathering.begin(), NOW, message, "a") == (gathering.begin(), Ignored(reason))


def test_modes_and_particles_become_their_moments() -> None:
    """Two modes of equal weight, 2 m apart to the east; particles at the same places."""
    triangle = (3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    modes = b"".join(struct.pack("<15f", 1.0, x, 0.0, 0.0, 0.0, *triangle) for x in (9.0, 11.0))
    point = arrived(replace(sent(POINT), form=2, belief=modes))
    assert point.mean == (10.0, 0.0, 0.0, 0.0)
    assert point.covariance == pytest.approx((4.0, 0, 0, 0, 0, 3.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0))
    particles = b"".join(struct.pack("<5f", 2.0, x, y, 0.0, 0.0) for x, y in ((9, 1), (11, 1), (9, -1), (11, -1)))
    assert arrived(replace(sent(POINT), form=3, belief=particles)).mean == (10.0, 0.0, 0.0, 0.0)


@given(
    st.builds(
        Track,
        st.integers(-(10**15), 10**15) | st.integers(5_000_000, 13_000_000),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2),
        st.integers(1, 3),
        st.integers(4, 16),
        st.binary(max_size=60)
        | st.lists(st.floats(width=32), min_size=14, max_size=30).map(lambda n: struct.pack(f"<{len(n)}f", *n)),
        st.binary(max_size=6) | st.lists(st.integers(0, 299), max_size=3).map(lambda n: struct.pack(f"<{len(n)}H", *n)),
    ),
    st.integers(0, 2**62),
)
def test_whatever_comes_is_ignored_or_can_be_published(message: Track, now: int) -> None:
    point = point_of(message, "a", BOTH, now)
    if isinstance(point, TrackPoint):
        told = Told((now, 2, now, "t"), Publish(point))
        assert event_of(pack(told)) == told
        assert np.isfinite(point.mean).all() and np.isfinite(point.covariance).all()
    else:
        assert isinstance(point, Ignored)


# --- several senders --------------------------------------------------------------------------------------------------


def take(state: Gathered, point: TrackPoint, sender: str, now: int = NOW, late_ns: int = 0) -> Any:
    """What is known after a message that left ``late_ns`` before it arrived."""
    message = sent(point, now - late_ns)
    return Gathering(BOTH, 3 * NS).take(state, now, message, sender)


def test_of_each_instant_there_is_one_point_of_each_sender() -> None:
    state, points = take(Gathered(), POINT, "b")
    assert [point.origin for point in points] == ["b"]
    state, points = take(state, replace(POINT, covariance=tuple(2.0 * c for c in COVARIANCE)), "a")
    assert [point.origin for point in points] == ["a", "b"]
    assert min(points, key=position_sd).origin == "b"
    _, points = take(state, replace(POINT, at_ns=13 * NS, step=8), "a", 13 * NS + 300_000_000)
    assert [(point.origin, point.step) for point in points] == [("a", 8)]
    _, points = take(state, replace(POINT, tracker="ekf"), "c")
    assert [point.origin for point in points] == ["c"]


def test_a_step_that_was_fused_again_replaces_what_came_before() -> None:
    later = 13 * NS + 300_000_000
    again = replace(POINT, sensors=("n3", "n7", "n299"))
    first, _ = take(Gathered(), POINT, "a")
    _, points = take(first, again, "a", later)
    assert [point.sensors for point in points] == [again.sensors]


def test_the_later_one_counts_also_if_the_radio_delivers_it_first() -> None:
    later = 13 * NS + 300_000_000
    again = replace(POINT, sensors=("n3", "n7", "n299"))
    state, points = take(Gathered(), again, "a", later)
    after, ignored = take(state, POINT, "a", later + 1, late_ns=NS + 1)
    assert (after, ignored) == (state, Ignored("repeated"))
    assert [point.sensors for point in points] == [again.sensors]


def test_what_is_too_old_is_ignored_and_forgotten() -> None:
    state, _ = take(Gathered(), POINT, "a")
    assert take(state, POINT, "b", POINT.at_ns + 3 * NS + 1) == (state, Ignored("late"))
    newer = replace(POINT, at_ns=15 * NS, step=10)
    state, _ = take(state, newer, "a", 15 * NS)
    assert {at_ns for at_ns, _ in state} == {12 * NS, 15 * NS}
    state, _ = take(state, replace(newer, at_ns=16 * NS, step=11), "a", 16 * NS)
    assert {at_ns for at_ns, _ in state} == {15 * NS, 16 * NS}
