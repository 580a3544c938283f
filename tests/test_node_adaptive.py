"""A node whose threshold the centre sets by radio."""

from __future__ import annotations

from dataclasses import replace

import pytest

from node.role import Memory, Node, Phase
from tests.puppet import MS, run
from tests.sensing import hearing
from tests.test_timesync import CONFIG, asking, resting
from trackfield.draw import uniform
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, Frame, Told
from trackfield.link.clock import Clock
from trackfield.role import (
    NS,
    CancelTimer,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
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
from trackfield.wire.messages import Doa, SyncReply, Threshold

DUTY = {"listen_from_ns": 300 * MS, "listen_for_ns": 400 * MS}
NODE = Node(step_ns=NS, threshold_db=52.5, centre="fusion", adaptive=DUTY)
BOTH = Node(step_ns=NS, threshold_db=52.5, centre="fusion", adaptive=DUTY, sync=CONFIG)


def at(step: int) -> SetTimer:
    return SetTimer("step", step * NS)


def command(at_ms: int) -> SetTimer:
    return SetTimer("command", at_ms * MS)


def told(step: int, level_db: float, sender: str = "fusion", *, at_ms: int | None = None) -> Received:
    """Half a second ahead of its step, if no other time is given."""
    return Received((step * 1000 - 500 if at_ms is None else at_ms) * MS, Threshold(step, level_db), sender)


def test_it_consumes_thresholds() -> None:
    assert NODE.kinds == {"threshold"}
    assert BOTH.kinds == {"threshold", "sync-reply"}


def story(node: Node, state: Memory, *lines: tuple[Event, tuple[Effect, ...]]) -> Memory:
    """What becomes of it; each event has exactly these effects."""
    for event, expected in lines:
        state, effects = node.handle(state, event)
        assert effects == expected, event
    return state


def test_a_passing_bus() -> None:
    """It listens after each deadline while it hears the bus; a higher threshold silences it, a lower one has it report
    again."""
    heard = hearing(53.0, 10.0)
    story(
        NODE,
        NODE.begin(),
        (Started(0), (State("asleep"), Radio(False), Sample("wake-up"))),
        (Sampled(0, "wake-up", NS), (at(1),)),
        (Sampled(NS, "sound", heard), (State("reporting"), Send(Doa(1, 10.0, 53.0), "fusion"), at(2), command(1300))),
        (Timer(1300 * MS, "command"), (Radio(True), command(1700))),
        (told(2, 54.0), (Radio(False), command(2300))),
        (Sampled(2 * NS, "sound", heard), (State("awake"), at(3), command(2300))),
        (Timer(2300 * MS, "command"), (Radio(True), command(2700))),
        (told(3, 53.0), (Radio(False), command(3300))),
        (
            Sampled(3 * NS, "sound", heard),
            (State("reporting"), Send(Doa(3, 10.0, 53.0), "fusion"), at(4), command(3300)),
        ),
        (Timer(3300 * MS, "command"), (Radio(True), command(3700))),
        (told(4, 53.5), (Radio(False), command(4300))),
        (Sampled(4 * NS, "sound", None), (State("asleep"), CancelTimer("command"), Sample("wake-up"))),
        (Sampled(4 * NS, "wake-up", 9 * NS), (at(9),)),
        (Sampled(9 * NS, "sound", heard), (State("awake"), at(10), command(9300))),  # it slept with the last one
    )


AWAKE = Memory(Phase.AWAKE, 52.5, threshold_step=5, done=((1, 5),))


def test_a_command_that_does_not_come_is_not_waited_for_until_the_next_step() -> None:
    after = story(
        NODE,
        AWAKE,
        (Timer(5300 * MS, "command"), (Radio(True), command(5700))),
        (Timer(5700 * MS, "command"), (Radio(False), command(6300))),
        (Sampled(6 * NS, "sound", hearing(50.0, 0.0)), (at(7), command(6300))),
        (Timer(6300 * MS, "command"), (Radio(True), command(6700))),
    )
    assert (after.threshold_db, after.threshold_step) == (52.5, 5)


def test_one_that_comes_a_step_late_counts_and_the_right_one_is_still_waited_for() -> None:
    after = story(
        NODE,
        replace(AWAKE, threshold_step=4),
        (Timer(5300 * MS, "command"), (Radio(True), command(5700))),
        (told(5, 50.0, at_ms=5310), (command(5700),)),
        (told(4, 49.0, at_ms=5320), (Ignored("outdated"),)),
        (told(6, 51.0, at_ms=5400), (Radio(False), command(6300))),
    )
    assert (after.threshold_db, after.threshold_step) == (51.0, 6)


def test_one_that_it_was_told_ahead_of_time_is_not_waited_for() -> None:
    """Its receiver is on for another reason, and its clock is behind."""
    after = story(NODE, AWAKE, (told(6, 51.0, at_ms=5250), (command(5300),)))
    story(NODE, after, (Timer(5300 * MS, "command"), (command(6300),)))


def test_a_sleeper_that_is_told_a_threshold_does_not_listen_for_another() -> None:
    after = story(NODE, Memory(Phase.ASLEEP, 52.5), (told(6, 51.0), ()))
    assert (after.threshold_db, after.listening) == (51.0, False)


def test_who_falls_asleep_while_it_listens_hears_no_more() -> None:
    """The window of a late deadline goes on after the coming step's instant."""
    late = Node(step_ns=NS, threshold_db=52.5, centre="fusion", adaptive={**DUTY, "listen_from_ns": 900 * MS})
    story(
        late,
        AWAKE,
        (Timer(5900 * MS, "command"), (Radio(True), command(6300))),
        (
            Sampled(6 * NS, "sound", None),
            (State("asleep"), Radio(False), CancelTimer("command"), Sample("wake-up")),
        ),
    )


@pytest.mark.parametrize(
    ("now_ms", "effects"),
    [(5500, (Radio(True), command(5700))), (5800, (command(6300),)), (6100, (command(6300),))],
)
def test_one_that_stood_still_listens_for_what_is_left(now_ms: int, effects: tuple[Effect, ...]) -> None:
    story(NODE, AWAKE, (Timer(now_ms * MS, "command"), effects))


@pytest.mark.parametrize("phase", [Phase.ASLEEP, Phase.AWAKE, Phase.REPORTING])
def test_nobody_else_has_a_timer_for_commands(phase: Phase) -> None:
    with pytest.raises(IllegalEvent):
        Node(step_ns=NS, threshold_db=52.5, centre="fusion").handle(Memory(phase, 52.5), Timer(NS, "command"))


def test_the_time_that_it_listens_at_is_the_centres() -> None:
    """Its clock is 20 ms ahead, and it knows."""
    wrong = replace(AWAKE, time=resting(-20 * MS))
    story(
        BOTH,
        wrong,
        (Timer(5320 * MS, "command"), (Radio(True), command(5720))),
        (Timer(5720 * MS, "command"), (Radio(False), command(6320))),
    )


@pytest.mark.parametrize("phase", [Phase.ASLEEP, Phase.AWAKE, Phase.REPORTING])
@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (told(6, 50.0), "outdated"),
        (told(7, 50.0), "outdated"),  # the same step again
        (told(8, 50.0, "n001"), "foreign"),
        (Received(5, SyncReply(0, 0, 0, 0), "fusion"), "unexpected"),
    ],
)
def test_what_is_of_no_use_is_ignored(phase: Phase, message: Received, reason: str) -> None:
    state = Memory(phase, 51.0, threshold_step=7)
    assert NODE.handle(state, message) == (state, (Ignored(reason),))


