"""A process that is several things at once: what each of its roles sees, and what the outside sees of them."""

from __future__ import annotations

from collections.abc import Iterable

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node.role import Node, Phase
from tests.puppet import Puppet, script
from tests.toys import Reply, Request
from trackfield.host import MAX_HANDED, Host, Hosted, counts_of
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    ClockSet,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
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
    Store,
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


@pytest.mark.parametrize(
    ("node", "head", "said"),
    [
        ((Late(),), (Late(),), (Late(),)),
        ((Late(),), (Note("in time"),), (Note("in time"),)),
        ((Ignored("repeated"),), (Late(),), (Late(),)),
        ((Late(), Note("used")), (Ignored("repeated"),), (Late(), Note("used"))),
    ],
)
def test_a_frame_is_late_once_and_only_if_nobody_used_it_in_time(
    node: tuple[Effect, ...], head: tuple[Effect, ...], said: tuple[Effect, ...]
) -> None:
    hosting = host(node=script({ASK: node}, kinds=["request"]), head=script({ASK: head}, kinds=["request"]))
    assert after(hosting, ASK)[1] == said


def test_a_message_that_is_handed_over_is_no_late_frame() -> None:
    """The frame in hand came in time."""
    head = script({ASK: (Send(Reply(1), "me"),)}, kinds=["request"])
    node = script({Received(5, Reply(1), "me"): (Late(), Note("used"))}, kinds=["reply"])
    assert after(host(head=head, node=node), ASK)[1] == (Note("used"),)


def test_the_frames_of_each_role_are_counted_and_what_is_handed_over_is_none() -> None:
    """Delivered to both of those that consume requests, of which one ignores them, the other uses them though late; an
    unexpected frame is nobody's.
    """
    head = script({ASK: (Late(), Send(Reply(1), "me"))}, kinds=["request"])
    late = (Ignored("late"),)
    node = script({ASK: late, Received(5, Reply(1), "me"): late}, kinds=["request", "reply"])
    state, _ = after(host(head=head, node=node, deaf=Puppet()), START, ASK, ASK, Received(6, Doa(1, 2.0, 3.0), "far"))
    assert counts_of(state) == {"head": {"delivered": 2, "ignored": 0}, "node": {"delivered": 2, "ignored": 2}}


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


# --- what outlives the process ------------------------------------------------------------------------------------


def storing(data: bytes) -> Puppet:
    """Stores this when its timer rings."""
    return script({Timer(1, "t"): (Store(data),)})


def starts(state: Hosted) -> dict[str, bytes]:
    """What each role was given at its start."""
    return {name: log[0].stored for name, log in state.states.items()}


def stored_by(*effects: Effect) -> bytes:
    """The bytes that the driver has to keep after these."""
    return [effect.data for effect in effects if isinstance(effect, Store)][-1]


def test_each_role_gets_back_what_it_stored() -> None:
    hosting = host(a=storing(b"mine"), b=storing(b"yours"), c=Puppet())
    state, first = after(hosting, START, Timer(1, "a/t"))
    _, second = hosting.handle(state, Timer(1, "b/t"))
    assert starts(after(hosting, Started(9, stored_by(*first)))[0]) == {"a": b"mine", "b": b"", "c": b""}
    assert starts(after(hosting, Started(9, stored_by(*second)))[0]) == {"a": b"mine", "b": b"yours", "c": b""}


def test_what_a_role_stored_is_not_lost_in_a_life_in_which_only_others_store() -> None:
    hosting = host(a=storing(b"mine"), b=storing(b"yours"))
    _, first = after(hosting, START, Timer(1, "a/t"))
    _, second = after(hosting, Started(0, stored_by(*first)), Timer(1, "b/t"))
    assert starts(after(hosting, Started(0, stored_by(*second)))[0]) == {"a": b"mine", "b": b"yours"}


