"""An ear, event by event: when it reports, to whom, what it sends again, and what it does with anything else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from node.ear import KEPT_NS, TRANSITIONS, Ear, Memory, Phase
from tests.ether import ORIGIN_NS
from tests.hearing import ANNOUNCE_NS, ear_of, named, pentagon
from tests.puppet import MS
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    ClockSet,
    Effect,
    Event,
    IllegalEvent,
    Note,
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
from trackfield.sensing.cpa import Passed
from trackfield.wire.clusters import Announce
from trackfield.wire.codec import decode, encode
from trackfield.wire.interests import Arrived, Data, DataAck, Interest
from trackfield.wire.passes import FIXES, PASSES, CpaReport, FixReport

PLACES = named(pentagon())
EAR = ear_of("n01", PLACES)
LOUD = ear_of("n01", PLACES, broadcasts=True)
HEARD = Passed((-1.0, -20.0, 1.0))
FIX = FixReport(0, 20, 1, b"", b"")


def at(seconds: float) -> int:
    return ORIGIN_NS + round(seconds * NS)


def awake(ear: Ear = EAR) -> Memory:
    """An ear of a field that is set up, and whose sensor knows of nothing."""
    state, _ = ear.handle(ear.begin(), Started(ORIGIN_NS))
    return ear.handle(state, Sampled(ORIGIN_NS, "wake-up", None))[0]


def interest(sink: str = "n00", number: int = 4, refresh: int = 0, task: int = PASSES, **changes: Any) -> Interest:
    return replace(Interest(sink.encode(), number, refresh, task, 0.0, 0.0, 45.0, 0.0, 9.0, 0, 4), **changes)


def wanted(state: Memory, now: int, message: Interest, sender: str = "n00", ear: Ear = EAR) -> Memory:
    return ear.handle(state, Received(now, message, sender))[0]


def passed(state: Memory, now: int, ear: Ear = EAR, heard: Any = HEARD) -> tuple[Memory, tuple[Effect, ...]]:
    """Its sensor knows of a pass now."""
    state, effects = ear.handle(state, Timer(now, "pass"))
    assert effects[-1] == Sample("sound")
    return ear.handle(state, Sampled(now, "sound", heard))


def acknowledged(
    state: Memory, now: int, effects: tuple[Effect, ...], sender: str
) -> tuple[Memory, tuple[Effect, ...]]:
    """What it sent has come to a neighbour, so the next message leaves."""
    data = next(one.message for one in effects if isinstance(one, Send) and isinstance(one.message, Data))
    return EAR.handle(state, Received(now, DataAck(data.origin, data.serial), sender))


def sent(effects: tuple[Effect, ...]) -> list[tuple[Any, Any]]:
    """What it sends, with data as the message in it."""
    found = ((one.message, one.to) for one in effects if isinstance(one, Send))
    return [(decode(it.message) if isinstance(it, Data) and it.message else it, to) for it, to in found]


# --- start ------------------------------------------------------------------------------------------------------------


def test_it_listens_always_and_announces_itself_in_its_turn() -> None:
    state, effects = EAR.handle(EAR.begin(), Started(0))
    turn_ns = ANNOUNCE_NS // 3 // 6
    assert effects == (
        State("idle"),
        Radio(True),
        SetTimer("settled", ORIGIN_NS),
        SetTimer("announce", turn_ns),
        Sample("wake-up"),
    )
    for number in (1, 2, 3):
        state, effects = EAR.handle(state, Timer(turn_ns, "announce"))
        x, y = PLACES["n01"]
        assert sent(effects) == [(Announce(number, 3, 0, x, y), NEIGHBOURHOOD)]
        assert len(effects) == (2 if number < 3 else 1)


def test_one_that_starts_later_does_not_announce_itself() -> None:
    _, effects = EAR.handle(EAR.begin(), Started(at(3)))
    assert effects == (State("idle"), Radio(True), Sample("wake-up"))


def test_it_asks_its_sensor_when_that_will_know_of_a_pass() -> None:
    state, _ = EAR.handle(EAR.begin(), Started(ORIGIN_NS))
    state, effects = EAR.handle(state, Sampled(ORIGIN_NS, "wake-up", at(7.1)))
    assert effects == (SetTimer("pass", at(7.1)),)
    _, effects = passed(state, at(7.1), heard=None)
    assert effects == (Sample("wake-up"),)


# --- reports ----------------------------------------------------------------------------------------------------------


def test_without_an_interest_it_reports_nothing() -> None:
    state, effects = passed(awake(), at(7.1))
    assert effects == (Sample("wake-up"),)
    assert state.phase is Phase.IDLE


def test_under_an_interest_it_reports_for_the_step_that_comes_next() -> None:
    state = wanted(awake(), at(1), interest())
    assert state.phase is Phase.WATCHING
    state, effects = passed(state, at(7.1))
    assert sent(effects) == [(CpaReport(15, 1.4, 0, -20.0, 1.0), "n00")]
    assert effects[-1] == Sample("wake-up")
    assert [one.message for one in state.recent] == [CpaReport(15, 1.4, 0, -20.0, 1.0)]


def test_a_pass_at_the_instant_of_a_step_is_of_that_step() -> None:
    _, effects = passed(wanted(awake(), at(1), interest()), at(7.0))
    assert sent(effects) == [(CpaReport(14, 1.0, 0, -20.0, 1.0), "n00")]


def test_passes_are_numbered_cyclically() -> None:
    state = replace(wanted(awake(), at(1), interest()), passes=255)
    state, _ = passed(state, at(5.1))
    state, _ = passed(state, at(6.1))
    assert [one.message.event for one in state.recent] == [255, 0]


def test_it_reports_once_for_a_step() -> None:
    state, _ = passed(wanted(awake(), at(1), interest()), at(7.1))
    assert sent(passed(state, at(7.2))[1]) == []


@pytest.mark.parametrize(
    "asked",
    [interest(x_m=100.0), interest(task=FIXES), interest(radius_m=1.0)],
    ids=["elsewhere", "in fixes", "in a small region"],
)
def test_under_an_interest_in_something_else_it_reports_nothing(asked: Interest) -> None:
    assert sent(passed(wanted(awake(), at(1), asked), at(7.1))[1]) == []


def test_an_interest_expires_after_two_missed_refreshes() -> None:
    state = wanted(awake(), at(1), interest())
    assert sent(passed(state, at(1 + 6.7))[1])
    assert sent(passed(state, at(1 + 6.8))[1]) == []
    renewed = wanted(state, at(4), interest(refresh=1))
    assert sent(passed(renewed, at(4 + 6.7))[1])


def test_each_sink_is_told() -> None:
    state = wanted(wanted(awake(), at(1), interest()), at(1), interest("n02", 6), "n02")
    state, effects = passed(state, at(5.1))
    told, state, effects = [to for _, to in sent(effects)], *acknowledged(state, at(5.1), effects, "n00")
    assert told + [to for _, to in sent(effects)] == ["n00", "n02"]


def test_a_new_head_is_sent_the_last_reports_again() -> None:
    """Of the last 15 s, in their order, and only once."""
    state, _ = passed(awake(), at(2.1))
    state, _ = passed(state, at(12.1))
    state, _ = passed(state, at(14.1))
    now = at(2.1) + KEPT_NS + MS
    state, effects = EAR.handle(state, Received(now, interest("n02", 8), "n02"))
    steps = [message.step for message, _ in sent(effects) if isinstance(message, CpaReport)]
    state, effects = acknowledged(state, now, effects, "n02")
    steps += [message.step for message, _ in sent(effects) if isinstance(message, CpaReport)]
    assert steps == [25, 29]
    state, effects = EAR.handle(state, Received(now + NS, interest("n02", 8, refresh=1), "n02"))
    assert not [one for one, _ in sent(effects) if isinstance(one, CpaReport)]


# --- the loudest ------------------------------------------------------------------------------------------------------


def test_in_a_field_that_wants_fixes_its_neighbours_hear_its_reports() -> None:
    state = wanted(awake(LOUD), at(1), interest("base", task=FIXES), "base", LOUD)
    assert state.phase is Phase.WATCHING
    _, effects = passed(state, at(7.1), LOUD)
    report = CpaReport(15, 1.4, 0, -20.0, 1.0)
    assert sent(effects) == [(report, NEIGHBOURHOOD), (report, "n01")]


def test_in_one_that_wants_none_nobody_does() -> None:
    assert sent(passed(awake(LOUD), at(7.1), LOUD)[1]) == []


# --- the other half ---------------------------------------------------------------------------------------------------


def test_it_spreads_the_interests_of_its_other_half_and_gives_it_its_own_reports() -> None:
    state, effects = EAR.handle(awake(), Received(at(1), interest("n01"), "n01"))
    ((spread, to),) = sent(effects)
    assert to == NEIGHBOURHOOD
    assert replace(spread, refresh=0) == interest("n01")
    state, effects = passed(state, at(7.1))
    assert sent(effects) == [(CpaReport(15, 1.4, 0, -20.0, 1.0), "n01")]
    state, _ = EAR.handle(state, Received(at(8), interest("n01", lasts_s=0.0), "n01"))
    assert sent(passed(state, at(9.1))[1]) == []


def test_it_hands_over_what_arrives_and_interests_that_are_new() -> None:
    state, effects = EAR.handle(awake(), Received(at(1), interest(), "n00"))
    ((handed, to),) = sent(effects)
    assert (to, handed.origin, decode(handed.message)) == ("n01", b"n00", interest())
    _, effects = EAR.handle(state, Received(at(1), interest(), "n00"))
    assert sent(effects) == []
    state, _ = EAR.handle(state, Received(at(2), interest("n01"), "n01"))
    report = CpaReport(15, 1.4, 0, -20.0, 1.0)
    data = Data(b"n01", 4, b"n02", 7, 1, 0, encode(report))
    _, effects = EAR.handle(state, Received(at(3), data, "n02"))
    assert (Arrived(b"n02", encode(report)), "n01") in [
        (one.message, one.to) for one in effects if isinstance(one, Send)
    ]


def test_fixes_of_its_other_half_go_to_all_others_that_want_them() -> None:
    state = wanted(awake(), at(1), interest("base", task=FIXES, radius_m=1000.0), "base")
    state, _ = EAR.handle(state, Received(at(1), interest("n01", 5, task=FIXES, radius_m=1000.0), "n01"))
    _, effects = EAR.handle(state, Received(at(2), FIX, "n01"))
    assert sent(effects) == [(FIX, "base")]


def test_a_sink_that_asks_later_is_sent_the_last_fix() -> None:
    state, effects = EAR.handle(awake(), Received(at(2), FIX, "n01"))
    assert sent(effects) == []
    asked = interest("base", task=FIXES, radius_m=1000.0)
    state, effects = EAR.handle(state, Received(at(4), asked, "base"))
    assert (FIX, "base") in sent(effects)
    _, effects = EAR.handle(awake(), Received(at(4), asked, "base"))
    assert (FIX, "base") not in sent(effects)


def test_a_fix_that_a_neighbour_tells_of_is_not_handed_on() -> None:
    state = wanted(awake(), at(1), interest("base", task=FIXES, radius_m=1000.0), "base")
    assert EAR.handle(state, Received(at(2), FIX, "n00"))[1] == ()


# --- clocks, and what cannot be ---------------------------------------------------------------------------------------

SYNC = {"reference": "base", "exchanges": 1, "resync_ns": 20 * NS, "timeout_ns": 200 * MS, "seed": 1, "id": "n01"}


def test_reports_are_by_its_corrected_time() -> None:
    ear = ear_of("n01", PLACES, sync=SYNC)
    state = wanted(awake(ear), at(1), interest(), ear=ear)
    ahead = replace(state, kept=replace(state.kept, time=replace(state.time, correction_ns=-250 * MS)))
    ((report, _),) = sent(passed(ahead, at(7.35), ear)[1])
    assert report == CpaReport(15, 1.4, 0, -20.0, 1.0)


def test_unusable_bytes_of_an_earlier_life_are_said() -> None:
    _, effects = EAR.handle(EAR.begin(), Started(at(3), b"\xc1"))
    assert any(isinstance(one, Note) and "cannot be used" in one.text for one in effects)


@pytest.mark.parametrize("event", [Timer(at(1), "deadline"), ClockSet(at(1), 0), Timer(at(1), "hearing/lead")])
def test_what_only_a_broken_driver_can_cause(event: Event) -> None:
    with pytest.raises(IllegalEvent):
        EAR.handle(awake(), event)


def test_its_table_of_phases_allows_what_it_does() -> None:
    assert {phase for phase, _ in TRANSITIONS} == set(Phase)
    with pytest.raises(IllegalEvent):
        check_transition(TRANSITIONS, Phase.IDLE, Started(0), Phase.IDLE)


def test_announcements_are_remembered_until_the_field_is_set_up() -> None:
    """All nodes announce themselves before; whatever comes later, of names that nobody has, is not kept."""
    state, _ = EAR.handle(EAR.begin(), Started(0))
    for number, now in enumerate((NS, 2 * NS)):
        state, _ = EAR.handle(state, Received(now, Announce(1, 3, 0, 0.0, 0.0), f"n{number:02}"))
    assert set(state.kept.near) == {"n00", "n01"}
    state, _ = EAR.handle(state, Timer(ORIGIN_NS, "settled"))
    for number in range(100):
        state, effects = EAR.handle(state, Received(at(1), Announce(1, 3, 0, 0.0, 0.0), f"x{number}"))
        assert effects == ()
    assert set(state.kept.near) == {"n00", "n01"}
