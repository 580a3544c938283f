"""A sink, event by event: what it asks for, which fix holds, what it publishes, and its next life."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
import pytest

from fusion.sink import Memory, Phase, Sink
from tests.ether import ORIGIN_NS
from tests.hearing import ANNOUNCE_NS, STEP_NS, named, pentagon, sink_of
from tests.puppet import MS
from trackfield.filters.passes.types import REASONS
from trackfield.filters.types import Gaussian
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    IllegalEvent,
    Note,
    Publish,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    TrackPoint,
)
from trackfield.tracking.stored import pack
from trackfield.wire.clusters import Announce
from trackfield.wire.codec import encode
from trackfield.wire.interests import Data, Interest
from trackfield.wire.messages import SyncReply, SyncRequest
from trackfield.wire.passes import FIXES, CpaReport, FixReport
from trackfield.wire.raw import Raw
from trackfield.wire.raw import pack as pack_raw

PLACES = named(pentagon())
PLACE = (0.0, -40.0)
SINK = sink_of(PLACES, PLACE)
DEADLINE_NS = 450 * MS
RAW = pack_raw([Raw(0, 2.0, -20.0, 1.0), Raw(3, 1.0, -30.0, 1.5)])
"""Of n00 and n03."""


def at(seconds: float) -> int:
    return ORIGIN_NS + round(seconds * NS)


def started(sink: Sink = SINK, stored: bytes = b"", now: int = 0) -> tuple[Memory, tuple[Effect, ...]]:
    return sink.handle(sink.begin(), Started(now, stored))


def asking(sink: Sink = SINK, done: int = 19) -> Memory:
    """A sink that has asked for fixes, and published so many steps."""
    state, _ = started(sink)
    state, _ = sink.handle(state, Timer(at(0), "ask"))
    return replace(state, done=done)


def fix(step: int = 20, number: int = 0, mean: Any = (10.0, 0.0, 13.4, 0.0), raw: bytes = RAW) -> FixReport:
    beliefs = {"ml": Gaussian(np.array(mean, float), np.diag([0.25, 0.25, 0.01, 0.01]))}
    return FixReport(number, step, 0, pack(step, None, beliefs), raw)


def refusal(step: int = 20, reason: int = 1, number: int = 0) -> FixReport:
    return FixReport(number, step, reason, b"", RAW)


def told(
    state: Memory, message: Any, head: str = "n00", now: int = at(10.4), sink: Sink = SINK, serial: int = 0
) -> tuple[Memory, tuple[Effect, ...]]:
    """It comes over the air, as data of a head for the interest of this sink."""
    data = Data(b"base", 0, head.encode(), serial, 1, 0, encode(message))
    return sink.handle(state, Received(now, data, "n03"))


def published(state: Memory, sink: Sink = SINK) -> tuple[Memory, list[TrackPoint]]:
    """The points of its next step."""
    now = ORIGIN_NS + (state.done + 1) * STEP_NS + DEADLINE_NS
    state, effects = sink.handle(state, Timer(now, "step"))
    assert effects[-1] == SetTimer("step", now + STEP_NS)
    return state, [one.estimate for one in effects if isinstance(one, Publish)]


# --- start ------------------------------------------------------------------------------------------------------------


def test_it_announces_itself_tells_the_time_and_asks_for_fixes_when_the_field_begins() -> None:
    state, effects = started()
    assert SetTimer("ask", ORIGIN_NS) in effects
    assert SetTimer("step", ORIGIN_NS + STEP_NS + DEADLINE_NS) in effects
    assert State("waiting") in effects
    turn = next(one for one in effects if isinstance(one, SetTimer) and one.name == "announce")
    assert turn.at < ANNOUNCE_NS
    state, effects = SINK.handle(state, Timer(turn.at, "announce"))
    assert Send(Announce(1, 3, 0, *PLACE), NEIGHBOURHOOD) in effects
    _, effects = SINK.handle(state, Received(at(0), SyncRequest(1, 5), "n03"))
    assert effects == (Send(SyncReply(1, 5, at(0) // 1000, at(0) // 1000), "n03"),)


def test_its_interest_covers_the_whole_field() -> None:
    _, effects = SINK.handle(started()[0], Timer(at(0), "ask"))
    (asked,) = [one.message for one in effects if isinstance(one, Send)]
    assert isinstance(asked, Interest)
    assert (asked.task, asked.sink, asked.lasts_s) == (FIXES, b"base", 9.0)
    assert all(np.hypot(x - asked.x_m, y - asked.y_m) <= asked.radius_m for x, y in PLACES.values())


def test_the_interest_of_each_life_has_its_own_number() -> None:
    numbers = set()
    for now in (at(0), at(3), at(8.2)):
        state, _ = started(now=now)
        _, effects = SINK.handle(state, Timer(now, "ask"))
        numbers |= {one.message.number for one in effects if isinstance(one, Send)}
    assert len(numbers) == 3


# --- fixes ------------------------------------------------------------------------------------------------------------


def test_without_a_fix_it_publishes_nothing() -> None:
    assert published(asking())[1] == []


def test_a_fix_is_predicted_to_each_step() -> None:
    state, effects = told(asking(), fix())
    assert state.phase is Phase.TRACKING
    assert any(isinstance(one, Store) for one in effects)
    state, (first,) = published(state)
    assert (first.step, first.term, first.origin, first.known_step, first.status) == (20, 20, "n00", 20, "tracking")
    assert first.mean == pytest.approx((10.0, 0.0, 13.4, 0.0), abs=1e-5)
    assert first.sensors == ("n00", "n03")
    state, (second,) = published(state)
    assert (second.step, second.known_step, second.status) == (21, 20, "coasting")
    assert second.mean == pytest.approx((16.7, 0.0, 13.4, 0.0), abs=1e-5)
    assert second.covariance[0] > first.covariance[0]


def test_a_fix_is_predicted_for_as_long_as_a_head_does_so() -> None:
    state, _ = published(told(asking(), fix())[0])
    last = 20 + round(7.0 * NS / STEP_NS)
    for done, points in ((last - 1, 1), (last, 0)):
        assert len(published(replace(state, done=done))[1]) == points


def test_the_point_after_an_event_says_when_the_target_was_nearest_to_the_middle_of_its_sensors() -> None:
    """The middle of n00 and n03 is 2.86 m west of the belief's place 10 m east, which is 0.61 s of way."""
    state, _ = told(asking(), fix())
    state, (first,) = published(state)
    middle = (PLACES["n00"][0] + PLACES["n03"][0]) / 2
    assert first.event_ns == pytest.approx(at(10) - (10.0 - middle) / 13.4 * NS, abs=1000)
    assert first.refused == ""
    assert published(state)[1][0].event_ns is None