def test_a_hosted_host_stores_too() -> None:
    hosting = Host({"x": host(a=storing(b"mine"), b=Puppet()), "y": Puppet()}, id="me")
    _, effects = after(hosting, START, Timer(1, "x/a/t"))
    state, _ = after(hosting, Started(9, stored_by(*effects)))
    assert starts(state.states["x"]) == {"a": b"mine", "b": b""}


@pytest.mark.parametrize(
    ("stored", "a"),
    [
        (b"", b""),
        (b"\xc1", b""),
        (msgpack.packb([1, 2]), b""),
        (msgpack.packb({"a": 3, "b": b"yours"}), b""),
        (msgpack.packb({"a": "text"}), b""),
        (msgpack.packb({"a": b"mine", "c": b"nobody's"}), b"mine"),
        (msgpack.packb({1: b"x", "a": b"mine"}), b""),
        (msgpack.packb({"a": b"mine"}) + b"x", b""),
        (b"\x91" * 5000, b""),
        (b"\xd6\xff" + bytes(3), b""),
    ],
)
def test_bytes_that_no_host_stored_are_none_of_a_roles(stored: bytes, a: bytes) -> None:
    assert starts(after(host(a=Puppet()), Started(0, stored))[0]) == {"a": a}


@given(
    st.binary(max_size=200)
    | st.dictionaries(st.sampled_from(["a", "b", "c", 1, b"a"]), st.binary() | st.integers(0, 9)).map(msgpack.packb)
)
def test_whatever_was_stored_a_life_begins(stored: bytes) -> None:
    given = starts(after(host(a=Puppet(), b=Puppet()), Started(0, stored))[0])
    assert {type(data) for data in given.values()} == {bytes}


# --- one clock ----------------------------------------------------------------------------------------------------

RING = Timer(5, "sync")
SET = ClockSet(5, -3)


def test_a_correction_goes_to_the_others_that_follow_and_is_told_once() -> None:
    """After all else that the event causes, as a message would; the role that found it knows it."""
    found = {RING: (Corrected(-3), Note("a"), Sample("sound")), Sampled(5, "sound", 1): (Note("heard"),)}
    a = script(found, follows=True)
    b = script({SET: (SetTimer("step", 7), Note("b"))}, follows=True)
    hosting = host(c=script({SET: (Note("c"),)}, follows=True), a=a, b=b, d=Puppet())
    state, first = after(hosting, START, Timer(5, "a/sync"))
    state, second = hosting.handle(state, Sampled(5, "sound", 1))
    assert first == (Corrected(-3), Note("a"), Sample("sound"))
    assert second == (Note("heard"), Note("c"), SetTimer("b/step", 7), Note("b"))
    assert {name: SET in log for name, log in state.states.items()} == {"a": False, "b": True, "c": True, "d": False}


def test_corrections_and_messages_keep_their_order() -> None:
    asked = Received(5, Request(1), "me")
    a = script({RING: (Send(Request(1), "me"), Corrected(-3), Send(Request(1), "me"))})
    state, _ = after(host(a=a, b=Puppet(kinds=["request"], follows=True)), START, Timer(5, "a/sync"))
    assert state.states["b"] == (START, asked, SET, asked)


@pytest.mark.parametrize("where", ["inside", "outside"])
def test_a_correction_comes_into_a_hosted_host_and_out_of_it(where: str) -> None:
    found, used = script({RING: (Corrected(-3),)}), Puppet(follows=True)
    inner = host(a=found if where == "inside" else Puppet(), b=Puppet(follows=True))
    hosting = Host({"x": inner, "y": used if where == "inside" else found}, id="me")
    state, effects = after(hosting, START, Timer(5, "x/a/sync" if where == "inside" else "y/sync"))
    assert effects == (Corrected(-3),)
    assert SET in state.states["x"].states["b"]
    assert (SET in state.states["y"]) is (where == "inside")
    assert (inner.follows, host(a=found).follows) == (True, False)
