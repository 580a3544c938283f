"""A process that is several things at once: what each of its roles sees, and what the outside sees of them."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from node.role import Node, Phase
from tests.puppet import Puppet, script
from tests.toys import Reply, Request
from trackfield.host import MAX_HANDED, Host, Hosted
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    PortRead,
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
from trackfield.wire.error import WireError
from trackfield.wire.messages import Doa

START = Started(0)
ASK = Received(5, Request(1), "far")


def host(**roles: Puppet) -> Host:
    return Host(roles, id="me")


def after(hosting: Host, *events: Event) -> tuple[Hosted, tuple[Effect, ...]]:
    """The host's state after these events, and the effects of the last one."""
    state, effects = hosting.begin(), ()
    for event in events:
        state, effects = hosting.handle(state, event)
    return state, effects


# --- what comes in ------------------------------------------------------------------------------------------------


def test_all_roles_start_and_their_effects_come_in_their_order() -> None:
    a, b = script({START: (Note("a"), Note("A"))}), script({START: (Note("b"),)})
    state, effects = after(host(a=a, b=b), START)
    assert state.states == {"a": (START,), "b": (START,)}
    assert effects == (Note("a"), Note("A"), Note("b"))


def test_a_frame_goes_to_the_role_that_consumes_its_kind() -> None:
    """A node that is also a head hears a request, which is the head's business."""
    state, effects = after(
        host(node=script({}, kinds=["reply"]), head=script({ASK: (Note("yes"),)}, kinds=["request"])), ASK
    )
    assert state.states == {"node": (), "head": (ASK,)}
    assert effects == (Note("yes"),)


def test_a_kind_that_two_roles_consume_goes_to_both_in_order() -> None:
    hosting = host(
        a=script({ASK: (Note("a"),)}, kinds=["request", "reply"]),
        b=Puppet(kinds=["reply"]),
        c=script({ASK: (Note("c"),)}, kinds=["request"]),
    )
    state, effects = after(hosting, ASK)
    assert state.states == {"a": (ASK,), "b": (), "c": (ASK,)}
    assert effects == (Note("a"), Note("c"))


def test_a_host_consumes_what_its_roles_consume() -> None:
    assert host(a=Puppet(kinds=["reply"]), b=Puppet(kinds=["request", "reply"])).kinds == {"reply", "request"}
    assert Host({}, id="me").kinds == frozenset()


def test_a_frame_that_no_role_consumes_is_unexpected() -> None:
    state, effects = after(host(a=Puppet(kinds=["reply"])), ASK)
    assert effects == (Ignored("unexpected"),)
    assert state.states == {"a": ()}


def test_a_frame_that_one_of_two_takers_has_a_use_for_is_not_ignored() -> None:
    """To the node an old request is late, but the head answers it: the frame counts as delivered and no more."""
    node, head = script({ASK: (Ignored("late"),)}, kinds=["request"]), script({ASK: (Note("yes"),)}, kinds=["request"])
    for roles in ({"node": node, "head": head}, {"head": head, "node": node}):
        _, effects = after(host(**roles), ASK)
        assert set(effects) == {Note("node ignored a message: late"), Note("yes")}


def test_a_frame_that_all_takers_ignore_is_ignored_once() -> None:
    a, b = (script({ASK: (Ignored(why), Note(why))}, kinds=["request"]) for why in ("late", "repeated"))
    _, effects = after(host(a=a, b=b), ASK)
    assert effects == (Ignored("late"), Note("late"), Note("repeated"))


# --- names of roles in front of things ----------------------------------------------------------------------------


def test_each_role_has_timers_of_its_own() -> None:
    """Node and head both have a timer called step."""
    node = script({START: (SetTimer("step", 5),), Timer(5, "step"): (CancelTimer("nap"), SetTimer("step", 10))})
    hosting = host(node=node, head=script({START: (SetTimer("step", 7),)}))
    state, effects = after(hosting, START)
    assert effects == (SetTimer("node/step", 5), SetTimer("head/step", 7))
    state, effects = hosting.handle(state, Timer(5, "node/step"))
    assert effects == (CancelTimer("node/nap"), SetTimer("node/step", 10))
    state, effects = hosting.handle(state, Timer(7, "head/step"))
    assert state.states == {"node": (START, Timer(5, "step")), "head": (START, Timer(7, "step"))}


