"""What befalls a process whatever its role does: it stands still, it is killed and lives again, its clock jumps."""

from __future__ import annotations

import pytest

from tests.puppet import MS, Puppet, arrival, caught_up, core_of, frames, run, script
from tests.toys import Reply, Request
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import RANK_TIMER, Told
from trackfield.link.clock import Clock
from trackfield.link.energy import Power
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
    IllegalEvent,
    Note,
    Received,
    Send,
    SetTimer,
    Started,
    Store,
    Timer,
)

START = Started(0)


def at_start(*effects: Effect, conditions: Conditions, clock: Clock | None = None) -> Core:
    """An engine whose role asks for these when it starts."""
    react = Puppet(lambda event: effects if isinstance(event, Started) else ())
    return core_of(react, conditions=conditions, clock=clock)


def after_start(core: Core, until_ns: int = NS) -> tuple[Event, ...]:
    run(core, until_ns)
    assert isinstance(core.state[0], Started)
    return core.state[1:]  # type: ignore[no-any-return]


# --- standing still ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("due_ns", "outcome"),
    [(2 * MS - 1, "delivered"), (2 * MS, "frozen"), (5 * MS - 1, "frozen"), (5 * MS, "delivered")],
)
def test_a_frame_due_while_it_stands_still_is_lost(due_ns: int, outcome: str) -> None:
    core = core_of(Puppet(), conditions=Conditions(freezes=((2 * MS, 5 * MS),)))
    core.offer(arrival(due_ns, Request(1)))
    heard = (Received(due_ns, Request(1), "peer"),) if outcome == "delivered" else ()
    assert after_start(core) == heard
    assert core.tally == {outcome: 1}


def test_timers_that_were_due_fire_at_its_end_the_oldest_first() -> None:
    """Stopped from 2 to 5 ms: what should have happened then happens at 5 ms, before what is due at 5 ms anyway."""
    due = {"on time": 2 * MS - 1, "c": 2 * MS, "b": 4 * MS, "a": 5 * MS - 1, "0": 5 * MS, "later": 5 * MS + 1}
    freeze = Conditions(freezes=((2 * MS, 5 * MS),))
    core = at_start(*(SetTimer(name, at) for name, at in due.items()), conditions=freeze)
    assert after_start(core) == (
        Timer(2 * MS - 1, "on time"),
        Timer(5 * MS, "c"), Timer(5 * MS, "b"), Timer(5 * MS, "a"), Timer(5 * MS, "0"),
        Timer(5 * MS + 1, "later"),
    )  # fmt: skip


def test_a_frame_due_at_its_end_comes_before_the_timers_that_waited() -> None:
    core = at_start(SetTimer("a", 3 * MS), conditions=Conditions(freezes=((2 * MS, 5 * MS),)))
    core.offer(arrival(5 * MS, Request(1)))
    assert after_start(core) == (Received(5 * MS, Request(1), "peer"), Timer(5 * MS, "a"))


def test_a_timer_that_waited_shows_its_own_clock() -> None:
    """Of double speed and 7 ns ahead: due at local 6 ms + 7 ns, which is true 3 ms, it fires at true 5 ms."""
    freeze, clock = Conditions(freezes=((2 * MS, 5 * MS),)), Clock(7, NS)
    assert after_start(at_start(SetTimer("a", 6 * MS + 7), conditions=freeze, clock=clock)) == (
        Timer(10 * MS + 7, "a"),
    )


def test_a_deadline_that_passed_meanwhile_fires_now() -> None:
    """The first thing that it does afterwards is to set a timer for a time at which it stood still."""
    core = core_of(
        script({START: (SetTimer("wake", 3 * MS),), Timer(5 * MS, "wake"): (SetTimer("past", 4 * MS), Note("up"))}),
        conditions=Conditions(freezes=((2 * MS, 5 * MS),)),
    )
    assert after_start(core, 5 * MS) == (Timer(5 * MS, "wake"), Timer(5 * MS, "past"))
    assert core.next_key() is None


def test_it_may_stand_still_again_as_soon_as_it_goes_on() -> None:
    """A timer of 3 ms fires at 5 ms; the one that it sets for then finds it still for the second time."""
    core = core_of(
        script({START: (SetTimer("a", 3 * MS),), Timer(5 * MS, "a"): (SetTimer("b", 6 * MS),)}),
        conditions=Conditions(freezes=((2 * MS, 5 * MS), (6 * MS, 9 * MS))),
    )
    assert after_start(core) == (Timer(5 * MS, "a"), Timer(9 * MS, "b"))