@pytest.mark.parametrize("reason", [1, 4, 250])
def test_a_refusal_is_passed_on_with_its_reason(reason: int) -> None:
    state, effects = told(asking(), refusal(reason=reason))
    assert not any(isinstance(one, Store) for one in effects)
    state, (point,) = published(state)
    assert (point.tracker, point.status, point.mean) == ("ml", "waiting", ())
    assert point.refused == (REASONS[reason] if reason < len(REASONS) else "no fix")
    assert point.event_ns == at(10) - 1500 * MS  # the mean of its reports
    assert published(state)[1] == []


def test_a_refusal_leaves_the_fix_before_it() -> None:
    state, _ = told(asking(), fix())
    state, _ = published(state)
    state, _ = told(state, refusal(21), now=at(10.9), serial=1)
    _, (point,) = published(state)
    assert (point.status, point.refused, point.term) == ("coasting", REASONS[1], 20)


def test_the_later_of_two_fixes_holds_whoever_made_it() -> None:
    state, _ = told(asking(), fix(20))
    state, _ = told(state, fix(19, mean=(0.0, 0.0, 1.0, 0.0)), head="n03")
    state, points = published(state)
    assert {point.origin for point in points} == {"n00"}
    assert len(points) == 2  # of two events
    state, _ = told(state, fix(21, mean=(0.0, 5.0, 1.0, 0.0)), head="n03", now=at(10.6), serial=1)
    assert published(state)[1][0].origin == "n03"