def test_each_role_has_ports_of_its_own() -> None:
    answer = PortRead(5, "tty", b"pong")
    hosting = host(a=script({START: (Write("tty", b"ping"),), answer: (Write("tty", b"ok"),)}), b=Puppet())
    state, effects = after(hosting, START)
    assert effects == (Write("a/tty", b"ping"),)
    state, effects = hosting.handle(state, PortRead(5, "a/tty", b"pong"))
    assert effects == (Write("a/tty", b"ok"),)
    assert state.states == {"a": (START, answer), "b": (START,)}


def test_each_role_has_a_lane_of_its_own() -> None:
    _, effects = after(host(node=script({START: (State("awake"), State("low", "battery"))})), START)
    assert effects == (State("awake", "node"), State("low", "node/battery"))


def test_a_host_can_be_hosted() -> None:
    """Timers and lanes carry all the names on the way, and lose them one by one on the way back."""
    role = script({START: (SetTimer("step", 5), State("awake")), Timer(5, "step"): (Note("there"),)})
    hosting = Host({"cluster": Host({"node": role}, id="me")}, id="me")
    state, effects = after(hosting, START)
    assert effects == (SetTimer("cluster/node/step", 5), State("awake", "cluster/node"))
    assert hosting.handle(state, Timer(5, "cluster/node/step"))[1] == (Note("there"),)


@pytest.mark.parametrize(
    "event", [Timer(5, "c/step"), Timer(5, "step"), PortRead(5, "tty", b""), PortRead(5, "c/tty", b"")]
)
def test_what_belongs_to_no_role_is_the_drivers_mistake(event: Event) -> None:
    hosting = host(a=Puppet(), b=Puppet())
    state, _ = after(hosting, START)
    with pytest.raises(IllegalEvent, match="none of a, b"):
        hosting.handle(state, event)


def test_estimates_and_notes_pass_as_they_are() -> None:
    said = (Publish(TrackPoint("t", "bus", NS, "waiting", step=1)), Note("hello"))
    assert after(host(a=script({START: said})), START)[1] == said


@pytest.mark.parametrize(("names", "id"), [(["a/b"], "me"), ([""], "me"), (["a"], "*"), (["a"], "")])
def test_names_must_be_ids(names: list[str], id: str) -> None:
    with pytest.raises(WireError):
        Host({name: Puppet() for name in names}, id=id)


# --- one radio ----------------------------------------------------------------------------------------------------


def switched(*switches: tuple[str, Radio]) -> list[Effect]:
    """What a host of a and b asks for as they switch the radio, one after the other."""
    roles = {
        name: script({Timer(i, "t"): (radio,) for i, (who, radio) in enumerate(switches) if who == name})
        for name in "ab"
    }
    hosting = host(**roles)
    state, effects = hosting.begin(), list[Effect]()
    for i, (who, _) in enumerate(switches):
        state, asked = hosting.handle(state, Timer(i, f"{who}/t"))
        effects += asked or [None]
    return effects


def test_the_radio_is_on_while_any_role_wants_it_on() -> None:
    """The node goes to sleep, the head does not; only when both have no use for the radio it goes off."""
    off, on = Radio(False), Radio(True)
    assert switched(("a", off), ("b", off), ("a", on), ("b", on), ("a", off), ("b", off)) == [
        None, off, on, None, None, off
    ]  # fmt: skip


def test_wishes_are_not_counted_twice() -> None:
    off, on = Radio(False), Radio(True)
    assert switched(("a", off), ("a", off), ("b", off), ("a", on), ("a", on), ("a", off)) == [
        None, None, off, on, None, off
    ]  # fmt: skip


def test_each_medium_is_switched_for_itself() -> None:
    off, wire = Radio(False), Radio(False, "backbone")
    assert switched(("a", off), ("b", wire), ("b", off), ("a", wire)) == [None, None, off, wire]


def test_a_sleeping_node_that_is_a_head_keeps_its_radio_on() -> None:
    node = Node(step_ns=NS, threshold_db=50, centre="me")
    hosting = Host({"node": node, "head": Puppet(kinds=["doa"])}, id="me")
    state, effects = after(hosting, START)
    assert state.states["node"].phase is Phase.ASLEEP
    assert effects == (State("asleep", "node"), Sample("wake-up"))


# --- sensors ------------------------------------------------------------------------------------------------------


