"""One radio, one frame at a time: who waits, who is turned away, what is told, and what a wire knows nothing of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import MS, Puppet, arrival, caught_up, core_of, frames, run, script
from tests.toys import Feedback, Reply, Request
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import FREE, Frame, Output, Overflowed, Queued, Sent, TakenBack, Told
from trackfield.link.energy import Power
from trackfield.link.fate import Fate
from trackfield.link.models import make_link
from trackfield.role import NEIGHBOURHOOD, NS, Effect, Event, Received, Send, SetTimer, Started, Timer

START = Started(0)


def slow(frame: Frame) -> Fate:
    """A reply keeps the radio busy for 5 ms, a request for 2 ms, feedback for none; on a wire nothing does."""
    if frame.medium != "field":
        return FREE
    return Fate(None, MS, busy_ns={"reply": 5 * MS, "request": 2 * MS, "feedback": 0}[frame.kind], air_ns=MS)


def radio(*effects: Effect, queue: int = 32, kill_ns: int = NS, power: Power | None = None) -> Core:
    """An engine with a slow radio, whose role asks for these at the start."""
    given_power = {} if power is None else {"powers": {"field": power}}
    conditions = Conditions(kill_ns=kill_ns, queues={"field": queue}, cost=slow, **given_power)
    return core_of(Puppet(lambda event: effects if event == START else ()), conditions=conditions)


def left(outputs: Iterable[Output]) -> list[tuple[int, str, int]]:
    return [(f.sent_ns // MS, f.kind, f.copy) for f in frames(outputs)]


def told(outputs: Iterable[Output]) -> list[object]:
    return [o.effect for o in outputs if isinstance(o, Told)]


# --- waiting ----------------------------------------------------------------------------------------------------------


def test_a_frame_leaves_when_the_one_before_it_is_through() -> None:
    outputs = radio(Send(Reply(1), "a"), Send(Request(1), "b"), Send(Reply(2), NEIGHBOURHOOD)).handle_next()
    assert left(outputs) == [(0, "reply", 0), (5, "request", 0), (7, "reply", 0)]
    assert told(outputs) == [Queued("request", 5 * MS, 5 * MS, 1), Queued("reply", 7 * MS, 7 * MS, 2)]


def test_a_radio_that_is_through_is_free() -> None:
    """Busy until 5 ms: what is sent 1 ns before that waits for it, what is sent at 5 ms does not."""
    for at, leaves in ((5 * MS - 1, 5 * MS), (5 * MS, 5 * MS)):
        core = core_of(
            script({START: (Send(Reply(1), "a"), SetTimer("t", at)), Timer(at, "t"): (Send(Reply(2), "a"),)}),
            conditions=Conditions(cost=slow),
        )
        outputs = run(core, NS)
        assert [f.sent_ns for f in frames(outputs)] == [0, leaves]
        assert told(outputs) == ([] if at == leaves else [Queued("reply", leaves, 1, 1)])


def test_who_waits_is_told_with_its_event_and_before_it_leaves() -> None:
    outputs = radio(Send(Reply(1), "a"), Send(Reply(2), "a")).handle_next()
    assert [type(o) for o in outputs] == [Sent, Told, Sent]
    assert {o.key for o in outputs} == {(0, 0, "start")}


def test_each_of_several_addresses_waits_for_the_one_before() -> None:
    assert left(radio(Send(Reply(1), frozenset("abc"))).handle_next()) == [
        (0, "reply", 0), (5, "reply", 0), (10, "reply", 0)
    ]  # fmt: skip


def test_a_wire_does_not_wait_and_is_not_waited_for() -> None:
    wire = Send(Reply(1), "a", "backbone")
    outputs = radio(wire, Send(Reply(2), "b"), wire, Send(Reply(3), "b"), wire).handle_next()
    assert [(f.medium, f.sent_ns // MS) for f in frames(outputs)] == [
        ("backbone", 0), ("field", 0), ("backbone", 0), ("field", 5), ("backbone", 0)
    ]  # fmt: skip


@pytest.mark.parametrize("model", [{"model": "ideal"}, {"model": "fixed", "loss": 0.5, "delay_ms": 9}])
def test_a_link_that_knows_no_radio_has_no_queue(model: dict[str, object]) -> None:
    link = make_link(model, 1)
    core = core_of(
        Puppet(lambda event: [Send(Reply(i), "a") for i in range(50)]),
        conditions=Conditions(queues={"field": 0}, cost=lambda frame: frame.cost(link)),
    )
    outputs = core.handle_next()
    assert [(f.sent_ns, f.copy) for f in frames(outputs)] == [(0, i) for i in range(50)]
    assert told(outputs) == []


# --- turned away ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("queue", [0, 1, 3])
def test_so_many_may_wait_and_no_more(queue: int) -> None:
    """One is on its way and ``queue`` wait; what comes on top of that never leaves, and is told as it would have."""
    outputs = radio(*(Send(Reply(i), "a") for i in range(6)), queue=queue).handle_next()
    assert len(frames(outputs)) == queue + 1
    away = [effect.frame for effect in told(outputs) if isinstance(effect, Overflowed)]
    assert len(away) == 6 - (queue + 1)
    assert {(f.src, f.to, f.kind, f.sent_ns) for f in away} == {("me", "a", "reply", 0)}


def test_there_is_room_again_as_soon_as_one_is_through() -> None:
    core = core_of(
        script({
            START: (*(Send(Reply(i), "a") for i in range(3)), SetTimer("t", 5 * MS)),
            Timer(5 * MS, "t"): (Send(Reply(7), "a"), Send(Reply(8), "a")),
        }),
        conditions=Conditions(queues={"field": 1}, cost=slow),
    )  # fmt: skip
    outputs = run(core, NS)
    assert left(outputs) == [(0, "reply", 0), (5, "reply", 0), (10, "reply", 0)]
    assert len([effect for effect in told(outputs) if isinstance(effect, Overflowed)]) == 2


def test_who_is_turned_away_pays_nothing() -> None:
    core = radio(*(Send(Reply(i), "a") for i in range(6)), queue=1, power=Power(1, 1, 1, 1))
    core.handle_next()
    assert core.record(NS)["activity"]["field"][0] == 2 * MS


def test_what_would_leave_at_the_kill_or_after_it_never_does() -> None:
    for kill, count in ((10 * MS, 2), (10 * MS + 1, 3)):
        core = radio(*(Send(Reply(i), "a") for i in range(3)), kill_ns=kill, power=Power(1, 1, 1, 1))
        outputs = core.handle_next()
        assert [f.sent_ns for f in frames(outputs)] == [0, 5 * MS, 10 * MS][:count]
        assert len(told(outputs)) == count - 1
        assert core.record(5 * MS)["activity"]["field"][0] == count * MS


# --- none passes for another ------------------------------------------------------------------------------------------


def identities(outputs: Iterable[Output]) -> list[tuple[object, ...]]:
    return [frame.identity for frame in frames(outputs)]


def test_copies_are_counted_by_medium() -> None:
    wire = Send(Feedback(1, 1), "a", "backbone")
    sent = frames(radio(Send(Feedback(1, 1), "a"), wire, Send(Feedback(1, 2), "a"), wire, wire).handle_next())
    assert [(f.medium, f.copy) for f in sent] == [
        ("field", 0), ("backbone", 0), ("field", 1), ("backbone", 1), ("backbone", 2)
    ]  # fmt: skip
    assert len({f.identity for f in sent}) == 5


def test_frames_that_differ_by_medium_alone_are_two() -> None:
    """Whichever comes first, both are heard, that of the wire first, by the name of its medium."""
    air, wire = (arrival(5 * MS, Request(1), medium=medium) for medium in ("field", "backbone"))
    assert air.frame.identity != wire.frame.identity
    assert wire.key < air.key
    for order in ((air, wire), (wire, air)):
        core = core_of(Puppet())
        for one in order:
            core.offer(one)
        assert (run(core, NS), core.tally) == ([], {"delivered": 2})
        assert not core.inversions


def test_two_on_a_wire_at_one_instant_with_one_on_the_radio_between_them() -> None:
    """The one on the radio leaves later, and counts for itself."""
    wire = Send(Reply(1), "a", "backbone")
    outputs = radio(Send(Reply(0), "a"), wire, Send(Reply(2), "a"), wire).handle_next()
    assert left(outputs) == [(0, "reply", 0), (0, "reply", 0), (5, "reply", 0), (0, "reply", 1)]


def test_one_on_a_wire_at_the_instant_for_which_one_waits() -> None:
    """A reply waits from 0 to 5 ms, and at 1 and at 5 ms others go over the wire."""
    wire = Send(Reply(1), "a", "backbone")
    core = core_of(
        script({
            START: (Send(Reply(0), "a"), Send(Reply(2), "a"), SetTimer("1", MS), SetTimer("5", 5 * MS)),
            Timer(MS, "1"): (wire,),
            Timer(5 * MS, "5"): (wire,),
        }),
        conditions=Conditions(cost=slow),
    )  # fmt: skip
    outputs = run(core, NS)
    assert left(outputs) == [(0, "reply", 0), (5, "reply", 0), (1, "reply", 0), (5, "reply", 0)]
    assert len(set(identities(outputs))) == 4


sends = st.lists(
    st.tuples(
        st.integers(0, 12),
        st.sampled_from([Reply(1), Request(1), Feedback(1, 1)]),
        st.sampled_from(["a", "b", NEIGHBOURHOOD]),
        st.sampled_from(["field", "backbone"]),
    ),
    max_size=20,
)


@given(sends, st.integers(0, 4))
def test_whatever_is_sent_each_has_an_identity_and_a_turn(plan: list[tuple[int, object, str, str]], queue: int) -> None:
    """Frames of one radio leave in the order in which they were sent, one at a time; none has another's identity."""

    def react(event: Event) -> list[Effect]:
        if isinstance(event, Started):
            return [SetTimer(f"{i:02}", t * MS) for i, (t, *_) in enumerate(plan)]
        _, message, to, medium = plan[int(event.name)] if isinstance(event, Timer) else plan[0]
        return [Send(message, to, medium)]  # type: ignore[arg-type]

    outputs = run(core_of(Puppet(react), conditions=Conditions(cost=slow, queues={"field": queue})), NS)
    assert len(set(identities(outputs))) == len(identities(outputs))
    on_air = [f for f in frames(outputs) if f.medium == "field"]
    for before, after in pairwise(on_air):
        assert before.sent_ns + slow(before).busy_ns <= after.sent_ns
    away = [effect for effect in told(outputs) if isinstance(effect, Overflowed)]
    assert len(frames(outputs)) + len(away) == len(plan)
    waited = {effect.sent_ns - effect.waited_ns for effect in told(outputs) if isinstance(effect, Queued)}
    assert waited <= {t * MS for t, *_ in plan}
    assert all(effect.ahead <= queue + 1 for effect in told(outputs) if isinstance(effect, Queued))