def test_of_one_head_a_better_fix_of_the_same_step_holds() -> None:
    state, _ = told(asking(), fix(20))
    state, _ = told(state, fix(20, number=1, mean=(11.0, 0.0, 13.4, 0.0)), serial=1)
    assert published(state)[1][-1].mean[0] == pytest.approx(11.0)


def test_the_same_fix_again_is_none() -> None:
    state, _ = told(asking(), fix())
    _, effects = told(state, fix(), serial=1)
    assert "repeated" in [getattr(one, "reason", "") for one in effects]


def test_each_tracker_says_how_its_event_ended() -> None:
    sink = sink_of(PLACES, PLACE, ("ml", "ecpa"))
    message = replace(fix(), reason=2)  # ml has one, ecpa has none
    state, _ = told(asking(sink), message, sink=sink)
    _, points = published(state, sink)
    assert {point.tracker: point.refused for point in points} == {"ml": "", "ecpa": REASONS[2]}


# --- what cannot be, and lives ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "head", "reason"),
    [
        (fix(60), "n00", "from the future"),
        (fix(), "nobody", "unexpected"),
        (CpaReport(20, 1.0, 0, -20.0, 1.0), "n00", "unexpected"),
        (replace(fix(), belief=b"\xc1"), "n00", "unusable fix"),
        (replace(fix(), raw=RAW[:-1]), "n00", "unusable fix"),
        (fix(raw=pack_raw([Raw(77, 1.0, 0.0, 0.0)])), "n00", "unusable fix"),
    ],
)
def test_what_no_head_tells_is_ignored(message: Any, head: str, reason: str) -> None:
    state, effects = told(asking(), message, head)
    assert reason in [getattr(one, "reason", "") for one in effects]
    assert state.fix is None
    assert published(state)[1] == []


def test_the_next_life_goes_on_with_the_fix() -> None:
    _, effects = told(asking(), fix())
    (kept,) = [one.data for one in effects if isinstance(one, Store)]
    again, _ = started(stored=kept, now=at(11.2))
    assert again.phase is Phase.TRACKING
    assert again.done == 21
    _, (point,) = published(again)
    assert (point.step, point.term, point.origin, point.event_ns) == (22, 20, "n00", None)
    assert point.mean == pytest.approx((10.0 + 13.4, 0.0, 13.4, 0.0), abs=1e-5)
    again, _ = SINK.handle(again, Timer(at(11.3), "ask"))
    data = Data(b"base", 22, b"n00", 1, 1, 0, encode(fix()))  # its head sends that to the new life, too
    _, effects = SINK.handle(again, Received(at(11.4), data, "n03"))
    assert "repeated" in [getattr(one, "reason", "") for one in effects]


@pytest.mark.parametrize(
    "stored",
    [
        b"\xc1",
        msgpack.packb([1, 2]),
        msgpack.packb((0, 5, "n00", b"x", b"", [])),
        msgpack.packb((0, 5, "n00", b"", b"", [1])),
        b"\x05",
    ],
)
def test_unusable_bytes_of_an_earlier_life_are_said(stored: bytes) -> None:
    state, effects = started(stored=stored)
    assert state.fix is None
    assert any(isinstance(one, Note) and "cannot be used" in one.text for one in effects)


def test_a_timer_that_it_never_set_is_an_error() -> None:
    with pytest.raises(IllegalEvent):
        SINK.handle(asking(), Timer(at(1), "lead"))
