"""A member, event by event: its windows, polls, slots, what it senses unasked, and what it does with anything else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from node.member import HOLD, LAST_STEP, TRANSITIONS, Member, Memory, Phase
from tests.ether import ORIGIN_NS
from tests.peered import SLOT_NS, WAKEUP, member_of
from tests.puppet import MS
from trackfield.role import (
    NS,
    ClockSet,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Listen,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
    check_transition,
)
from trackfield.sensing.readings import Said
from trackfield.wire.clusters import CYCLE, NoTarget
from trackfield.wire.listed import packed
from trackfield.wire.messages import Range
from trackfield.wire.peers import Claim, Poll

MEMBER = member_of(3, (30.0, 30.0))
HEARD = Said(Range, (12.5,))
WINDOWS = Listen(WAKEUP["every_ns"], WAKEUP["open_ns"], WAKEUP["from_ns"])


def at(step: float) -> int:
    return ORIGIN_NS + round(step * NS)


def asleep(member: Member = MEMBER) -> Memory:
    """A member of a field that is set up, which senses nothing and never will."""
    state, _ = member.handle(member.begin(), Started(0))
    state, _ = member.handle(state, Sampled(0, "wake-up", None))
    return member.handle(state, Timer(ORIGIN_NS, "settled"))[0]


def polled(
    step: int,
    *sensors: int,
    state: Memory | None = None,
    number: int = 1,
    head: str = "n00",
    now: int | None = None,
    member: Member = MEMBER,
) -> tuple[Memory, tuple[Effect, ...]]:
    """It hears a poll in the window before the step, of itself if of nobody else."""
    poll = Poll(number, step, packed(sensors or (3,)))
    now = at(step - 0.01) if now is None else now
    return member.handle(asleep(member) if state is None else state, Received(now, poll, head))


def measured(
    state: Memory, step: int, heard: Any = HEARD, member: Member = MEMBER
) -> tuple[Memory, tuple[Effect, ...]]:
    """It measures at the instant of the step."""
    state, effects = member.handle(state, Timer(at(step), "step"))
    assert effects[-1] == Sample("sound")
    return member.handle(state, Sampled(at(step), "sound", heard))


def sent(effects: tuple[Effect, ...]) -> list[tuple[Any, Any]]:
    return [(one.message, one.to) for one in effects if isinstance(one, Send)]


def ignored(effects: tuple[Effect, ...]) -> list[str]:
    return [one.reason for one in effects if isinstance(one, Ignored)]


# --- start and windows ------------------------------------------------------------------------------------------------


def test_it_listens_until_the_field_is_set_up_and_then_in_windows() -> None:
    state, effects = MEMBER.handle(MEMBER.begin(), Started(0))
    assert effects == (State("asleep"), Radio(True), SetTimer("settled", ORIGIN_NS), Sample("wake-up"))
    state, effects = MEMBER.handle(state, Sampled(0, "wake-up", None))
    assert effects == ()
    state, effects = MEMBER.handle(state, Timer(ORIGIN_NS, "settled"))
    assert effects == (WINDOWS,)


def test_one_that_starts_later_listens_in_windows_at_once() -> None:
    _, effects = MEMBER.handle(MEMBER.begin(), Started(at(3)))
    assert effects == (State("asleep"), WINDOWS, Sample("wake-up"))


def test_without_windows_it_is_always_on() -> None:
    member = member_of(3, (30.0, 30.0), always_on=True)
    state, effects = member.handle(member.begin(), Started(0))
    assert Radio(True) in effects
    assert member.handle(state, Timer(ORIGIN_NS, "settled"))[1] == ()


# --- polls ------------------------------------------------------------------------------------------------------------


def test_a_poll_wakes_it_and_it_reports_to_the_head_and_tells_its_own_header() -> None:
    state, effects = polled(5)
    assert effects == (State("active"), SetTimer("step", at(5)))
    state, effects = measured(state, 5)
    assert sent(effects) == [(Range(5, 12.5), "n03"), (Range(5, 12.5), "n00")]
    assert SetTimer("step", at(6)) in effects  # it senses the target, so it measures on
    assert state.phase is Phase.SENSING


@pytest.mark.parametrize(("sensors", "slot"), [((3, 1), 0), ((1, 3), 1), ((4, 0, 300, 3), 3)])
def test_it_reports_in_its_slot(sensors: tuple[int, ...], slot: int) -> None:
    state, effects = measured(polled(5, *sensors)[0], 5)
    if slot:
        assert sent(effects) == [(Range(5, 12.5), "n03")]
        assert SetTimer("report", at(5) + slot * SLOT_NS) in effects
        assert state.phase is Phase.ACTIVE
        state, effects = MEMBER.handle(state, Timer(at(5) + slot * SLOT_NS, "report"))
        assert sent(effects) == [(Range(5, 12.5), "n00")]
        assert state.phase is Phase.SENSING
    else:
        assert (Range(5, 12.5), "n00") in sent(effects)


def test_what_its_own_header_polls_is_not_sent_twice() -> None:
    _, effects = measured(polled(5, head="n03")[0], 5)
    assert sent(effects) == [(Range(5, 12.5), "n03")]


@pytest.mark.parametrize(("step", "says"), [(5, 5), (CYCLE, 0), (300, 300 % CYCLE)])
def test_it_says_that_it_senses_no_target(step: int, says: int) -> None:
    state, effects = measured(polled(step)[0], step, None)
    assert sent(effects) == [(NoTarget(says), "n00")]
    assert effects[-1] == Sample("wake-up")
    assert state.phase is Phase.ASLEEP


@pytest.mark.parametrize(("level", "loud"), [(49.9, False), (50.0, True)])
def test_what_is_below_its_threshold_is_no_target(level: float, loud: bool) -> None:
    member = member_of(3, (30.0, 30.0), threshold_db=50.0)
    _, effects = measured(polled(5, member=member)[0], 5, Said(Range, (12.5,), level), member)
    expected: list[tuple[Any, str]] = [(Range(5, 12.5), "n03"), (Range(5, 12.5), "n00")] if loud else []
    assert sent(effects) == (expected or [(NoTarget(5), "n00")])


def test_a_poll_that_comes_twice_is_one() -> None:
    state, _ = polled(5)
    again, effects = polled(5, state=state)
    assert again == state
    assert effects == (SetTimer("step", at(5)),)
    state, _ = measured(state, 5)
    assert ignored(polled(5, state=state, now=at(5) + 30 * MS)[1]) == ["late"]


@pytest.mark.parametrize(
    ("number", "head", "holds"), [(1, "n01", "n01"), (2, "n00", "n00"), (3, "n01", "n01"), (1, "m99", "n00")]
)
def test_of_two_heads_that_poll_it_the_one_of_the_higher_term_counts(number: int, head: str, holds: str) -> None:
    state, _ = polled(5, number=1, head="n00")
    state, effects = polled(5, state=state, number=number, head=head)
    assert ignored(effects) == ([] if holds == head else ["outdated"])
    assert (Range(5, 12.5), holds) in sent(measured(state, 5)[1])


@pytest.mark.parametrize("first", [4, 5])
def test_a_lower_term_counts_once_the_higher_one_asks_no_more(first: int) -> None:
    """The head of the higher term may be out of reach by then."""
    state, _ = measured(polled(first, number=9, head="n07")[0], first)
    state, effects = polled(first + HOLD + 2, state=replace(state, done=first + HOLD + 1), number=2)
    assert ignored(effects) == []
    assert (Range(first + HOLD + 2, 12.5), "n00") in sent(measured(state, first + HOLD + 2)[1])


@pytest.mark.parametrize(
    ("step", "into", "reason"), [(5, 5.0001, "late"), (4, 5.5, "late"), (8, 5.97, "from the future"), (7, 5.97, "")]
)
def test_polls_at_a_wrong_time(step: int, into: float, reason: str) -> None:
    state, effects = polled(step, now=at(into))
    assert ignored(effects) == [reason] * bool(reason)
    assert state.phase is (Phase.ASLEEP if reason else Phase.ACTIVE)


def test_a_poll_of_others_lets_it_sleep() -> None:
    state, _ = polled(6)
    state, effects = polled(6, 1, 2, state=state, number=2)
    assert effects == (State("asleep"),)
    _, effects = measured(replace(state, senses=True), 6)
    assert sent(effects) == [(Range(6, 12.5), "n03")]


@pytest.mark.parametrize("sensors", [b"", b"\x03", b"\x03\x00\x03\x00", b"\x00\x03\x00"])
def test_odd_lists_of_sensors(sensors: bytes) -> None:
    """Of one that is there twice the first slot counts; half a number is none."""
    state, _ = MEMBER.handle(asleep(), Received(at(4.99), Poll(1, 5, sensors), "n00"))
    assert state.asked.step == (5 if sensors == b"\x03\x00\x03\x00" else -1)
    assert state.asked.slot == 0


# --- a poll holds -----------------------------------------------------------------------------------------------------


def test_without_another_poll_it_goes_on_for_some_steps_while_it_senses_the_target() -> None:
    state, _ = measured(polled(5, 1, 3)[0], 5)
    state, _ = MEMBER.handle(state, Timer(at(5) + SLOT_NS, "report"))
    told = []
    for step in range(6, 6 + HOLD + 2):
        state, effects = measured(state, step)
        assert sent(effects) == [(Range(step, 12.5), "n03")]
        if SetTimer("report", at(step) + SLOT_NS) in effects:
            state, effects = MEMBER.handle(state, Timer(at(step) + SLOT_NS, "report"))
            told += sent(effects)
    assert told == [(Range(step, 12.5), "n00") for step in range(6, 6 + HOLD)]


def test_one_that_senses_nothing_does_not_go_on() -> None:
    state, effects = measured(polled(5)[0], 5, None)
    assert not [one for one in effects if isinstance(one, SetTimer)]
    state, effects = MEMBER.handle(state, Sampled(at(5), "wake-up", at(5.2)))
    assert effects == (SetTimer("step", at(6)),)
    _, effects = measured(state, 6, None)
    assert sent(effects) == []


# --- unasked ----------------------------------------------------------------------------------------------------------


def test_what_it_senses_unasked_it_tells_its_own_header_alone() -> None:
    state, effects = MEMBER.handle(asleep(), Sampled(at(2.5), "wake-up", at(4.2)))
    assert effects == (SetTimer("step", at(5)),)
    for step in (5, 6, 7):
        state, effects = measured(state, step)
        assert sent(effects) == [(Range(step, 12.5), "n03")]
        assert SetTimer("step", at(step + 1)) in effects
    state, effects = measured(state, 8, None)
    assert effects == (State("asleep"), Sample("wake-up"))


@pytest.mark.parametrize("wakes", [-5 * NS, 0, ORIGIN_NS])
def test_a_target_that_is_there_before_step_0_is_measured_at_step_1(wakes: int) -> None:
    _, effects = MEMBER.handle(MEMBER.handle(MEMBER.begin(), Started(0))[0], Sampled(0, "wake-up", wakes))
    assert effects == (SetTimer("step", at(1)),)


def test_no_step_follows_the_last_one() -> None:
    state, _ = MEMBER.handle(asleep(), Sampled(at(2.5), "wake-up", at(LAST_STEP + 0.5)))
    assert MEMBER.handle(state, Sampled(at(2.5), "wake-up", at(LAST_STEP + 0.5)))[1] == ()
    state = replace(state, done=LAST_STEP - 1, senses=True)
    _, effects = measured(state, LAST_STEP)
    assert not [one for one in effects if isinstance(one, SetTimer)]


# --- steps that are missed --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late_ns", [1, 400 * MS, 3 * NS])
def test_a_step_that_it_missed_is_not_measured_later(late_ns: int) -> None:
    """A process that was stopped gets its timer late."""
    state, _ = polled(5)
    state, effects = MEMBER.handle(state, Timer(at(5) + late_ns, "step"))
    if late_ns % NS:
        assert effects == (State("asleep"),)
        assert state.done == 5
    else:
        assert effects[-1] == Sample("sound")  # it is the instant of another one
        assert sent(MEMBER.handle(state, Sampled(at(8), "sound", None))[1]) == []


def test_a_step_is_not_measured_twice() -> None:
    """Its clock was set back."""
    state, _ = measured(polled(5)[0], 5)
    _, effects = MEMBER.handle(state, Timer(at(5), "step"))
    assert effects == (SetTimer("step", at(6)),)


def test_a_new_poll_while_a_report_waits_for_its_slot() -> None:
    """Fifty sensors have slots beyond the next step: what is due is what it read last."""
    many = tuple(range(10, 59))
    state, _ = measured(polled(5, *many, 3)[0], 5)
    state, _ = polled(6, state=state, now=at(5.97))
    state, effects = measured(state, 6)
    assert (Range(6, 12.5), "n00") in sent(effects)
    state, effects = MEMBER.handle(state, Timer(at(5) + 49 * SLOT_NS, "report"))
    assert sent(effects) == [(Range(5, 12.5), "n00")]


# --- anything else ----------------------------------------------------------------------------------------------------


def test_other_messages_are_ignored() -> None:
    for message in (Claim(1, 2, 3), Range(5, 1.0)):
        state, effects = MEMBER.handle(asleep(), Received(at(5), message, "n00"))
        assert effects == (Ignored("unexpected"),)
        assert state == asleep()


@pytest.mark.parametrize(
    "event", [Timer(at(5), "report"), Timer(at(5), "window"), ClockSet(at(5), 1), Started(at(5))], ids=repr
)
def test_what_only_a_broken_driver_can_cause(event: Event) -> None:
    with pytest.raises(IllegalEvent):
        MEMBER.handle(asleep(), event)


def test_its_phases_follow_each_other_as_the_table_says() -> None:
    for before in (Phase.ASLEEP, Phase.SENSING, Phase.ACTIVE):
        for event in (Timer(0, "step"), Received(0, Poll(1, 1, b""), "n00"), Sampled(0, "sound", None)):
            check_transition(TRANSITIONS, before, event, Phase.ACTIVE)
            with pytest.raises(IllegalEvent):
                check_transition(TRANSITIONS, before, event, Phase.NEW)
    with pytest.raises(IllegalEvent):
        check_transition(TRANSITIONS, Phase.NEW, Timer(0, "step"), Phase.ASLEEP)