# --- what is still held back can be taken back ------------------------------------------------------------------------

CALL = Received(2 * MS, Request(1), "peer")
REPORT = {START: (SetTimer("t", 5 * MS),), Timer(5 * MS, "t"): (Send(Reply(1), "hub"),)}


def test_those_that_wait_behind_one_that_came_late_leave_later() -> None:
    """Two requests are answered in their order, and then a third one turns up that was first: all answers move."""
    core = core_of(
        Puppet(lambda event: [Send(Reply(event.message.chain), "hub")] if isinstance(event, Received) else []),
        conditions=Conditions(cost=slow),
    )
    for t in (3, 4):
        core.offer(arrival(t * MS, Request(t)))
    first = frames(run(core, NS))
    assert [f.sent_ns // MS for f in first] == [3, 8]
    core.offer(arrival(2 * MS, Request(2)))
    outputs = caught_up(core)
    assert [f.sent_ns // MS for f in frames(outputs)] == [2, 7, 12]
    assert [o.frame for o in outputs if isinstance(o, TakenBack)] == first
    assert core.host_late == 0


# --- what it costs ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fate", "activity"),
    [
        (Fate(None, MS, busy_ns=9, air_ns=7, ack_air_ns=2), [7, 2, 1000 - 9, 0, 0]),
        (Fate("radio", busy_ns=9, air_ns=7), [7, 0, 1000 - 7, 0, 0]),
        (Fate("radio", attempts=0, busy_ns=9), [0, 0, 1000, 0, 0]),  # it never found the channel free
        (Fate(None, MS), [24 * 10, 0, 1000 - 240, 0, 0]),  # no radio: by the length of the payload
    ],
)
def test_a_sender_pays_for_its_time_on_the_air_and_for_acknowledgements(fate: Fate, activity: list[int]) -> None:
    power = Power(
        1, 1, 1, 1, byte_ns=10, overhead_bytes=24 - len(frames(radio(Send(Reply(1), "a")).handle_next())[0].payload)
    )
    core = core_of(
        Puppet(lambda event: [Send(Reply(1), "a")] if event == START else []),
        conditions=Conditions(powers={"field": power}, cost=lambda frame: fate),
    )
    run(core, 0)
    assert core.record(1000)["activity"] == {"field": activity}


def test_a_hearer_pays_for_hearing_and_for_its_acknowledgement() -> None:
    core = core_of(Puppet(), conditions=Conditions(powers={"field": Power(1, 1, 1, 1)}))
    core.offer(replace(arrival(500, Request(1)), fate=Fate(None, MS, busy_ns=90, air_ns=70, ack_air_ns=20)))
    run(core, NS)
    assert core.record(1000)["activity"] == {"field": [20, 70, 1000 - 90, 0, 0]}
