"""Orders to a role: what is done, what is refused and how it is answered, what stop and start mean."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.puppet import MS, Puppet, script
from tests.toys import Request
from trackfield.host import Host
from trackfield.protocols.managed import LANE, MOST_REFUSED, REFUSAL_NS, Managed, Wrapped
from trackfield.protocols.orders import (
    OK,
    REFUSED,
    TRIES,
    UNKNOWN,
    answers,
    following,
    is_newer,
    order_for,
    reply_to,
)
from trackfield.role import (
    NS,
    CancelTimer,
    ClockSet,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    PortRead,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Tell,
    Timer,
)
from trackfield.wire.outside import ITEMS, RUNNING, START, STATUS, STOP, STOPPED, VERBS, Order, OrderReply

KEY = "00112233445566778899aabbccddeeff"
SECRET = bytes.fromhex(KEY)
ID, OPERATOR = "video", "system"


def managed(role: Any, **changes: Any) -> Managed:
    return Managed(role, **{"id": ID, "key": KEY, "operator": OPERATOR, "media": ("backbone", "serial"), **changes})


def ordered(now: int, number: int, verb: int, sender: str = OPERATOR) -> Received:
    return Received(now, order_for(ID, number, verb, SECRET), sender, "backbone")


def after(role: Managed, *events: Event, state: Wrapped | None = None) -> tuple[Wrapped, tuple[Effect, ...]]:
    """The state after these events, and the effects of the last."""
    state, effects = state or role.begin(), tuple[Effect, ...]()
    for event in events:
        state, effects = role.handle(state, event)
    return state, effects


def replies(effects: Iterable[Effect]) -> list[OrderReply]:
    return [one.message for one in effects if isinstance(one, Send)]


def stored(effects: Iterable[Effect]) -> bytes:
    return [one.data for one in effects if isinstance(one, Store)][-1]


# --- what an order does -------------------------------------------------------------------------------------------


def test_status_is_answered_and_the_role_does_not_notice() -> None:
    asked = ordered(5, 1, STATUS)
    state, effects = after(managed(Puppet()), Started(0), asked)
    (reply,) = replies(effects)
    assert (reply.number, reply.answer, reply.state, reply.refused) == (1, OK, RUNNING, 0)
    assert answers(reply, asked.message, ID, OPERATOR, SECRET)
    assert [(one.to, one.medium) for one in effects if isinstance(one, Send)] == [(OPERATOR, "backbone")]
    assert state.role == (Started(0),)


def test_stop_takes_timers_receivers_and_state() -> None:
    begin = (SetTimer("b", 9), SetTimer("a", 7), SetTimer("c", 8), CancelTimer("c"), State("busy"), State("up", "lane"))
    role = managed(script({Started(0): begin, Timer(7, "a"): ()}))
    state, effects = after(role, Started(0), Timer(7, "a"), ordered(8, 1, STOP))
    assert [one for one in effects if not isinstance(one, Store | Send)] == [
        CancelTimer("b"),
        Radio(False, "serial"),
        Radio(True, "backbone"),
        State("stopped", ""),
        State("stopped", "lane"),
        State("stopped", LANE),
    ]
    assert [(one.answer, one.state) for one in replies(effects)] == [(OK, STOPPED)]
    assert (state.role, state.runs, state.timers) == ((), False, frozenset())


def test_start_begins_a_new_life_with_what_was_stored_last() -> None:
    role = managed(script({Started(0): (Store(b"first"), Store(b"last"), SetTimer("t", 3))}))
    state, effects = after(role, Started(0), ordered(1, 1, STOP), ordered(2, 2, START))
    assert state.role == (Started(2, b"last"),)
    assert [(one.answer, one.state) for one in replies(effects)] == [(OK, RUNNING)]
    radios = [one for one in effects if isinstance(one, Radio)]
    assert radios == [Radio(True, "serial"), Radio(True, "backbone")]
    assert State("running", LANE) in effects


def test_what_the_new_life_asks_of_a_receiver_comes_after_it_was_switched_on() -> None:
    role = managed(script({Started(2): (Radio(False, "serial"),)}))
    _, effects = after(role, Started(0), ordered(1, 1, STOP), ordered(2, 2, START))
    assert [one.on for one in effects if isinstance(one, Radio) and one.medium == "serial"] == [True, False]


@pytest.mark.parametrize(("verb", "runs", "state"), [(START, True, RUNNING), (STOP, False, STOPPED)])
def test_what_is_so_already_is_ok_and_changes_nothing(verb: int, runs: bool, state: int) -> None:
    role = managed(Puppet())
    before, _ = after(role, Started(0), *([] if runs else [ordered(1, 1, STOP)]))
    now, effects = after(role, ordered(2, 2, verb), state=before)
    assert [(one.answer, one.state) for one in replies(effects)] == [(OK, state)]
    assert now.role == before.role
    assert not [one for one in effects if isinstance(one, State | Radio | CancelTimer)]


def test_nothing_reaches_a_stopped_role() -> None:
    role = managed(Puppet(kinds=["request"]))
    state, _ = after(role, Started(0), ordered(1, 1, STOP))
    for event in (Timer(2, "t"), PortRead(2, "p", b"x"), ClockSet(2, 5), Sampled(2, "sound", 1.0)):
        assert after(role, event, state=state) == (state, ())
    assert after(role, Received(2, Request(1), "far"), state=state) == (state, (Ignored("stopped"),))


def test_a_verb_that_nobody_knows() -> None:
    state, effects = after(managed(Puppet()), Started(0), ordered(1, 1, len(VERBS)))
    assert [(one.answer, one.state, one.refused) for one in replies(effects)] == [(UNKNOWN, RUNNING, 1)]
    assert Tell("refused order", (OPERATOR, "unknown verb")) in effects
    assert Ignored("refused order") in effects
    assert state.role == (Started(0),)


# --- numbers ------------------------------------------------------------------------------------------------------


def test_a_repeated_order_is_answered_again_and_done_once() -> None:
    """As often as it may be sent again; a start in between would have come by another number."""
    role = managed(Puppet())
    state, first = after(role, Started(0), ordered(1, 1, STOP), ordered(2, 2, START))
    for _ in range(TRIES - 1):
        state, again = after(role, ordered(3, 2, START), state=state)
        assert replies(again) == replies(first)
        assert state.role == (Started(2),)
    state, effects = after(role, ordered(4, 2, START), state=state)
    assert Tell("refused order", (OPERATOR, "repeated too often")) in effects
    assert [one.answer for one in replies(effects)] == [REFUSED]


def test_each_number_has_its_own_repetitions() -> None:
    role = managed(Puppet())
    state, _ = after(role, Started(0), *[ordered(1, 1, STATUS)] * TRIES)
    _, effects = after(role, ordered(2, 2, STATUS), ordered(3, 2, STATUS), state=state)
    assert [one.answer for one in replies(effects)] == [OK]


@given(last=st.integers(0, ITEMS - 1), ahead=st.integers(1, ITEMS - 1))
def test_numbers_are_cyclic(last: int, ahead: int) -> None:
    number = (last + ahead) % ITEMS
    role = managed(Puppet())
    state, effects = after(role, Started(0), ordered(1, last, STATUS), ordered(2, number, STOP))
    assert is_newer(number, last) == (ahead < ITEMS // 2)
    assert state.runs == (ahead >= ITEMS // 2)
    assert [one.answer for one in replies(effects)] == [OK if ahead < ITEMS // 2 else REFUSED]


@given(st.integers(0, ITEMS - 1))
def test_the_next_number_is_newer_and_never_none(number: int) -> None:
    assert following(number) != 0
    assert is_newer(following(number), number)


# --- what is refused ----------------------------------------------------------------------------------------------

GENUINE = order_for(ID, 7, STOP, SECRET)
FOREIGN = {
    "authentication": replace(GENUINE, mac=bytes(8)),
    "none": replace(GENUINE, mac=b""),
    "half": replace(GENUINE, mac=GENUINE.mac[:4]),
    "number": replace(GENUINE, number=8),
    "verb": replace(GENUINE, verb=START),
    "process": order_for("vide", 7, STOP, SECRET),
    "key": order_for(ID, 7, STOP, bytes(16)),
}


@pytest.mark.parametrize("case", list(FOREIGN))
def test_an_order_that_was_not_made_with_the_key_for_this_process(case: str) -> None:
    came = Received(1, FOREIGN[case], OPERATOR, "backbone")
    state, effects = after(managed(Puppet()), Started(0), came)
    assert state.runs
    assert state.last is None
    (reply,) = replies(effects)
    assert (reply.answer, reply.refused) == (REFUSED, 1)
    assert effects[1:] == (Tell("refused order", (OPERATOR, "wrong authentication")), Ignored("refused order"))


def test_a_genuine_order_of_somebody_else_is_refused() -> None:
    """It was overheard; the operator's own, which comes later, is done."""
    role = managed(Puppet(), near=("control",))
    state, effects = after(role, Started(0), Received(1, GENUINE, "control", "backbone"))
    assert state.runs
    assert Tell("refused order", ("control", "wrong sender")) in effects
    assert [one.to for one in effects if isinstance(one, Send)] == ["control"]
    state, _ = after(role, Received(2, GENUINE, OPERATOR, "backbone"), state=state)
    assert not state.runs


