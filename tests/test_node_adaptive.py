"""A node whose threshold the centre sets by radio."""

from __future__ import annotations

from dataclasses import replace

import pytest

from node.role import Memory, Node, Phase
from node.sync import Timekeeping
from tests.puppet import MS
from tests.test_node_sync import CONFIG
from trackfield.role import (
    NS,
    Corrected,
    Effect,
    Event,
    Ignored,
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
from trackfield.wire.messages import Doa, SyncReply, Threshold
from trackfield.world.acoustic import Heard

NODE = Node(step_ns=NS, threshold_db=52.5, centre="fusion", adaptive=True)
BOTH = Node(step_ns=NS, threshold_db=52.5, centre="fusion", adaptive=True, sync=CONFIG)


def at(step: int) -> SetTimer:
    return SetTimer("step", step * NS)


def told(step: int, level_db: float, sender: str = "fusion") -> Received:
    return Received(step * NS - 5, Threshold(step, level_db), sender)


def test_it_consumes_thresholds() -> None:
    assert NODE.kinds == {"threshold"}
    assert BOTH.kinds == {"threshold", "sync-reply"}


def test_a_passing_bus() -> None:
    """Its radio is on while it hears the bus; a higher threshold silences it, a lower one has it report again."""
    heard = Heard(53.0, 10.0)
    story: list[tuple[Event, tuple[Effect, ...]]] = [
        (Started(0), (State("asleep"), Radio(False), Sample("wake-up"))),
        (Sampled(0, "wake-up", NS), (at(1),)),
        (Sampled(NS, "sound", heard), (State("reporting"), Radio(True), Send(Doa(1, 10.0, 53.0), "fusion"), at(2))),
        (told(2, 54.0), ()),
        (Sampled(2 * NS, "sound", heard), (State("awake"), at(3))),
        (told(3, 53.0), ()),
        (Sampled(3 * NS, "sound", heard), (State("reporting"), Send(Doa(3, 10.0, 53.0), "fusion"), at(4))),
        (told(4, 53.5), ()),
        (Sampled(4 * NS, "sound", None), (State("asleep"), Radio(False), Sample("wake-up"))),
        (Sampled(4 * NS, "wake-up", 9 * NS), (at(9),)),
        (Sampled(9 * NS, "sound", heard), (State("awake"), Radio(True), at(10))),  # it slept with the last one
    ]
    state = NODE.begin()
    for event, expected in story:
        state, effects = NODE.handle(state, event)
        assert effects == expected, event


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
    """A round of exchanges ends while it is awake, and it falls asleep during another."""
    awake = Memory(Phase.AWAKE, 52.5, done=((1, 4),), time=Timekeeping(asked=3, sent_ns=4 * NS, slots=1))
    reply = SyncReply(3, 4_000_000, 4_005_000, 4_005_000)
    state, effects = BOTH.handle(awake, Received(4 * NS + 10 * MS, reply, "fusion"))
    assert effects == ()
    state, effects = BOTH.handle(state, Timer(4200 * MS, "sync"))
    assert effects == (Corrected(0), at(5), SetTimer("sync", 64_200 * MS))

    state, effects = BOTH.handle(awake, Sampled(5 * NS, "sound", None))
    assert effects == (State("asleep"), Sample("wake-up"))
    state, effects = BOTH.handle(state, Timer(6 * NS, "sync"))
    assert effects == (Radio(False), Sample("wake-up"))
    assert state == replace(awake, phase=Phase.ASLEEP, done=((1, 5),), time=state.time)
