"""A slave, event by event: its windows, beacons, slots, sleep, clock, and what it does with anything else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from node.slave import Memory, Phase
from tests.clustered import ANNOUNCE_NS, EAST, JOINING, SLOT_NS, TURN_NS, WAKEUP, eastward, field_of, slave_of
from tests.ether import DELAY_NS, ORIGIN_NS
from tests.puppet import MS
from trackfield.protocols.association.joining import NO_PLACE, Search
from trackfield.role import (
    NS,
    CancelTimer,
    Corrected,
    Effect,
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
)
from trackfield.sensing.readings import Said
from trackfield.wire.clusters import Admit, Announce, Join, NoTarget, Solicit, Wake
from trackfield.wire.messages import Range, SyncReply, SyncRequest

SLAVE = slave_of(3, (0.0, 0.0))
HEARD = Said(Range, (12.5,))
WINDOWS = Listen(WAKEUP["every_ns"], WAKEUP["open_ns"], WAKEUP["from_ns"])
SYNC = {"reference": "m0", "exchanges": 1, "resync_ns": 60 * NS, "timeout_ns": 100 * MS, "seed": 1, "id": "s03"}
MEMBER = Memory(Phase.ASLEEP, Search(master="m0", place=2))


US = 1000


def at(step: float) -> int:
    return ORIGIN_NS + round(step * NS)


def within_us(times: list[int], steps: range) -> bool:
    """Whether these are the instants of these steps; messages that set clocks have microseconds."""
    return len(times) == len(steps) and all(abs(t - at(step)) <= US for t, step in zip(times, steps, strict=True))


def woken(step: int, steps: int = 10, *, slot: int = 0, places: bytes = b"\x02", now: int | None = None) -> Any:
    """A member that heard a beacon in the window before the step, and what it does with it."""
    now = at(step - 0.01) if now is None else now
    return SLAVE.handle(MEMBER, Received(now, Wake(1, b"m0", step, steps, slot, places), "m0"))


# --- from the start to a place ---------------------------------------------------------------------------------------


def test_from_the_start_to_its_place() -> None:
    turn = ANNOUNCE_NS + 3 * TURN_NS
    story: list[tuple[Any, tuple[Effect, ...]]] = [
        (Started(0), (State("seeking"), Radio(True), SetTimer("turn", turn))),
        (Received(NS, Announce(1, 1, 5, 10.0, 0.0), "m0"), ()),
        (Timer(turn, "turn"), (Send(Join(3), "m0"), SetTimer("answer", turn + JOINING["patience_ns"]))),
        (Received(turn + 40 * MS, Admit(9, 0, 4), "m0"), ()),  # another one's
    ]
    state = SLAVE.begin()
    for event, expected in story:
        state, effects = SLAVE.handle(state, event)
        assert effects == expected, event
    state, effects = SLAVE.handle(state, Received(turn + 45 * MS, Admit(3, 2, 3), "m0"))
    assert effects[:3] == (State("asleep"), WINDOWS, CancelTimer("answer"))
    assert isinstance(effects[3], SetTimer)
    assert 0.9 * JOINING["renew_ns"] <= effects[3].at - turn <= 1.1 * JOINING["renew_ns"] + NS
    assert (state.search.master, state.search.place) == ("m0", 2)


def test_one_that_starts_late_asks_who_is_there() -> None:
    state, effects = SLAVE.handle(SLAVE.begin(), Started(100 * NS))
    assert Send(Solicit(1), "*") in effects
    assert state.phase is Phase.SEEKING
    _, effects = SLAVE.handle(state, Timer(100 * NS + JOINING["answers_ns"], "turn"))
    assert effects[:2] == (State("orphan"), Radio(False))


# --- beacons and slots -----------------------------------------------------------------------------------------------


def test_a_beacon_with_its_place_wakes_it() -> None:
    state, effects = woken(5)
    assert effects == (State("active"), SetTimer("renew", at(4.99) + JOINING["renew_ns"]), SetTimer("step", at(5)))
    state, effects = SLAVE.handle(state, Timer(at(5), "step"))
    assert effects == (Sample("sound"),)
    state, effects = SLAVE.handle(state, Sampled(at(5), "sound", HEARD))
    assert effects == (Send(Range(5, 12.5), "m0"), SetTimer("step", at(6)))


@pytest.mark.parametrize(
    ("places", "first", "slot"), [(b"\x02\x01", 0, 0), (b"\x01\x02", 0, 1), (b"\x04\x00\x02", 3, 5)]
)
def test_it_reports_in_its_slot(places: bytes, first: int, slot: int) -> None:
    state, _ = woken(5, slot=first, places=places)
    state, _ = SLAVE.handle(state, Timer(at(5), "step"))
    state, effects = SLAVE.handle(state, Sampled(at(5), "sound", HEARD))
    if slot:
        assert effects[0] == SetTimer("report", at(5) + slot * SLOT_NS)
        _, effects = SLAVE.handle(state, Timer(at(5) + slot * SLOT_NS, "report"))
    assert effects[0] == Send(Range(5, 12.5), "m0")


@pytest.mark.parametrize(("step", "says"), [(5, 5), (128, 0), (300, 44)])
def test_it_says_that_it_senses_no_target(step: int, says: int) -> None:
    state, _ = woken(step)
    state, _ = SLAVE.handle(state, Timer(at(step), "step"))
    assert SLAVE.handle(state, Sampled(at(step), "sound", None))[1][0] == Send(NoTarget(says), "m0")


def test_what_is_below_its_threshold_is_no_target() -> None:
    slave = slave_of(3, (0.0, 0.0), threshold_db=50.0)
    for level, expected in ((49.9, NoTarget(5)), (50.0, Range(5, 12.5))):
        state, _ = slave.handle(MEMBER, Received(at(4.99), Wake(1, b"m0", 5, 1, 0, b"\x02"), "m0"))
        state, _ = slave.handle(state, Timer(at(5), "step"))
        _, effects = slave.handle(state, Sampled(at(5), "sound", Said(Range, (12.5,), level)))
        assert Send(expected, "m0") in effects


@pytest.mark.parametrize(
    "wake", [Wake(1, b"m0", 7, 10, 0, b"\x01\x00"), Wake(1, b"m0", 7, 0, 0, b"\x02"), Wake(0, b"", 7, 0, 0, b"")]
)
def test_a_beacon_that_leaves_it_out_lets_it_sleep(wake: Wake) -> None:
    state, _ = woken(5)
    state, effects = SLAVE.handle(state, Received(at(6.99), wake, "m0"))
    assert effects == (State("asleep"), CancelTimer("step"))  # it may have lost its place: the renewal is not put off
    assert state.phase is Phase.ASLEEP


def test_it_falls_asleep_so_many_steps_after_the_last_beacon_and_asks_for_its_master() -> None:
    net = field_of().to_step(4)
    net.rule("wake", "m0", "s00")
    net.to_step(20)
    reported = [one.message.step for one in net.frames("range", "s00")]
    assert reported == list(range(1, 15))  # the beacon before step 5 was for ten steps
    (asked,) = net.frames("join", "s00", since=1)
    assert (asked.dst, asked.t_ns) == ("m0", at(14))
    assert net.state("s00").phase is Phase.ASLEEP
    assert net.owner("s00") == "m0"


def test_a_beacon_of_a_while_ago_does_not_keep_it_awake_for_ever() -> None:
    """One that comes so late that all its steps are over."""
    state, _ = woken(5, 1, now=at(7.5))
    assert state.phase is Phase.ASLEEP


def test_its_receiver_is_open_in_windows_only_also_while_it_measures() -> None:
    net = field_of(EAST[:1], [(0.0, 10.0)]).to_step(3, 0)
    opening = net.actors["s00"].receiver.opening
    assert not isinstance(opening, bool)
    assert (opening.every_ns, opening.open_ns) == (NS, 15 * MS)
    heard = [one.t_ns for one in net.heard if one.dst == "s00" and one.t_ns > ORIGIN_NS]
    assert heard == [at(k + 0.99) for k in range(3)]


# --- by itself -------------------------------------------------------------------------------------------------------


def test_one_that_reports_unasked_does_so_while_it_sleeps() -> None:
    slave = slave_of(3, (0.0, 0.0), unasked=True)
    seeking = replace(MEMBER, phase=Phase.SEEKING, search=Search(asked="m0", tries=1))
    state, effects = slave.handle(seeking, Received(NS, Admit(3, 2, 1), "m0"))
    assert effects[-1] == Sample("wake-up")
    assert slave.handle(state, Sampled(NS, "wake-up", None))[1] == ()
    state, effects = slave.handle(state, Sampled(NS, "wake-up", at(6.3)))
    assert effects == (SetTimer("step", at(7)),)
    state, effects = slave.handle(state, Timer(at(7), "step"))
    assert effects == (Sample("sound"),)
    state, effects = slave.handle(state, Sampled(at(7), "sound", HEARD))
    assert effects == (Send(Range(7, 12.5), "m0"), Sample("wake-up"))
    assert slave.handle(state, Sampled(at(7), "wake-up", at(7)))[1] == (SetTimer("step", at(8)),)
    quiet, effects = slave.handle(slave.handle(state, Timer(at(8), "step"))[0], Sampled(at(8), "sound", None))
    assert (effects, quiet.phase) == ((Sample("wake-up"),), Phase.ASLEEP)


# --- its clock -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ahead_ns", [-300 * MS, 0, 450 * MS])
def test_its_clock_is_set_by_its_master(ahead_ns: int) -> None:
    """It measures at the instants of steps, whatever its clock said at the start."""
    net = field_of(joining={"sync": SYNC}, before=lambda net: setattr(net.actors["s00"], "ahead_ns", ahead_ns))
    net.to_step(5)
    assert abs(net.state("s00").time.correction_ns + ahead_ns) < US
    slot_ns = net.state("s00").slot * SLOT_NS
    assert within_us([one.t_ns - slot_ns for one in net.frames("range", "s00")], range(1, 6))
    assert all(net.error_m(step) < 0.1 for step in range(1, 6))


@pytest.mark.parametrize("by_ns", [-350 * MS, 350 * MS, 2500 * MS, -2500 * MS])
def test_after_a_jump_of_its_clock_it_is_set_right_and_measures_again(by_ns: int) -> None:
    sync = {**SYNC, "resync_ns": 10 * NS}
    net = field_of(target=eastward(speed=0.5), joining={"sync": sync, "renew_ns": 5 * NS}).to_step(5)
    net.jump("s00", by_ns)
    net.to_step(35)
    assert abs(net.state("s00").time.correction_ns + by_ns) < US
    slot_ns = net.state("s00").slot * SLOT_NS
    sent = [one.t_ns - slot_ns for one in net.frames("range", "s00")]
    assert within_us([t for t in sent if t > at(25.5)], range(26, 36))
    assert all("s00" in net.track(step).sensors for step in range(26, 36))  # type: ignore[union-attr]


def test_who_tells_the_time_if_a_request_or_a_reply_is_lost() -> None:
    for kind in ("sync-request", "sync-reply"):
        net = field_of(joining={"sync": SYNC}, before=lambda net, kind=kind: net.rule(kind, count=2))  # type: ignore[misc]
        net.to_step(3)
        assert all(net.state(f"s{i:02}").time.known for i in range(12))


def test_a_correction_moves_its_next_step() -> None:
    slave = slave_of(3, (0.0, 0.0), sync=SYNC)
    state = replace(MEMBER, reference="m0", first=5, last=14)
    state = replace(state, time=slave._sync("m0").handle(state.time, Started(0))[0], phase=Phase.ACTIVE)
    state, effects = slave.handle(state, Timer(at(6.2), "sync"))
    assert Radio(True) in effects
    sent_us = at(6.2) // 1000
    reply = SyncReply(1, sent_us, sent_us + 120_000, sent_us + 120_000)
    state, effects = slave.handle(state, Received(at(6.24), reply, "m0"))
    state, effects = slave.handle(state, Timer(at(6.3), "sync"))
    assert Corrected(100 * MS) in effects
    assert SetTimer("step", at(7) - 100 * MS) in effects


# --- what is not for it ----------------------------------------------------------------------------------------------


def test_beacons_of_others_are_ignored() -> None:
    for state in (MEMBER, woken(5)[0]):
        after, effects = SLAVE.handle(state, Received(at(5.5), Wake(9, b"m1", 6, 10, 0, b"\x02"), "m1"))
        assert (after, effects) == (state, (Ignored("foreign"),))


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Announce(1, 5, 5, 0.0, 0.0), "not looking"),
        (Admit(3, 1, 0), "outdated"),
        (Admit(7, 1, 0), "not looking"),
        (Solicit(1), "unexpected"),
        (Join(3), "unexpected"),
        (NoTarget(3), "unexpected"),
        (SyncRequest(1, 0), "unexpected"),
        (SyncReply(1, 0, 0, 0), "unexpected"),
        (Range(3, 1.0), "unexpected"),
    ],
)
def test_messages_that_it_does_not_expect_are_ignored(message: Any, reason: str) -> None:
    for state in (MEMBER, woken(5)[0]):
        assert SLAVE.handle(state, Received(at(5.5), message, "m1")) == (state, (Ignored(reason),))


def test_a_renewal_that_is_refused() -> None:
    """Its master was started again without its list, say, and has given its place away."""
    state, effects = SLAVE.handle(MEMBER, Timer(at(5), "renew"))
    assert Send(Join(3), "m0") in effects
    assert Radio(True) in effects
    state, effects = SLAVE.handle(state, Received(at(5) + 2 * DELAY_NS, Admit(3, NO_PLACE, 0), "m0"))
    assert state.phase is not Phase.ASLEEP
    assert any(isinstance(one, SetTimer) and one.name == "turn" for one in effects)


def test_what_waits_for_its_slot_is_dropped_with_its_master() -> None:
    state, _ = woken(5, slot=4)
    state, _ = SLAVE.handle(state, Timer(at(5), "step"))
    state, _ = SLAVE.handle(state, Sampled(at(5), "sound", HEARD))
    state = replace(state, search=replace(state.search, asked="m0", tries=3))
    state, effects = SLAVE.handle(state, Timer(at(5.01), "answer"))
    assert {CancelTimer("step"), CancelTimer("report")} <= set(effects)
    assert state.phase is Phase.SEEKING


def test_a_broken_driver_is_told_so() -> None:
    for event in (Timer(at(5), "nap"), Started(0)):
        with pytest.raises(IllegalEvent):
            SLAVE.handle(MEMBER, event)


def test_it_consumes_what_masters_send() -> None:
    assert SLAVE.kinds == {"announce", "admit", "wake"}
    assert slave_of(3, (0.0, 0.0), sync=SYNC).kinds == {"announce", "admit", "wake", "sync-reply"}