def test_orders_come_by_the_backbone_alone() -> None:
    state, effects = after(managed(Puppet()), Started(0), Received(1, GENUINE, OPERATOR, "serial"))
    assert state.runs
    assert effects == (Tell("refused order", (OPERATOR, "wrong medium")), Ignored("refused order"))


def test_an_order_of_before_is_refused() -> None:
    role = managed(Puppet())
    state, _ = after(role, Started(0), ordered(1, 5, STOP), ordered(2, 6, START))
    for number, verb in ((5, STOP), (6, STOP)):
        now, effects = after(role, ordered(3, number, verb), state=state)
        assert now.runs
        assert Tell("refused order", (OPERATOR, "old number")) in effects


def test_who_has_no_address_is_not_answered_and_shown_as_harmless_text() -> None:
    came = Received(1, replace(GENUINE, mac=bytes(8)), "\x1b[2Jx", "backbone")
    _, effects = after(managed(Puppet()), Started(0), came)
    assert effects == (Tell("refused order", ("\\x1b[2Jx", "wrong authentication")), Ignored("refused order"))


def test_a_stranger_cannot_make_it_send_without_end_nor_keep_orders_from_it() -> None:
    """A hundred orders a second for ten seconds: one answer a second; an order among them is done at once."""
    role, sent = managed(Puppet(), near=("control",)), list[OrderReply]()
    state, _ = after(role, Started(0))
    forged = replace(GENUINE, mac=bytes(8))
    for i in range(1000):
        state, effects = after(role, Received(i * 10 * MS, forged, "control", "backbone"), state=state)
        sent += replies(effects)
    assert len(sent) == 10 * NS // REFUSAL_NS
    assert state.refused == 1000
    state, effects = after(role, ordered(10 * NS, 1, STOP), state=state)
    assert [(one.answer, one.refused) for one in replies(effects)] == [(OK, 1000)]


