"""The engine under both drivers: one event after the other, and what comes of each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import MS, Puppet, arrival, core_of, frames, run, script
from tests.toys import Feedback, Reply, Request
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Refused, Told
from trackfield.link.clock import Clock
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Publish,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
    TrackPoint,
    Write,
)
from trackfield.wire.codec import decode, encode
from trackfield.wire.keys import Medium

POINT = TrackPoint("spcpf", "bus", 3 * NS, "waiting", step=3)


def at_start(*effects: Effect, **kwargs: Any) -> Core:
    """An engine whose role asks for these when it starts, and for nothing afterwards."""
    return core_of(Puppet(lambda event: effects if isinstance(event, Started) else ()), **kwargs)


# --- the order of events ------------------------------------------------------------------------------------------


def test_a_life_begins_with_its_start() -> None:
    core = Core(
        Puppet(), owner="me", clock=Clock(offset_ns=7), sense=lambda *_: None, conditions=Conditions(start_ns=3 * NS)
    )
    assert core.next_key() == (3 * NS, 0, "start")
    core.handle_next()
    assert core.state == (Started(3 * NS + 7),)
    assert core.next_key() is None


def test_nothing_can_be_handled_before_it_is_there() -> None:
    core = core_of(Puppet())
    core.handle_next()
    with pytest.raises(IllegalEvent, match="nothing is due"):
        core.handle_next()
    assert core.state == (Started(0),)


def test_frames_of_one_instant_come_by_sender_kind_sending_time_and_copy() -> None:
    """Several neighbours answer at once; the one who hears them takes them in the same order in every run."""
    in_order = [
        arrival(4 * MS, Request(9), src="z"),
        arrival(5 * MS, Reply(1), src="a"),
        arrival(5 * MS, Request(2), src="a"),
        arrival(5 * MS, Request(3), src="a", copy=1),
        arrival(5 * MS, Feedback(4, 4), src="b"),
        arrival(6 * MS, Request(5), src="a"),
    ]
    core = core_of(Puppet())
    for frame in reversed(in_order):
        core.offer(frame)
    run(core, NS)
    assert core.state[1:] == tuple(Received(a.due_ns, decode(a.frame.payload), a.frame.src) for a in in_order)


def test_a_frame_due_exactly_at_a_deadline_counts() -> None:
    core = at_start(SetTimer("deadline", 5 * MS))
    core.offer(arrival(5 * MS, Request(1)))
    core.offer(arrival(5 * MS + 1, Request(2)))
    run(core, NS)
    assert core.state[1:] == (
        Received(5 * MS, Request(1), "peer"),
        Timer(5 * MS, "deadline"),
        Received(5 * MS + 1, Request(2), "peer"),
    )


# --- timers -------------------------------------------------------------------------------------------------------


def test_timers_fire_in_the_order_of_their_times_and_then_of_their_names() -> None:
    core = at_start(SetTimer("b", 2 * MS), SetTimer("c", 1 * MS), SetTimer("a", 2 * MS))
    run(core, NS)
    assert core.state[1:] == (Timer(1 * MS, "c"), Timer(2 * MS, "a"), Timer(2 * MS, "b"))


def test_a_second_timer_of_a_name_replaces_the_first() -> None:
    core = at_start(SetTimer("a", 1 * MS), SetTimer("a", 2 * MS))
    run(core, NS)
    assert core.state[1:] == (Timer(2 * MS, "a"),)


def test_a_cancelled_timer_never_fires_and_one_that_is_not_there_can_be_cancelled() -> None:
    core = at_start(SetTimer("a", 1 * MS), SetTimer("b", 2 * MS), CancelTimer("a"), CancelTimer("c"))
    run(core, NS)
    assert core.state[1:] == (Timer(2 * MS, "b"),)


def test_a_timer_set_for_a_time_that_passed_fires_now() -> None:
    """A node that wakes late finds two deadlines behind it: both fire at once, the older one first."""
    wake = Timer(9 * MS, "wake")
    late = (SetTimer("a", 5 * MS), SetTimer("b", 4 * MS), SetTimer("c", 9 * MS))
    core = core_of(script({Started(0): (SetTimer("wake", 9 * MS),), wake: late}))
    run(core, NS)
    assert core.state[1:] == (wake, Timer(9 * MS, "b"), Timer(9 * MS, "a"), Timer(9 * MS, "c"))


def test_a_timer_fires_once() -> None:
    core = at_start(SetTimer("a", 1 * MS))
    run(core, NS)
    assert core.next_key() is None


# --- the local clock ----------------------------------------------------------------------------------------------


@given(
    st.builds(Clock, st.integers(-NS, NS), st.integers(-500_000, NS)),
    st.integers(1, 10**13),
    st.integers(1, 10**13),
)
def test_a_role_knows_its_own_clock_only(clock: Clock, later: int, due: int) -> None:
    """A timer comes at exactly the local time that it was set for, a frame at what the clock shows when it is due."""
    at = clock.local(0) + later
    core = at_start(SetTimer("a", at), clock=clock)
    core.offer(arrival(due, Request(1)))
    keys = []
    while (key := core.next_key()) is not None:
        keys.append(key[:2])
        core.handle_next()
    timer = ((clock.true(at), 3), Timer(at, "a"))
    frame = ((due, 1), Received(clock.local(due), Request(1), "peer"))
    happened = sorted([timer, frame], key=lambda pair: pair[0])
    assert core.state == (Started(clock.local(0)), *(event for _, event in happened))
    assert keys == [(0, 0), *(key for key, _ in happened)]


def test_a_timer_comes_at_its_time_even_if_the_clock_never_shows_it() -> None:
    """A clock of double speed shows even nanoseconds only."""
    core = at_start(SetTimer("a", 2 * MS + 1), clock=Clock(drift_ppb=NS))
    run(core, NS)
    assert core.state[1:] == (Timer(2 * MS + 1, "a"),)


def test_a_late_timer_shows_the_local_time_at_which_it_fires() -> None:
    """The clock is 2 s ahead: local 1 s passed before the run began."""
    core = at_start(SetTimer("a", NS), clock=Clock(offset_ns=2 * NS))
    run(core, 0)
    assert core.state == (Started(2 * NS), Timer(2 * NS, "a"))


# --- sensors ------------------------------------------------------------------------------------------------------


def test_a_sensor_answers_before_anything_else_happens() -> None:
    """A node reads a sensor, that answer makes it read another, and only then it sends what it wanted to send."""
    clock = Clock(offset_ns=5)

    def react(event: Event) -> tuple[Effect, ...]:
        match event:
            case Started():
                return Sample("sound"), Send(Reply(1), "hub")
            case Sampled(_, "sound", _):
                return Send(Reply(2), "hub"), Sample("light")
            case Sampled():
                return (Send(Reply(3), "hub"),)
        return ()

    core = core_of(Puppet(react), clock=clock, sense=lambda name, t_ns: (name, t_ns))
    outputs = core.handle_next()
    assert core.state == (Started(5), Sampled(5, "sound", ("sound", 0)), Sampled(5, "light", ("light", 0)))
    assert [decode(f.payload) for f in frames(outputs)] == [Reply(2), Reply(3), Reply(1)]


# --- what is sent -------------------------------------------------------------------------------------------------


def test_a_frame_carries_bytes_and_who_sent_it_when() -> None:
    reply = Send(Reply(5), "hub", "backbone")
    role = script({Started(0): (SetTimer("a", 3 * MS),), Timer(3 * MS, "a"): (reply,)})
    core = Core(role, owner="n1", clock=Clock(), sense=lambda *_: None, incarnation=2)
    (frame,) = frames(run(core, NS))
    assert (frame.src, frame.incarnation, frame.kind, frame.sent_ns) == ("n1", 2, "reply", 3 * MS)
    assert (frame.copy, frame.to, frame.medium, frame.payload) == (0, "hub", "backbone", encode(Reply(5)))


@pytest.mark.parametrize(
    ("to", "addresses"),
    [
        ("b", ["b"]),
        (frozenset({"b"}), ["b"]),
        (frozenset({"b", "a"}), ["a", "b"]),
        (NEIGHBOURHOOD, ["*"]),
    ],
)
def test_each_address_is_a_frame_of_its_own(to: str | frozenset[str], addresses: list[str]) -> None:
    sent = frames(at_start(Send(Reply(1), to)).handle_next())
    assert [frame.to for frame in sent] == addresses
    assert [frame.broadcast for frame in sent] == [address == "*" for address in addresses]


def test_what_is_sent_to_nobody_does_not_leave() -> None:
    assert at_start(Send(Reply(1), frozenset())).handle_next() == []


def test_copies_tell_frames_of_one_kind_address_and_instant_apart() -> None:
    """Two requests come at one instant and each takes two replies to the hub: none of them may pass for another."""
    replies = (Send(Reply(1), "hub"), Send(Reply(2), "hub"))
    core = core_of(Puppet(lambda event: replies if isinstance(event, Received) else ()))
    for src in ("p", "q"):
        core.offer(arrival(5 * MS, Request(1), src=src))
    core.offer(arrival(6 * MS, Request(1)))
    assert [(f.sent_ns, f.copy) for f in frames(run(core, NS))] == [
        (5 * MS, 0), (5 * MS, 1), (5 * MS, 2), (5 * MS, 3), (6 * MS, 0), (6 * MS, 1)
    ]  # fmt: skip


def test_copies_are_counted_by_kind_and_address() -> None:
    sends = (Send(Reply(1), "a"), Send(Reply(1), "b"), Send(Request(1), "a"), Send(Reply(1), NEIGHBOURHOOD))
    assert [f.copy for f in frames(at_start(*sends).handle_next())] == [0, 0, 0, 0]


def test_whoever_is_addressed_twice_can_tell_it_from_a_repetition() -> None:
    """A head tells three members something, one of them more."""
    sends = (
        Send(Reply(1), frozenset({"a", "b", "c"})),
        Send(Reply(2), "b"),
        Send(Reply(3), frozenset({"a", "b"})),
        Send(Reply(4), "c"),
    )
    sent = frames(at_start(*sends).handle_next())
    for member, copies in {"a": [0, 1], "b": [0, 1, 2], "c": [0, 1]}.items():
        assert [frame.copy for frame in sent if frame.to == member] == copies


# --- the radio ----------------------------------------------------------------------------------------------------


def heard(*switches: tuple[int, bool], medium: Medium = "field") -> tuple[list[int], dict[str, int]]:
    """When (ms) frames were heard by a role that switches its receiver at these times; its tally."""

    def react(event: Event) -> list[Effect]:
        if isinstance(event, Started):
            return [SetTimer(f"{i}", t * MS) for i, (t, _) in enumerate(switches)]
        return [Radio(switches[int(event.name)][1])] if isinstance(event, Timer) else []

    core = core_of(Puppet(react))
    for t in range(1, 7):
        core.offer(arrival(t * MS, Request(t), medium=medium))
    run(core, NS)
    return [e.message.chain for e in core.state if isinstance(e, Received)], core.tally


def test_a_receiver_listens_until_told_otherwise() -> None:
    assert heard() == ([1, 2, 3, 4, 5, 6], {"delivered": 6})


def test_a_change_counts_for_frames_due_after_it() -> None:
    """Off at 2 ms, on at 4 ms: the frame due at 2 ms is heard still, the one due at 4 ms is not yet."""
    assert heard((2, False), (4, True)) == ([1, 2, 5, 6], {"delivered": 4, "asleep": 2})


def test_of_two_changes_at_one_instant_the_last_one_counts_after_it() -> None:
    assert heard((2, False), (2, True)) == ([1, 2, 3, 4, 5, 6], {"delivered": 6})
    assert heard((1, False), (3, True), (3, False)) == ([1], {"delivered": 1, "asleep": 5})


def test_each_medium_has_a_receiver() -> None:
    assert heard((2, False), medium="backbone") == ([1, 2, 3, 4, 5, 6], {"delivered": 6})


def test_changes_at_one_instant_do_not_count_for_other_frames_of_that_instant() -> None:
    """p switches it off, and q, which was due then too, on again; r is as early as they are."""
    switches = {"p": (Radio(False),), "q": (Radio(True),)}
    core = core_of(Puppet(lambda event: switches.get(event.sender, ()) if isinstance(event, Received) else ()))
    for src in "pqr":
        core.offer(arrival(5 * MS, Request(1), src=src))
    run(core, NS)
    assert core.tally == {"delivered": 3}


def test_a_frame_that_switches_the_radio_off_does_not_hide_another_of_its_instant() -> None:
    core = core_of(Puppet(lambda event: (Radio(False),) if isinstance(event, Received) else ()))
    for t, src in ((5, "p"), (5, "q"), (6, "r")):
        core.offer(arrival(t * MS, Request(1), src=src))
    run(core, NS)
    assert [e.sender for e in core.state[1:]] == ["p", "q"]
    assert core.tally == {"delivered": 2, "asleep": 1}


# --- what peers can do --------------------------------------------------------------------------------------------


@given(st.binary(max_size=40) | st.binary(max_size=12).map(lambda tail: b"\x93\x01\xcc\xc8" + tail))
def test_no_payload_can_crash_a_process(payload: bytes) -> None:
    """Whatever comes is either the message that it says it is, or is counted and told, and the role never sees it."""
    core = core_of(Puppet())
    frame = arrival(5 * MS, payload)
    core.offer(frame)
    outputs = run(core, NS)
    if len(core.state) == 2:
        assert isinstance(core.state[1].message, Request)
        assert (core.tally, outputs) == ({"delivered": 1}, [])
    else:
        assert core.tally == {"delivered": 1, "ignored": 1}
        (refused,) = outputs
        assert isinstance(refused, Refused)
        assert refused.key == frame.key


@pytest.mark.parametrize(
    ("payload", "reason"),
    [(b"", "malformed"), (encode(Reply(1)), "kind"), (b"\x93\x02\xcc\xc8\x01", "version"), (bytes(5000), "size")],
)
def test_the_reason_is_told(payload: bytes, reason: str) -> None:
    core = core_of(Puppet())
    frame = arrival(5 * MS, payload)
    core.offer(frame)
    assert run(core, NS) == [Refused(frame.key, reason)]


# --- telemetry ----------------------------------------------------------------------------------------------------


def test_what_a_role_shows_is_told_with_the_event_it_came_from() -> None:
    shown = (State("awake"), Radio(False), Publish(POINT), Note("hello"))
    told = (*shown[:2], Publish(replace(POINT, source="me")), shown[3])
    assert at_start(*shown).handle_next() == [Told((0, 0, "start"), effect) for effect in told]


def test_bytes_for_a_device_leave_as_they_are() -> None:
    assert at_start(Write("tty", b"\x00\xff")).handle_next() == [Told((0, 0, "start"), Write("tty", b"\x00\xff"))]


@pytest.mark.parametrize(("reason", "outcome"), [("late", "late"), ("repeated", "ignored")])
def test_a_frame_of_no_use_is_counted_by_its_reason(reason: str, outcome: str) -> None:
    frame = arrival(5 * MS, Request(1))
    core = core_of(script({Received(5 * MS, Request(1), "peer"): (Ignored(reason),)}))
    core.offer(frame)
    assert run(core, NS) == [Refused(frame.key, reason)]
    assert core.tally == {"delivered": 1, outcome: 1}


def test_what_a_broken_role_says_is_not_hidden() -> None:
    """A role that refuses an event as illegal stops its process: the driver is wrong, and goes no further."""

    def refuse(event: Event) -> tuple[Effect, ...]:
        raise IllegalEvent(str(event))

    with pytest.raises(IllegalEvent, match="Started"):
        core_of(Puppet(refuse)).handle_next()