def test_who_stands_still_from_its_first_instant_starts_and_does_nothing_more() -> None:
    """It was up when it was stopped: what it wants at once, or should have done before, waits for the end."""
    freeze = Conditions(freezes=((0, 5 * MS),))
    core = at_start(SetTimer("now", 0), SetTimer("past", -MS), SetTimer("later", 6 * MS), conditions=freeze)
    core.offer(arrival(0, Request(1)))
    assert after_start(core) == (Timer(5 * MS, "past"), Timer(5 * MS, "now"), Timer(6 * MS, "later"))
    assert core.tally == {"frozen": 1}


def test_a_cancelled_timer_does_not_fire_at_the_end_either() -> None:
    core = core_of(
        script({START: (SetTimer("a", 2 * MS), SetTimer("b", 3 * MS)), Timer(5 * MS, "a"): (CancelTimer("b"),)}),
        conditions=Conditions(freezes=((2 * MS, 5 * MS),)),
    )
    assert after_start(core) == (Timer(5 * MS, "a"),)


# --- killed, and alive again ------------------------------------------------------------------------------------------


def test_nothing_happens_at_the_kill_or_after_it() -> None:
    core = at_start(
        SetTimer("last", 5 * MS - 1), SetTimer("never", 5 * MS), conditions=Conditions(kill_ns=5 * MS)
    )  # fmt: skip
    assert after_start(core) == (Timer(5 * MS - 1, "last"),)
    assert core.next_key() is None
    with pytest.raises(IllegalEvent, match="nothing is due"):
        core.handle_next()


def test_a_frame_due_exactly_at_the_kill_is_the_next_lifes() -> None:
    first = core_of(Puppet(), conditions=Conditions(kill_ns=5 * MS))
    second = core_of(Puppet(), conditions=Conditions(start_ns=5 * MS))
    for due in (0, 5 * MS - 1, 5 * MS, 5 * MS + 1):
        assert (first.owns(due), second.owns(due)) == (due < 5 * MS, due >= 5 * MS)
    second.offer(arrival(5 * MS, Request(1)))
    run(second, NS)
    assert second.state == (Started(5 * MS), Received(5 * MS, Request(1), "peer"))


def test_who_is_killed_while_it_stands_still_never_goes_on() -> None:
    conditions = Conditions(kill_ns=5 * MS, freezes=((2 * MS, 5 * MS),))
    assert after_start(at_start(SetTimer("a", 3 * MS), conditions=conditions)) == ()


def test_the_next_life_is_given_what_was_kept_last() -> None:
    core = core_of(
        script({START: (Store(b"one"), SetTimer("a", MS)), Timer(MS, "a"): (Store(b"two"),)}),
        conditions=Conditions(kill_ns=5 * MS),
    )
    outputs = run(core, NS)
    assert [o.effect for o in outputs if isinstance(o, Told)] == [Store(b"one"), Store(b"two")]
    assert core.record(NS)["stored"] == b"two"
    heir = core_of(Puppet(), conditions=Conditions(start_ns=7 * MS))
    heir.inherit(b"two")
    run(heir, NS)
    assert heir.state == (Started(7 * MS, b"two"),)
    assert heir.record(NS)["stored"] == b"two"  # and so it goes on to the life after, unless it keeps something else


def test_what_was_kept_by_mistake_is_not_kept() -> None:
    """It kept something at 5 ms; then a call of 2 ms turns up, after which it would not have."""
    call = Received(2 * MS, Request(1), "peer")
    core = core_of(
        script({
            START: (Store(b"right"), SetTimer("a", 5 * MS)), Timer(5 * MS, "a"): (Store(b"wrong"),),
            call: (CancelTimer("a"),),
        })
    )  # fmt: skip
    run(core, NS)
    assert core.record(NS)["stored"] == b"wrong"
    core.offer(arrival(2 * MS, Request(1)))
    caught_up(core)
    assert core.record(NS)["stored"] == b"right"


# --- a clock that jumps -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by", [500 * MS, -500 * MS, 1, -1])
def test_pending_timers_fire_when_they_would_have_and_the_clock_shows_another_time(by: int) -> None:
    core = at_start(SetTimer("a", 5 * MS), conditions=Conditions(jumps=((2 * MS, by),)))
    core.offer(arrival(3 * MS, Request(1)))
    run(core, 4 * MS)
    assert core.next_key() == (5 * MS, RANK_TIMER, 5 * MS, "a")
    assert after_start(core) == (Received(3 * MS + by, Request(1), "peer"), Timer(5 * MS + by, "a"))