def test_a_reading_goes_to_who_asked_and_before_anything_else() -> None:
    """Both roles read the microphone; each gets its answer at once, then the rest of what it asked for follows."""
    hosting = host(
        a=script({START: (Note("a1"), Sample("sound"), Note("a2")), Sampled(0, "sound", 60): (Note("a: 60"),)}),
        b=script({START: (Sample("sound"), Note("b2")), Sampled(0, "sound", 61): (Note("b: 61"),)}),
    )
    state, effects = after(hosting, START)
    assert effects == (Note("a1"), Sample("sound"))
    state, effects = hosting.handle(state, Sampled(0, "sound", 60))
    assert effects == (Note("a: 60"), Note("a2"), Sample("sound"))
    state, effects = hosting.handle(state, Sampled(0, "sound", 61))
    assert effects == (Note("b: 61"), Note("b2"))
    assert state == Hosted({"a": (START, Sampled(0, "sound", 60)), "b": (START, Sampled(0, "sound", 61))})


def test_a_reading_that_asks_for_another_one() -> None:
    hosting = host(a=script({START: (Sample("sound"), Note("end")), Sampled(0, "sound", 1): (Sample("light"),)}))
    state, _ = after(hosting, START)
    state, effects = hosting.handle(state, Sampled(0, "sound", 1))
    assert effects == (Sample("light"),)
    assert hosting.handle(state, Sampled(0, "light", 2))[1] == (Note("end"),)


def test_a_hosted_host_reads_sensors_too() -> None:
    role = script({START: (Sample("sound"), Note("end")), Sampled(0, "sound", 1): (Note("heard"),)})
    hosting = Host({"x": Host({"a": role}, id="me"), "y": Puppet()}, id="me")
    state, effects = after(hosting, START)
    assert effects == (Sample("sound"),)
    assert hosting.handle(state, Sampled(0, "sound", 1))[1] == (Note("heard"), Note("end"))


@pytest.mark.parametrize("event", [START, ASK, Timer(0, "a/t"), PortRead(0, "a/tty", b""), Sampled(0, "light", 1)])
def test_nothing_may_come_before_the_answer(event: Event) -> None:
    hosting = host(a=script({START: (Sample("sound"),)}, kinds=["request"]))
    state, _ = after(hosting, START)
    with pytest.raises(IllegalEvent, match="sound"):
        hosting.handle(state, event)


def test_an_answer_that_nobody_asked_for_is_the_drivers_mistake() -> None:
    hosting = host(a=Puppet())
    state, _ = after(hosting, START)
    with pytest.raises(IllegalEvent):
        hosting.handle(state, Sampled(0, "sound", 1))


# --- messages between its roles -----------------------------------------------------------------------------------


def test_a_message_to_the_own_id_is_handed_over_at_the_same_instant() -> None:
    """The node reports to its head, which is itself: nothing goes on the air."""
    report = Send(Request(7), "me")
    hosting = host(node=script({Timer(5, "t"): (report,)}), head=Puppet(kinds=["request"]))
    state, effects = after(hosting, START, Timer(5, "node/t"))
    assert effects == ()
    assert state.states["head"] == (START, Received(5, Request(7), "me"))


def test_what_is_handed_over_has_the_resolution_of_the_wire() -> None:
    report = Send(Doa(1, 12.3456, 55.5555), "me")
    state, _ = after(host(node=script({START: (report,)}), head=Puppet(kinds=["doa"])), START)
    assert state.states["head"][1] == Received(0, Doa(1, 12.35, 55.56), "me")


def test_what_cannot_be_sent_cannot_be_handed_over() -> None:
    hosting = host(node=script({START: (Send(Doa(1, float("nan"), 50.0), "me"),)}), head=Puppet(kinds=["doa"]))
    with pytest.raises(WireError, match="range"):
        after(hosting, START)


def test_it_is_handed_over_whether_or_not_the_radio_is_on() -> None:
    hosting = host(a=script({START: (Radio(False), Send(Request(1), "me"))}), b=Puppet(kinds=["request"]))
    assert len(after(hosting, START)[0].states["b"]) == 2


def test_a_role_does_not_get_its_own_message() -> None:
    hosting = host(a=script({START: (Send(Request(1), "me"),)}, kinds=["request"]), b=Puppet(kinds=["request"]))
    state, effects = after(hosting, START)
    assert (len(state.states["a"]), len(state.states["b"]), effects) == (1, 2, ())


def test_all_others_that_consume_the_kind_get_it() -> None:
    takers = {name: Puppet(kinds=["request"]) for name in ("b", "c")}
    hosting = host(a=script({START: (Send(Request(1), "me"),)}), d=Puppet(kinds=["reply"]), **takers)
    state, _ = after(hosting, START)
    assert {name: len(log) for name, log in state.states.items()} == {"a": 1, "b": 2, "c": 2, "d": 1}


def test_what_no_other_role_consumes_is_sent_like_any_other_message() -> None:
    send = Send(Request(1), "me", "backbone")
    assert after(host(a=script({START: (send,)}, kinds=["request"]), b=Puppet()), START)[1] == (send,)