def test_the_first_may_be_of_step_0() -> None:
    state, _ = NODE.handle(NODE.begin(), Started(0))
    after, effects = NODE.handle(state, told(0, 50.0))
    assert (after.threshold_db, after.threshold_step, effects) == (50.0, 0, ())


def test_its_radio_stays_on_while_anything_may_come() -> None:
    """For the reply to a request, or for a command, or for both; it falls asleep while it waits for a reply."""
    awake = Memory(Phase.AWAKE, 52.5, done=((1, 4),), time=asking(3, 4250 * MS))
    reply = SyncReply(3, 4_250_000, 4_305_000, 4_305_000)
    again = SetTimer("sync", 6 * NS + int(600 * MS * (1 + 2 * uniform(1, "n007", "sync", 3))))
    asleep = story(
        BOTH,
        awake,
        (Timer(4300 * MS, "command"), (command(4700),)),
        (told(5, 51.0, at_ms=4310), (command(5300),)),
        (Sampled(5 * NS, "sound", None), (State("asleep"), CancelTimer("command"), Sample("wake-up"))),
        (Timer(6 * NS, "sync"), (Radio(False), again, Sample("wake-up"))),
    )
    assert (asleep.phase, asleep.done, asleep.listening) == (Phase.ASLEEP, ((1, 5),), False)

    story(
        BOTH,
        awake,
        (Timer(4300 * MS, "command"), (command(4700),)),
        (Received(4360 * MS, reply, "fusion"), ()),
        (Timer(4450 * MS, "sync"), (Corrected(0), SetTimer("sync", 64_450 * MS), at(5), command(4700))),
        (Timer(4700 * MS, "command"), (Radio(False), command(5300))),
    )