def test_a_timer_set_after_the_jump_goes_by_the_new_time() -> None:
    """Half a second ahead since 2 ms: what is set for 600 ms then is due at 100 ms."""
    call = Received(502 * MS, Request(1), "peer")
    core = core_of(script({call: (SetTimer("a", 600 * MS),)}), conditions=Conditions(jumps=((2 * MS, 500 * MS),)))
    core.offer(arrival(2 * MS, Request(1)))  # of the very instant: the jump comes first
    run(core, 2 * MS)
    assert core.next_key() == (100 * MS, RANK_TIMER, 100 * MS, "a")
    assert after_start(core) == (call, Timer(600 * MS, "a"))


def test_jumps_add_up_on_a_clock_that_drifts() -> None:
    """Of double speed: at true 9 ms it shows 18 ms, and 3 ms for both jumps; the timer of local 10 ms is of true 5."""
    jumps = ((2 * MS, 4 * MS), (6 * MS, -MS))
    core = at_start(SetTimer("a", 10 * MS), conditions=Conditions(jumps=jumps), clock=Clock(0, NS))
    core.offer(arrival(9 * MS, Request(1)))
    assert after_start(core) == (Timer(14 * MS, "a"), Received(21 * MS, Request(1), "peer"))


def test_a_jump_makes_no_event_of_its_roles() -> None:
    core = core_of(Puppet(), conditions=Conditions(jumps=((2 * MS, 5), (3 * MS, 5))))
    assert after_start(core) == ()
    assert core.next_key() is None


def test_a_timer_whose_clock_jumps_while_it_stands_still() -> None:
    core = at_start(
        SetTimer("a", 3 * MS), conditions=Conditions(freezes=((2 * MS, 5 * MS),), jumps=((4 * MS, 90 * MS),))
    )
    assert after_start(core) == (Timer(95 * MS, "a"),)


# --- all of it is undone where a frame turns up late ------------------------------------------------------------------


def test_a_frame_from_before_a_jump_is_put_before_it() -> None:
    core = at_start(SetTimer("a", 9 * MS), conditions=Conditions(jumps=((5 * MS, NS),)))
    run(core, NS)
    for t in (4, 6):
        core.offer(arrival(t * MS, Request(t)))
    caught_up(core)
    assert core.state[1:] == (
        Received(4 * MS, Request(4), "peer"), Received(NS + 6 * MS, Request(6), "peer"), Timer(NS + 9 * MS, "a")
    )  # fmt: skip
    assert core.life.clock == Clock(NS)


def test_a_frame_from_while_it_stood_still_is_counted_and_changes_nothing() -> None:
    core = at_start(SetTimer("a", 3 * MS), conditions=Conditions(freezes=((2 * MS, 5 * MS),)))
    run(core, NS)
    core.offer(arrival(4 * MS, Request(1)))
    assert caught_up(core) == []
    assert core.state == (START, Timer(5 * MS, "a"))
    assert core.tally == {"frozen": 1}


def test_a_frame_of_the_end_of_standing_still_is_put_before_the_timers_that_waited() -> None:
    """They had fired; the call that comes late is of that very instant, and before them it cancels none of them."""
    core = core_of(
        script({START: (SetTimer("a", 3 * MS),), Timer(5 * MS, "a"): (Send(Reply(1), "hub"),)}),
        conditions=Conditions(freezes=((2 * MS, 5 * MS),)),
    )
    assert len(frames(run(core, NS))) == 1
    core.offer(arrival(5 * MS, Request(1)))
    assert caught_up(core) == []
    assert core.state == (START, Received(5 * MS, Request(1), "peer"), Timer(5 * MS, "a"))
    assert core.host_late == 0


def test_a_record_counts_up_to_the_end_of_a_life_and_no_further() -> None:
    power = Power(2, 3, 5, 7)
    core = core_of(Puppet(), conditions=Conditions(start_ns=2 * MS, kill_ns=9 * MS, powers={"field": power}))
    assert core.record(NS)["metered_ns"] == 0  # it has not begun
    run(core, 2 * MS)
    assert core.record(4 * MS)["activity"] == {"field": [0, 0, 2 * MS, 0, 0]}
    assert core.record(NS)["activity"] == {"field": [0, 0, 7 * MS, 0, 0]}
    assert core.record(NS)["metered_ns"] == 7 * MS
