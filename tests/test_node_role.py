"""A sensor node's life as plain calls: what happens to it, and what it asks for."""

from __future__ import annotations

from enum import Enum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from node.role import TRANSITIONS, Memory, Node, Phase
from tests.sensing import hearing
from trackfield.role import (
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    PortRead,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
)
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa, SyncReply, SyncRequest, Threshold

NODE = Node(step_ns=NS, threshold_db=52.5, centre="fusion")
LOUD, FAINT = hearing(60.0, 123.45), hearing(50.0, 123.45)
RUNNING = (Phase.ASLEEP, Phase.AWAKE, Phase.REPORTING)


def node_that_is(phase: Phase, *, did: int | None = None) -> Memory:
    """Its last step was ``did``."""
    return Memory(phase, 52.5, done=() if did is None else ((1, did),))


def at(step: float) -> SetTimer:
    return SetTimer("step", round(step * NS))


# --- waking up ----------------------------------------------------------------------------------------------------


def test_a_node_starts_asleep_and_asks_when_there_will_be_something_to_hear() -> None:
    """Nobody sends anything to a node: its receiver goes off for good."""
    assert NODE.begin() == node_that_is(Phase.NEW)
    after, effects = NODE.handle(NODE.begin(), Started(0))
    assert after == node_that_is(Phase.ASLEEP)
    assert effects == (State("asleep"), Radio(False), Sample("wake-up"))


@pytest.mark.parametrize(
    ("now_s", "window_s", "wakes_s"),
    [
        (0, 0, 1),  # within earshot from the start; step 0 is the start itself
        (0, 7, 7),  # exactly at a step
        (0, 6.1, 7),
        (0, 6.999999999, 7),
        (0, 7.000000001, 8),
        (-2.5, -2, 1),  # a clock that lags
        (8.5, 4, 9),  # within a window that began in the past
    ],
)
def test_it_wakes_at_the_first_step_in_which_something_can_be_heard(
    now_s: float, window_s: float, wakes_s: int
) -> None:
    asleep = node_that_is(Phase.ASLEEP)
    answer = Sampled(round(now_s * NS), "wake-up", round(window_s * NS))
    assert NODE.handle(asleep, answer) == (asleep, (at(wakes_s),))


@pytest.mark.parametrize("window_s", [4, 9, 9.5])
def test_a_step_that_it_just_did_is_not_done_again(window_s: float) -> None:
    asleep = node_that_is(Phase.ASLEEP, did=9)
    answer = Sampled(9 * NS, "wake-up", round(window_s * NS))
    assert NODE.handle(asleep, answer) == (asleep, (at(10),))


def test_a_node_that_will_never_hear_anything_sleeps_on() -> None:
    asleep = node_that_is(Phase.ASLEEP)
    assert NODE.handle(asleep, Sampled(0, "wake-up", None)) == (asleep, ())


@pytest.mark.parametrize("phase", RUNNING)
def test_at_each_step_it_listens(phase: Phase) -> None:
    node = node_that_is(phase)
    assert NODE.handle(node, Timer(3 * NS, "step")) == (node, (Sample("sound"),))


@pytest.mark.parametrize(("now_s", "next_s"), [(3.2, 4), (7.000000001, 8), (3, 6), (0, 6), (-2, 6)])
def test_a_step_that_it_missed_or_did_is_passed_over(now_s: float, next_s: float) -> None:
    """A process that stood still is late at its step; one whose clock went back has done it."""
    node = node_that_is(Phase.AWAKE, did=5 if now_s in (3, 0, -2) else 2)
    assert NODE.handle(node, Timer(round(now_s * NS), "step")) == (node, (at(next_s),))


def test_it_counts_as_far_as_a_report_does() -> None:
    last = 65535 * NS
    after, effects = NODE.handle(node_that_is(Phase.REPORTING), Sampled(last, "sound", LOUD))
    assert effects == (Send(Doa(65535, 123.45, 60.0), "fusion"),)
    assert NODE.handle(after, Timer(last + NS, "step")) == (after, ())


# --- what it hears ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("before", RUNNING)
def test_what_is_loud_enough_is_reported_and_it_listens_on(before: Phase) -> None:
    after, effects = NODE.handle(node_that_is(before), Sampled(3 * NS, "sound", LOUD))
    assert after.phase is Phase.REPORTING
    entered = () if before is Phase.REPORTING else (State("reporting"),)
    assert effects == (*entered, Send(Doa(3, 123.45, 60.0), "fusion"), at(4))


@pytest.mark.parametrize("before", RUNNING)
def test_what_is_too_faint_is_not_reported_but_it_listens_on(before: Phase) -> None:
    after, effects = NODE.handle(node_that_is(before), Sampled(3 * NS, "sound", FAINT))
    assert after.phase is Phase.AWAKE
    assert effects == (*(() if before is Phase.AWAKE else (State("awake"),)), at(4))


@pytest.mark.parametrize("before", RUNNING)
def test_when_it_hears_nothing_it_asks_when_to_wake_next(before: Phase) -> None:
    after, effects = NODE.handle(node_that_is(before), Sampled(3 * NS, "sound", None))
    assert after.phase is Phase.ASLEEP
    assert effects == (*(() if before is Phase.ASLEEP else (State("asleep"),)), Sample("wake-up"))


