"""Putting frames in their place: whatever order the host hands them over in, the story is the one they were due in."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from tests.puppet import MS, Puppet, arrival, caught_up, core_of, frames, run, script
from tests.toys import Feedback, Reply, Request
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Died, Output, Refused, Sent, TakenBack, Told, Undone
from trackfield.link.energy import Power
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    Note,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
)
from trackfield.wire.codec import decode

START = Started(0)
CALL = Received(2 * MS, Request(1), "peer")
"""The frame that comes too late in most of these stories."""


def payloads(outputs: Iterable[Output]) -> list[object]:
    return [decode(frame.payload) for frame in frames(outputs)]


# --- one frame in the wrong order ---------------------------------------------------------------------------------


def test_a_frame_that_comes_after_a_later_one_is_put_before_it() -> None:
    core = core_of(Puppet())
    core.offer(arrival(3 * MS, Request(2)))
    run(core, 5 * MS)
    assert caught_up(core, arrival(2 * MS, Request(1))) == []
    assert core.state == (START, CALL, Received(3 * MS, Request(2), "peer"))
    assert (core.inversions, core.host_late, core.tally) == (1, 0, {"delivered": 2})


def test_a_frame_due_at_a_deadline_that_comes_after_it_still_counts() -> None:
    core = core_of(script({START: (SetTimer("deadline", 2 * MS),)}))
    run(core, 5 * MS)
    caught_up(core, arrival(2 * MS, Request(1)))
    assert core.state == (START, CALL, Timer(2 * MS, "deadline"))


def test_several_are_put_in_their_places_at_once() -> None:
    core = core_of(script({START: (SetTimer("end", 9 * MS),)}))
    run(core, NS)
    caught_up(core, *(arrival(t * MS, Request(t)) for t in (7, 3, 5)))
    assert [e.now // MS for e in core.state] == [0, 3, 5, 7, 9]
    assert core.inversions == 3


def test_a_frame_that_is_not_late_waits_its_turn() -> None:
    """It came together with a late one, but is due only after all that was handled."""
    core = core_of(script({START: (SetTimer("a", 5 * MS),)}))
    run(core, 5 * MS)
    core.offer(arrival(6 * MS, Request(2)))
    caught_up(core, arrival(2 * MS, Request(1)))
    assert core.state == (START, CALL, Timer(5 * MS, "a"))
    assert core.next_key() == arrival(6 * MS, Request(2)).key


def test_without_late_frames_nothing_is_done_again() -> None:
    core = core_of(script({START: (SetTimer("a", 5 * MS), Note("hello"))}))
    run(core, NS)
    state = core.state
    assert not core.behind
    assert caught_up(core) == []
    assert core.state is state


# --- what left already --------------------------------------------------------------------------------------------


def test_what_left_is_not_sent_again_and_what_is_new_goes_out_with_its_logical_time() -> None:
    """A node reported at 5 ms; a request due at 2 ms turns up afterwards and is answered as of 2 ms."""
    core = core_of(script({
        START: (SetTimer("report", 5 * MS),),
        Timer(5 * MS, "report"): (Send(Feedback(1, 1), NEIGHBOURHOOD), Note("reported")),
        CALL: (Send(Reply(1), "peer"),),
    }))  # fmt: skip
    assert payloads(run(core, 5 * MS)) == [Feedback(1, 1)]
    (sent,) = caught_up(core, arrival(2 * MS, Request(1)))
    assert isinstance(sent, Sent)
    assert (sent.frame.sent_ns, sent.frame.kind, sent.frame.copy) == (2 * MS, "reply", 0)
    assert core.host_late == 0


def test_telemetry_that_changes_is_taken_back_and_told_anew() -> None:
    class Counter:
        kinds = frozenset({"request"})

        def begin(self) -> int:
            return 0

        def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
            return state + 1, (State(f"{state}"),)

    core = core_of(Counter())
    for t in (1, 4):
        core.offer(arrival(t * MS, Request(t)))
    run(core, NS)
    first, second, third = (arrival(t * MS, Request(t)).key for t in (1, 2, 4))
    assert caught_up(core, arrival(2 * MS, Request(2))) == [
        Undone((2 * MS, 0, "")), Told(second, State("2")), Told(third, State("3"))
    ]  # fmt: skip
    assert first < second


def test_telemetry_that_stays_the_same_is_not_told_again() -> None:
    core = core_of(script({START: (SetTimer("a", 5 * MS),), Timer(5 * MS, "a"): (Note("a"), Ignored("twice"))}))
    run(core, NS)
    assert caught_up(core, arrival(2 * MS, Request(1))) == []
    assert core.tally == {"delivered": 1, "ignored": 1}


CANCELLED = {
    START: (SetTimer("report", 5 * MS),),
    Timer(5 * MS, "report"): (Send(Feedback(1, 1), "hub"),),
    CALL: (CancelTimer("report"),),
}
"""A report at 5 ms, unless the call of 2 ms says that it is not wanted."""


def test_what_left_and_should_not_have_is_taken_back() -> None:
    """The report is out when the call that would have stopped it turns up."""
    core = core_of(script(CANCELLED))
    (report,) = frames(run(core, NS))
    assert caught_up(core, arrival(2 * MS, Request(1))) == [TakenBack(report)]
    assert core.state == (START, CALL)
    assert core.host_late == 0


def test_what_was_taken_back_is_sent_again_when_it_comes_back() -> None:
    """A second late frame makes the role want the report after all."""
    again = Received(3 * MS, Request(2), "peer")
    core = core_of(script({**CANCELLED, again: (SetTimer("report", 5 * MS),)}))
    run(core, NS)
    caught_up(core, arrival(2 * MS, Request(1)))
    assert payloads(caught_up(core, arrival(3 * MS, Request(2)))) == [Feedback(1, 1)]
    assert core.state == (START, CALL, again, Timer(5 * MS, "report"))


@pytest.mark.parametrize("name", ["another", "later"])
def test_what_takes_the_place_of_a_frame_that_left_replaces_it(name: str) -> None:
    """Instead of the report, the role now sends something else to the same place at the same instant.

    To its hearers that is the same frame in another version, whether its timer comes before or after the one that is no
    longer there; before, it is put once more, and after, the report is taken back first.
    """
    other = Timer(5 * MS, name)
    core = core_of(script({
        **CANCELLED,
        CALL: (CancelTimer("report"), SetTimer(name, 5 * MS)),
        other: (Send(Feedback(2, 2), "hub"), Send(Feedback(3, 3), "hub")),
    }))  # fmt: skip
    run(core, NS)
    outputs = caught_up(core, arrival(2 * MS, Request(1))) + run(core, NS)
    assert core.state == (START, CALL, other)
    assert [(decode(f.payload), f.copy) for f in frames(outputs)] == [(Feedback(2, 2), 0), (Feedback(3, 3), 1)]


# --- what was handled and is taken back ---------------------------------------------------------------------------


def test_a_frame_that_is_withdrawn_has_never_been_handled() -> None:
    call = arrival(2 * MS, Request(1))
    core = core_of(script({CALL: (Send(Reply(1), "peer"), Note("called"))}))
    core.offer(call)
    core.offer(arrival(3 * MS, Request(2)))
    (reply,) = frames(run(core, NS))
    assert core.withdraw(call)
    assert caught_up(core) == [TakenBack(reply), Undone((2 * MS, 0, ""))]
    assert core.state == (START, Received(3 * MS, Request(2), "peer"))
    assert core.tally == {"delivered": 1}
    assert not core.behind


def test_a_frame_that_is_withdrawn_before_its_time_is_free() -> None:
    call = arrival(2 * MS, Request(1))
    core = core_of(Puppet())
    core.offer(call)
    assert core.withdraw(call)
    assert not core.behind
    run(core, NS)
    assert core.state == (START,)


def test_a_frame_that_waits_to_be_handled_again_and_is_withdrawn_takes_back_what_it_had_put_out() -> None:
    """It was undone for the sake of an earlier frame; before it is handled again it is withdrawn."""
    call, earlier = arrival(2 * MS, Request(1)), arrival(MS, Request(2))
    core = core_of(script({CALL: (Send(Reply(1), "peer"),)}))
    core.offer(call)
    (reply,) = frames(run(core, NS))
    core.offer(earlier)
    assert core.catch_up() == []
    assert core.withdraw(call)
    assert core.catch_up() == []
    assert core.handle_next() == [TakenBack(reply)]
    assert not core.behind


def test_a_frame_that_comes_late_and_is_withdrawn_at_once_changes_nothing() -> None:
    late = arrival(2 * MS, Request(1))
    core = core_of(Puppet())
    core.offer(arrival(3 * MS, Request(2)))
    run(core, NS)
    core.offer(late)
    assert core.withdraw(late)
    assert caught_up(core) == []
    assert core.state == (START, Received(3 * MS, Request(2), "peer"))


def test_a_frame_that_is_replaced_is_handled_in_its_new_version() -> None:
    """Both versions are due at the same instant; the new one may come before anything is undone, and go again."""
    old, new = arrival(2 * MS, Request(1)), arrival(2 * MS, Request(7))
    core = core_of(Puppet())
    core.offer(old)
    run(core, NS)
    for version, before in ((new, old), (old, new), (new, old)):
        assert core.withdraw(before)
        assert core.offer(version)
    caught_up(core)
    run(core, NS)
    assert core.state == (START, Received(2 * MS, Request(7), "peer"))
    assert core.host_late == 0


def test_what_is_withdrawn_too_late_stays_and_is_counted() -> None:
    old, core = arrival(2 * MS, Request(1)), core_of(Puppet(), horizon_ns=100 * MS)
    core.offer(old)
    core.offer(arrival(500 * MS, Request(2)))
    run(core, NS)
    assert not core.withdraw(old)
    assert (core.host_late, core.behind) == (1, False)
    assert core.state[1] == CALL


def test_a_battery_that_was_empty_by_mistake_lives_on() -> None:
    """The frame that used it up is taken back; a process that died stays and goes back."""
    power = Power(0, 0, 0, 0, battery_fj=50, sample_fj=30)
    core = core_of(
        Puppet(lambda event: (Sample("sound"),) if isinstance(event, Received) else ()),
        sense=lambda name, t_ns: t_ns,
        conditions=Conditions(powers={"field": power}),
    )
    first, second = arrival(2 * MS, Request(1)), arrival(3 * MS, Request(2))
    core.offer(first)
    core.offer(second)
    outputs = run(core, NS)
    assert core.life.over
    assert [o.effect for o in outputs if isinstance(o, Told)][-1] == Died("battery")
    core.withdraw(first)
    retold = caught_up(core)
    assert not core.life.over
    assert Died("battery") not in [o.effect for o in retold if isinstance(o, Told)]


def test_what_was_stored_is_undone() -> None:
    """The next life is given what was stored before it."""
    call = arrival(2 * MS, Request(1))
    core = core_of(script({START: (Store(b"one"),), CALL: (Store(b"two"),)}))
    core.offer(call)
    run(core, NS)
    assert core.life.stored == b"two"
    core.withdraw(call)
    caught_up(core)
    assert core.life.stored == b"one"


# --- all of a life is undone --------------------------------------------------------------------------------------


def test_the_radio_is_undone() -> None:
    """The call at 2 ms switches the radio off: what was heard at 4 ms was not, after all."""
    core = core_of(script({CALL: (Radio(False),)}))
    core.offer(arrival(4 * MS, Request(2)))
    run(core, NS)
    assert core.tally == {"delivered": 1}
    caught_up(core, arrival(2 * MS, Request(1)))
    assert core.state == (START, CALL)
    assert core.tally == {"delivered": 1, "asleep": 1}


def test_timers_are_undone() -> None:
    """The call at 2 ms moves a timer from 5 to 7 ms, past all that was handled."""
    core = core_of(script({START: (SetTimer("a", 5 * MS),), CALL: (SetTimer("a", 7 * MS),)}))
    run(core, 6 * MS)
    caught_up(core, arrival(2 * MS, Request(1)))
    assert core.state == (START, CALL)
    assert core.next_key() == (7 * MS, 3, 7 * MS, "a")


def test_copies_are_undone() -> None:
    """Two frames at one instant, each answered alike: handled in the wrong order, the first answer has copy 0 still."""
    core = core_of(Puppet(lambda event: (Send(Reply(1), "hub"),) if isinstance(event, Received) else ()))
    core.offer(arrival(2 * MS, Request(1), src="q"))
    assert [f.copy for f in frames(run(core, NS))] == [0]
    assert [f.copy for f in frames(caught_up(core, arrival(2 * MS, Request(1), src="p")))] == [1]
    assert core.host_late == 0


def test_a_sensor_is_read_again_at_the_same_time() -> None:
    core = core_of(
        Puppet(lambda event: (Sample("sound"),) if isinstance(event, Received) else ()),
        sense=lambda name, t_ns: (name, t_ns),
    )
    core.offer(arrival(3 * MS, Request(2)))
    run(core, NS)
    caught_up(core, arrival(2 * MS, Request(1)))
    assert core.state[2::2] == tuple(Sampled(t * MS, "sound", ("sound", t * MS)) for t in (2, 3))


def test_a_late_malformed_frame_takes_its_place_in_the_account_only() -> None:
    core = core_of(script({START: (SetTimer("a", 5 * MS),)}))
    run(core, NS)
    late = arrival(2 * MS, b"nonsense")
    outputs = caught_up(core, late)
    assert [type(o) for o in outputs] == [Refused]
    assert core.state == (START, Timer(5 * MS, "a"))
    assert core.tally == {"delivered": 1, "ignored": 1}


def test_events_that_vanished_leave_no_hole() -> None:
    """The timer was the last event, and is gone; another frame then belongs where it was."""
    core = core_of(script(CANCELLED))
    run(core, NS)
    caught_up(core, arrival(2 * MS, Request(1)))
    caught_up(core, arrival(3 * MS, Request(2)))
    assert core.state == (START, CALL, Received(3 * MS, Request(2), "peer"))
    assert core.inversions == 1


def test_timers_set_for_their_own_instant_are_all_handled_again() -> None:
    """``b`` sets ``a`` for now: the last event handled has not the largest key."""
    core = core_of(script({
        START: (SetTimer("b", 5 * MS),),
        Timer(5 * MS, "b"): (SetTimer("a", 5 * MS), Send(Reply(1), "hub")),
    }))  # fmt: skip
    run(core, NS)
    assert caught_up(core, arrival(2 * MS, Request(1))) == []
    assert core.state == (START, CALL, Timer(5 * MS, "b"), Timer(5 * MS, "a"))
    assert core.host_late == 0


# --- how far back -------------------------------------------------------------------------------------------------


def steady(horizon_ns: int) -> Core:
    """An engine at 1 s that handled a timer every 10 ms."""
    every = Puppet(lambda event: (SetTimer("tick", event.now + 10 * MS),) if not isinstance(event, Received) else ())
    core = core_of(every, horizon_ns=horizon_ns)
    run(core, NS)
    return core


def test_a_frame_older_than_the_horizon_is_not_applied_and_counted() -> None:
    core = steady(100 * MS)
    state = core.state
    assert not core.offer(arrival(899 * MS, Request(1)))
    assert (core.behind, core.host_late, core.inversions) == (False, 1, 0)
    assert core.state == state


def test_what_waits_to_be_caught_up_with_is_not_forgotten() -> None:
    """Replays may have to wait; what happens meanwhile does not make a frame too old that came in time."""
    core = steady(100 * MS)
    assert core.offer(arrival(901 * MS, Request(1)))
    run(core, 2 * NS)
    caught_up(core)
    assert core.state[91] == Received(901 * MS, Request(1), "peer")
    assert core.host_late == 0


def test_the_past_has_a_limit_in_bytes() -> None:
    """However short ago it was: what no longer fits is forgotten, and a frame from then is counted."""
    core = core_of(Puppet())
    core._history.max_bytes = 20_000
    for n in range(20):
        core.offer(arrival((n + 1) * MS, Request(n)))
    run(core, 20 * MS)
    assert core.offer(arrival(19 * MS - 1, Request(1)))
    assert not core.offer(arrival(2 * MS - 1, Request(1)))
    assert core.host_late == 1


def test_a_frame_within_the_horizon_is_not_late() -> None:
    core = steady(100 * MS)
    caught_up(core, arrival(901 * MS, Request(1)))
    assert (core.host_late, core.inversions) == (0, 1)
    assert core.state[-12:-9] == (
        Timer(900 * MS, "tick"), Received(901 * MS, Request(1), "peer"), Timer(910 * MS, "tick")
    )  # fmt: skip


def test_a_frame_before_the_first_event_in_a_long_time_is_not_late() -> None:
    """A listener heard nothing for 10 s; then two frames come 1 ms apart, in the wrong order."""
    core = core_of(Puppet(), horizon_ns=100 * MS)
    run(core, 0)
    core.offer(arrival(10 * NS, Request(2)))
    run(core, 10 * NS)
    caught_up(core, arrival(10 * NS - MS, Request(1)))
    assert [e.now for e in core.state] == [0, 10 * NS - MS, 10 * NS]
    assert core.host_late == 0


def test_without_a_horizon_nothing_is_ever_undone() -> None:
    core = core_of(Puppet(), horizon_ns=0)
    core.offer(arrival(2 * MS, Request(2)))
    run(core, NS)
    assert not core.offer(arrival(1 * MS, Request(1)))
    run(core, NS)
    assert [e.message.chain for e in core.state[1:]] == [2]
    assert core.host_late == 1