def test_refusals_are_answered_though_the_clock_jumped_back() -> None:
    role, forged = managed(Puppet()), replace(GENUINE, mac=bytes(8))
    state, _ = after(role, Started(0), Received(100 * NS, forged, OPERATOR, "backbone"))
    _, effects = after(role, Received(NS, forged, OPERATOR, "backbone"), state=state)
    assert len(replies(effects)) == 1


def test_the_count_of_refused_orders_ends_where_its_field_does() -> None:
    role = managed(Puppet())
    state = replace(role.begin(), refused=MOST_REFUSED)
    state, effects = after(role, Started(0), Received(1, FOREIGN["key"], OPERATOR, "backbone"), state=state)
    assert [one.refused for one in replies(effects)] == [MOST_REFUSED]


# --- replies ------------------------------------------------------------------------------------------------------


OWN = order_for(ID, 1, STOP, SECRET)


@given(
    number=st.integers(0, 3), verb=st.integers(0, 3), id=st.sampled_from([ID, "base"]),
    to=st.sampled_from([OPERATOR, "control"]), mac=st.sampled_from([OWN.mac, bytes(8), b""]),
    said=st.tuples(st.integers(0, 2), st.integers(1, 2), st.integers(0, 2)),
)  # fmt: skip
@example(number=1, verb=START, id=ID, to=OPERATOR, mac=OWN.mac, said=(REFUSED, RUNNING, 1))
@example(number=1, verb=STOP, id=ID, to="control", mac=OWN.mac, said=(REFUSED, RUNNING, 1))
@example(number=1, verb=STOP, id=ID, to=OPERATOR, mac=bytes(8), said=(REFUSED, RUNNING, 1))
@example(number=1, verb=STOP, id=ID, to=OPERATOR, mac=OWN.mac, said=(OK, STOPPED, 0))
def test_a_reply_is_the_answer_to_one_order_by_one_process_to_one_other(
    number: int, verb: int, id: str, to: str, mac: bytes, said: tuple[int, int, int]
) -> None:
    """Nobody gets one for another order, or another sender, that passes: a stranger may have any of these made."""
    order = OWN
    other = Order(number, verb, mac)
    reply = reply_to(other, id, to, said, SECRET)
    same = (other, id, to) == (order, ID, OPERATOR)
    assert answers(reply, order, ID, OPERATOR, SECRET) == same
    assert answers(reply, other, id, to, SECRET)
    assert not answers(replace(reply, state=3), other, id, to, SECRET)
    assert not answers(reply, other, id, to, bytes(16))