def test_exactly_the_threshold_is_loud_enough() -> None:
    after, _ = NODE.handle(node_that_is(Phase.AWAKE), Sampled(NS, "sound", hearing(52.5, 0.0)))
    assert after.phase is Phase.REPORTING
    after, _ = NODE.handle(node_that_is(Phase.AWAKE), Sampled(NS, "sound", hearing(52.49, 0.0)))
    assert after.phase is Phase.AWAKE


@pytest.mark.parametrize(("step_ns", "now", "step"), [(NS // 4, NS, 4), (3 * NS, 9 * NS, 3), (NS, 65534 * NS, 65534)])
def test_a_report_is_numbered_by_the_step_of_the_local_clock(step_ns: int, now: int, step: int) -> None:
    node = Node(step_ns=step_ns, threshold_db=52.5, centre="fusion")
    _, effects = node.handle(node_that_is(Phase.REPORTING), Sampled(now, "sound", LOUD))
    assert effects == (Send(Doa(step, 123.45, 60.0), "fusion"), SetTimer("step", now + step_ns))


def test_a_passing_bus() -> None:
    """Faint at 2 s, loud at 3 s, faint at 4 s, gone at 5 s, and expected back at 40.2 s."""
    story: list[tuple[Event, tuple[Effect, ...]]] = [
        (Started(0), (State("asleep"), Radio(False), Sample("wake-up"))),
        (Sampled(0, "wake-up", round(1.5 * NS)), (at(2),)),
        (Timer(2 * NS, "step"), (Sample("sound"),)),
        (Sampled(2 * NS, "sound", FAINT), (State("awake"), at(3))),
        (Timer(3 * NS, "step"), (Sample("sound"),)),
        (Sampled(3 * NS, "sound", LOUD), (State("reporting"), Send(Doa(3, 123.45, 60.0), "fusion"), at(4))),
        (Timer(4 * NS, "step"), (Sample("sound"),)),
        (Sampled(4 * NS, "sound", FAINT), (State("awake"), at(5))),
        (Timer(5 * NS, "step"), (Sample("sound"),)),
        (Sampled(5 * NS, "sound", None), (State("asleep"), Sample("wake-up"))),
        (Sampled(5 * NS, "wake-up", round(40.2 * NS)), (at(41),)),
    ]
    state = NODE.begin()
    for event, expected in story:
        state, effects = NODE.handle(state, event)
        assert effects == expected, event


# --- what it has no use for ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", RUNNING)
@pytest.mark.parametrize("message", [Doa(1, 0.0, 50.0), SyncReply(0, 0, 0, 0), Threshold(1, 50.0), SyncRequest(0, 0)])
def test_frames_are_ignored(phase: Phase, message: object) -> None:
    node = node_that_is(phase)
    assert NODE.handle(node, Received(5, message, "fusion")) == (node, (Ignored("unexpected"),))


def test_it_consumes_no_kind_of_message() -> None:
    assert NODE.kinds == frozenset()


@pytest.mark.parametrize(
    ("phase", "event"),
    [
        *((phase, Started(0)) for phase in RUNNING),
        (Phase.NEW, Timer(0, "step")),
        (Phase.NEW, Sampled(0, "sound", LOUD)),
        (Phase.NEW, Sampled(0, "wake-up", 5)),
        (Phase.NEW, Received(0, Doa(1, 0.0, 50.0), "n001")),
        *((phase, Timer(0, name)) for phase in RUNNING for name in ("sync", "nap")),
        (Phase.AWAKE, Sampled(0, "smell", None)),
        *((phase, PortRead(0, "tty", b"")) for phase in Phase),
    ],
)
def test_a_broken_driver_is_told_so(phase: Phase, event: Event) -> None:
    with pytest.raises(IllegalEvent):
        NODE.handle(node_that_is(phase), event)


# --- whatever happens ---------------------------------------------------------------------------------------------

times = st.integers(0, 10**6 * NS)
readings = st.none() | st.builds(
    hearing, st.floats(-50, 200), st.floats(0, 360, exclude_max=True).map(lambda angle: round(angle, 2) % 360)
)
events = st.one_of(
    st.builds(Timer, times, st.just("step")),
    st.builds(Sampled, st.integers(0, 65535 * NS), st.just("sound"), readings),
    st.builds(Sampled, times, st.just("wake-up"), st.none() | times),
    st.builds(Received, times, st.just(Doa(1, 0.0, 50.0)), st.sampled_from(["n001", "fusion"])),
)


@given(st.lists(events, max_size=20))
def test_any_events_in_any_order(happened: list[Event]) -> None:
    """Equal calls have equal answers, steps come at whole steps ahead, once each, and what is sent fits the wire."""
    state, _ = NODE.handle(NODE.begin(), Started(0))
    done: set[int] = set()
    for event in happened:
        after, effects = NODE.handle(state, event)
        assert NODE.handle(state, event) == (after, effects)
        allowed: frozenset[Enum] = TRANSITIONS[state.phase, type(event)]
        assert after.phase in allowed
        entered = [after.phase.value] if after.phase is not state.phase else []
        assert [e.name for e in effects if isinstance(e, State)] == entered
        if isinstance(event, Sampled) and event.sensor == "sound":
            done.add(event.now // NS)
        for effect in effects:
            if isinstance(effect, SetTimer):
                step, since = divmod(effect.at, NS)
                assert effect.at >= event.now
                assert since == 0 < step
                assert step not in done
            if isinstance(effect, Send):
                encode(effect.message)
        state = after