def test_a_correction_moves_when_it_listens() -> None:
    """At 4.2 s by its clock it learns that the time is 4.4 s: the centre is speaking."""
    awake = Memory(Phase.AWAKE, 52.5, done=((1, 4),), time=asking(3, 4 * NS))
    reply = SyncReply(3, 4_000_000, 4_205_000, 4_205_000)
    story(
        BOTH,
        awake,
        (Received(4010 * MS, reply, "fusion"), (Radio(False),)),
        (
            Timer(4200 * MS, "sync"),
            (
                Radio(True),
                Corrected(200 * MS),
                SetTimer("sync", 64_200 * MS),
                SetTimer("step", 4800 * MS),
                command(4500),
            ),
        ),
    )


def switched(clock: Clock, given: Conditions, commands: tuple[tuple[int, int], ...]) -> list[tuple[int, bool]]:
    """When (ms) the receiver of a node that hears the bus from 1 s to 4.5 s goes on or off; commands are (ms, step)."""

    def sense(name: str, t: int) -> object:
        if name == "wake-up":
            return clock.local(NS) if t < NS else None
        return hearing(60.0, 1.0) if t <= 4500 * MS else None

    core = Core(NODE, owner="n001", clock=clock, sense=sense, conditions=given)
    for at_ms, step in commands:
        frame = Frame("fusion", 0, "threshold", at_ms * MS - MS, 0, "n001", "field", encode(Threshold(step, 50.0)))
        core.offer(Arrival(at_ms * MS, frame))
    return [
        (output.key[0] // MS, output.effect.on)
        for output in run(core, 9 * NS)
        if isinstance(output, Told) and isinstance(output.effect, Radio)
    ]


def test_a_life_in_which_one_command_of_three_does_not_come() -> None:
    wrong, right = Clock(offset_ns=-20 * MS), Clock()
    assert switched(right, Conditions(), ((1310, 2), (3450, 4), (4305, 5))) == [
        (0, False), (1300, True), (1310, False), (2300, True), (2700, False),
        (3300, True), (3450, False), (4300, True), (4305, False),
    ]  # fmt: skip
    # Who is 20 ms behind and does not know it misses what comes at once.
    assert switched(wrong, Conditions(), ((1310, 2), (3450, 4), (4305, 5)))[1:3] == [(1320, True), (1720, False)]


def test_a_life_that_stands_still_from_one_window_to_the_next() -> None:
    """It is deaf while it does, whatever its receiver, and goes on where the steps are by then."""
    frozen = Conditions(freezes=((2350 * MS, 3400 * MS),))
    assert switched(Clock(), frozen, ((1310, 2), (2360, 3), (3450, 4), (4305, 5))) == [
        (0, False), (1300, True), (1310, False), (2300, True), (3450, False), (4300, True), (4305, False),
    ]  # fmt: skip