# --- lives of the process -----------------------------------------------------------------------------------------


def test_number_and_stop_and_what_the_role_stored_outlive_the_process() -> None:
    role = managed(script({Started(0): (Store(b"kept"),)}))
    _, effects = after(role, Started(0), ordered(1, 5, STOP))
    state, began = after(role, Started(9, stored(effects)))
    assert began == (Radio(False, "serial"), Radio(True, "backbone"), State("stopped", LANE))
    assert (state.runs, state.role) == (False, ())
    _, effects = after(role, ordered(10, 4, START), state=state)
    assert Tell("refused order", (OPERATOR, "old number")) in effects
    _, effects = after(role, ordered(10, 5, STOP), state=state)
    assert [(one.answer, one.state) for one in replies(effects)] == [(OK, STOPPED)]
    state, _ = after(role, ordered(11, 6, START), state=state)
    assert state.role == (Started(11, b"kept"),)


def test_what_the_role_stores_after_an_order_has_the_number_of_that() -> None:
    role = managed(script({Timer(3, "t"): (Store(b"later"),)}))
    _, effects = after(role, Started(0), ordered(1, 5, STATUS), Timer(3, "t"))
    state, _ = after(role, Started(9, stored(effects)))
    assert state.role == (Started(9, b"later"),)
    _, effects = after(role, ordered(10, 4, STOP), state=state)
    assert Tell("refused order", (OPERATOR, "old number")) in effects


@given(st.binary(max_size=40))
def test_bytes_that_it_did_not_store_are_nothing(data: bytes) -> None:
    role = managed(Puppet())
    state, _ = after(role, Started(0, data))
    assert isinstance(state.stored, bytes)
    _, effects = after(role, ordered(1, 1, STATUS), state=state)
    assert len(replies(effects)) == 1


def test_the_clock_of_a_role_that_was_stopped_is_not_that_of_the_next_life() -> None:
    role = managed(Puppet(follows=True))
    assert role.follows
    state, _ = after(role, Started(0), ClockSet(1, 500), ordered(2, 1, STOP), ordered(3, 2, START))
    assert state.role == (Started(3),)


# --- hosted roles and sensors -------------------------------------------------------------------------------------


def test_the_timers_of_all_hosted_roles_are_cancelled() -> None:
    one, other = script({Started(0): (SetTimer("t", 5),)}), script({Started(0): (SetTimer("t", 6),)})
    _, effects = after(managed(Host({"one": one, "other": other}, id=ID)), Started(0), ordered(1, 1, STOP))
    assert [one.name for one in effects if isinstance(one, CancelTimer)] == ["one/t", "other/t"]


def test_a_reading_for_a_life_that_was_stopped_goes_to_nobody() -> None:
    """A host that waits for a sensor takes nothing else, and no reading that it did not ask for."""
    ask = script(
        {
            Timer(1, "t"): (Sample("sound"),),
            Sampled(9, "sound", 2.0): (Note("heard"),),
            Timer(9, "t"): (Sample("sound"),),
        }
    )
    role = managed(Host({"ear": ask}, id=ID))
    waiting, effects = after(role, Started(0), Timer(1, "ear/t"))
    assert effects == (Sample("sound"),)
    state, _ = after(role, ordered(2, 1, STOP), ordered(3, 2, START), state=waiting)
    state, effects = after(role, Sampled(4, "sound", 1.0), state=state)
    assert effects == ()
    _, effects = after(role, Timer(9, "ear/t"), Sampled(9, "sound", 2.0), state=state)
    assert effects == (Note("heard"),)
    with pytest.raises(IllegalEvent):
        after(role, Sampled(4, "sound", 1.0), state=after(role, Started(0))[0])