def test_of_several_addressees_the_others_are_sent_to() -> None:
    hosting = host(
        a=script({START: (Send(Request(1), frozenset({"me", "x", "y"}), "backbone"),)}), b=Puppet(kinds=["request"])
    )
    state, effects = after(hosting, START)
    assert effects == (Send(Request(1), frozenset({"x", "y"}), "backbone"),)
    assert state.states["b"] == (START, Received(0, Request(1), "me"))


def test_of_the_own_id_alone_nothing_is_sent() -> None:
    hosting = host(a=script({START: (Send(Request(1), frozenset({"me"})),)}), b=Puppet(kinds=["request"]))
    state, effects = after(hosting, START)
    assert (len(state.states["b"]), effects) == (2, ())


@pytest.mark.parametrize("to", [NEIGHBOURHOOD, "x", frozenset({"x", "y"})])
def test_what_goes_elsewhere_is_not_handed_over(to: str | frozenset[str]) -> None:
    """Not even a broadcast: a radio does not hear itself."""
    send = Send(Request(1), to)
    state, effects = after(host(a=script({START: (send,)}), b=Puppet(kinds=["request"])), START)
    assert effects == (send,)
    assert state.states["b"] == (START,)


def test_messages_are_handed_over_after_all_else_that_the_event_causes() -> None:
    """On the radio a frame takes a while, and a role that starts first must not reach one that has not started yet."""
    hosting = host(
        a=script({START: (Send(Request(1), "me"), Sample("sound")), Sampled(0, "sound", 1): (Note("heard"),)}),
        b=script({Received(0, Request(1), "me"): (Note("asked"),), START: (Note("started"),)}, kinds=["request"]),
    )
    state, effects = after(hosting, START, Sampled(0, "sound", 1))
    assert state.states["b"] == (START, Received(0, Request(1), "me"))
    assert effects == (Note("heard"), Note("started"), Note("asked"))


def test_a_reply_is_handed_back() -> None:
    """Messages come in the order in which they were sent, each after all that the one before it caused."""
    asked, replied = Received(0, Request(1), "me"), Received(0, Reply(2), "me")
    hosting = host(
        a=script(
            {START: (Send(Request(1), "me"), Send(Request(3), "me")), replied: (Note("thanks"),)}, kinds=["reply"]
        ),
        b=script({asked: (Send(Reply(2), "me"), Note("reply"))}, kinds=["request"]),
    )
    state, effects = after(hosting, START)
    assert effects == (Note("reply"), Note("thanks"))
    assert state.states == {"a": (START, replied), "b": (START, asked, Received(0, Request(3), "me"))}


def test_the_frame_in_hand_is_not_ignored_because_a_message_handed_over_is() -> None:
    """The head passes on what it heard; the node has no use for it, but the head's frame was of use."""
    hosting = host(
        head=script({ASK: (Sample("sound"), Send(Reply(1), "me"))}, kinds=["request"]),
        node=script({Received(5, Reply(1), "me"): (Ignored("late"),)}, kinds=["reply"]),
    )
    _, effects = after(hosting, ASK, Sampled(5, "sound", 1))
    assert effects == (Note("node ignored a message: late"),)


def test_an_inner_host_passes_on_what_only_its_neighbour_consumes() -> None:
    inner = Host({"a": script({START: (Send(Request(1), "me"),)})}, id="me")
    state, effects = after(Host({"x": inner, "y": Puppet(kinds=["request"])}, id="me"), START)
    assert (len(state.states["y"]), effects) == (2, ())


def echoing(limit: int) -> tuple[Host, list[int]]:
    """Two roles that return each other's messages until ``limit`` of them were handed over; their count."""
    count = [0]

    def back(event: Event) -> Iterable[Effect]:
        if isinstance(event, Received):
            count[0] += 1
        return (Send(Request(1), "me"),) if isinstance(event, Timer | Received) and count[0] < limit else ()

    return host(a=Puppet(back, kinds=["request"]), b=Puppet(back, kinds=["request"])), count


def test_roles_may_talk_for_long_but_not_forever() -> None:
    hosting, count = echoing(MAX_HANDED)
    after(hosting, START, Timer(0, "a/t"))
    assert count == [MAX_HANDED]
    hosting, _ = echoing(MAX_HANDED + 1)
    state, _ = after(hosting, START)
    with pytest.raises(IllegalEvent, match="me: over 1000 messages"):
        hosting.handle(state, Timer(0, "a/t"))
