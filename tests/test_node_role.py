"""A sensor node's life as plain calls: what happens to it, and what it asks for."""

from __future__ import annotations

from enum import Enum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from node.role import TRANSITIONS, Node, Phase
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
from trackfield.wire.messages import Doa
from trackfield.world.acoustic import Heard

NODE = Node(step_ns=NS, threshold_db=52.5, centre="fusion")
LOUD, FAINT = Heard(60.0, 123.45), Heard(50.0, 123.45)
RUNNING = (Phase.ASLEEP, Phase.AWAKE, Phase.REPORTING)


def at(step: float) -> SetTimer:
    return SetTimer("step", round(step * NS))


# --- waking up ----------------------------------------------------------------------------------------------------


def test_a_node_starts_asleep_and_asks_when_there_will_be_something_to_hear() -> None:
    """Nobody sends anything to a node: its receiver goes off for good."""
    assert NODE.begin() is Phase.NEW
    after, effects = NODE.handle(Phase.NEW, Started(0))
    assert after is Phase.ASLEEP
    assert effects == (State("asleep"), Radio(False), Sample("wake-up"))


@pytest.mark.parametrize(
    ("now_s", "window_s", "wakes_s"),
    [
        (0, 0, 1),  # within earshot from the start; step 0 is the start itself
        (0, 7, 7),  # exactly at a step
        (0, 6.1, 7),
        (0, 6.999999999, 7),
        (0, 7.000000001, 8),
        (9, 4, 10),  # within a window that began in the past: not this step again, but the next
        (9, 9, 10),
        (9, 9.5, 10),
        (-2.5, -2, 1),  # a clock that lags
    ],
)
def test_it_wakes_at_the_first_step_in_which_something_can_be_heard(
    now_s: float, window_s: float, wakes_s: int
) -> None:
    answer = Sampled(round(now_s * NS), "wake-up", round(window_s * NS))
    assert NODE.handle(Phase.ASLEEP, answer) == (Phase.ASLEEP, (at(wakes_s),))


def test_a_node_that_will_never_hear_anything_sleeps_on() -> None:
    assert NODE.handle(Phase.ASLEEP, Sampled(0, "wake-up", None)) == (Phase.ASLEEP, ())


@pytest.mark.parametrize("phase", RUNNING)
def test_at_each_step_it_listens(phase: Phase) -> None:
    assert NODE.handle(phase, Timer(3 * NS, "step")) == (phase, (Sample("sound"),))


# --- what it hears ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("before", RUNNING)
def test_what_is_loud_enough_is_reported_and_it_listens_on(before: Phase) -> None:
    after, effects = NODE.handle(before, Sampled(3 * NS, "sound", LOUD))
    assert after is Phase.REPORTING
    entered = () if before is Phase.REPORTING else (State("reporting"),)
    assert effects == (*entered, Send(Doa(3, 123.45, 60.0), "fusion"), at(4))


@pytest.mark.parametrize("before", RUNNING)
def test_what_is_too_faint_is_not_reported_but_it_listens_on(before: Phase) -> None:
    after, effects = NODE.handle(before, Sampled(3 * NS, "sound", FAINT))
    assert after is Phase.AWAKE
    assert effects == (*(() if before is Phase.AWAKE else (State("awake"),)), at(4))


@pytest.mark.parametrize("before", RUNNING)
def test_when_it_hears_nothing_it_asks_when_to_wake_next(before: Phase) -> None:
    after, effects = NODE.handle(before, Sampled(3 * NS, "sound", None))
    assert after is Phase.ASLEEP
    assert effects == (*(() if before is Phase.ASLEEP else (State("asleep"),)), Sample("wake-up"))


def test_exactly_the_threshold_is_loud_enough() -> None:
    after, _ = NODE.handle(Phase.AWAKE, Sampled(NS, "sound", Heard(52.5, 0.0)))
    assert after is Phase.REPORTING
    after, _ = NODE.handle(Phase.AWAKE, Sampled(NS, "sound", Heard(52.49, 0.0)))
    assert after is Phase.AWAKE


@pytest.mark.parametrize(("step_ns", "now", "step"), [(NS // 4, NS, 4), (3 * NS, 9 * NS, 3), (NS, 65535 * NS, 65535)])
def test_a_report_is_numbered_by_the_step_of_the_local_clock(step_ns: int, now: int, step: int) -> None:
    node = Node(step_ns=step_ns, threshold_db=52.5, centre="fusion")
    _, effects = node.handle(Phase.REPORTING, Sampled(now, "sound", LOUD))
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
    phase = NODE.begin()
    for event, expected in story:
        phase, effects = NODE.handle(phase, event)
        assert effects == expected, event


# --- what it has no use for ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", RUNNING)
def test_frames_are_ignored(phase: Phase) -> None:
    assert NODE.handle(phase, Received(5, Doa(1, 0.0, 50.0), "n001")) == (phase, (Ignored("unexpected"),))


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
        *((phase, PortRead(0, "tty", b"")) for phase in Phase),
    ],
)
def test_a_broken_driver_is_told_so(phase: Phase, event: Event) -> None:
    with pytest.raises(IllegalEvent):
        NODE.handle(phase, event)


# --- whatever happens ---------------------------------------------------------------------------------------------

times = st.integers(0, 10**6 * NS)
readings = st.none() | st.builds(
    Heard, st.floats(-50, 200), st.floats(0, 360, exclude_max=True).map(lambda angle: round(angle, 2) % 360)
)
events = st.one_of(
    st.builds(Timer, times, st.just("step")),
    st.builds(Sampled, st.integers(0, 65535 * NS), st.just("sound"), readings),
    st.builds(Sampled, times, st.just("wake-up"), st.none() | times),
    st.builds(Received, times, st.just(Doa(1, 0.0, 50.0)), st.sampled_from(["n001", "fusion"])),
)


@given(st.lists(events, max_size=20))
def test_any_events_in_any_order(happened: list[Event]) -> None:
    """Equal calls have equal answers, steps come at whole steps ahead, and what is sent fits the wire."""
    phase, _ = NODE.handle(NODE.begin(), Started(0))
    for event in happened:
        after, effects = NODE.handle(phase, event)
        assert NODE.handle(phase, event) == (after, effects)
        allowed: frozenset[Enum] = TRANSITIONS[phase, type(event)]
        assert after in allowed
        assert [e.name for e in effects if isinstance(e, State)] == ([after.value] if after is not phase else [])
        for effect in effects:
            if isinstance(effect, SetTimer):
                assert effect.at > event.now
                assert effect.at % NS == 0
            if isinstance(effect, Send):
                encode(effect.message)
        phase = after
