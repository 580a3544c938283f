"""System control: planned orders, orders that people type, and answers that do not come or are forged."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gateway.operator import LONGEST, Asked, Typed, lines_of, understood
from gateway.system import MOST_WAITING, PORT, Memory, System
from tests.puppet import MS
from trackfield.protocols.orders import OK, REFUSED, TRIES, UNKNOWN, order_for, reply_to
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    PortRead,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Tell,
    Timer,
    Write,
)
from trackfield.wire.outside import ITEMS, RUNNING, START, STATUS, STOP, STOPPED, Order, OrderReply

KEY = "00112233445566778899aabbccddeeff"
SECRET = bytes.fromhex(KEY)
MANAGED = ("base", "camera-control", "video")
PATIENCE_NS = 100 * MS


def system(*orders: Sequence[int | str]) -> System:
    return System(id="system", key=KEY, managed=MANAGED, patience_ns=PATIENCE_NS, orders=orders)


def after(role: System, *events: Event, state: Memory | None = None) -> tuple[Memory, list[Effect]]:
    """The state after these events, and the effects of the last."""
    state, effects = state or role.begin(), tuple[Effect, ...]()
    for event in events:
        state, effects = role.handle(state, event)
    return state, list(effects)


def typed(now: int, text: str | bytes) -> PortRead:
    return PortRead(now, PORT, text if isinstance(text, bytes) else text.encode())


def sent(effects: Iterable[Effect]) -> list[tuple[str, Order]]:
    return [(str(one.to), one.message) for one in effects if isinstance(one, Send)]


def told(effects: Iterable[Effect]) -> list[tuple[Any, ...]]:
    return [one.values for one in effects if isinstance(one, Tell) and one.topic == "order"]


def lines(effects: Iterable[Effect]) -> list[str]:
    assert all(one.data.endswith(b"\r\n") for one in effects if isinstance(one, Write))
    return [one.data.decode().strip() for one in effects if isinstance(one, Write)]


def answer(now: int, order: Order, id: str, state: int = RUNNING, answer: int = OK, key: bytes = SECRET) -> Received:
    return Received(now, reply_to(order, id, "system", (answer, state, 0), key), id, "backbone")


def give(role: System, state: Memory, now: int, line: str) -> tuple[Memory, Order]:
    """An order that is typed, and goes at once."""
    state, effects = after(role, typed(now, f"{line}\n"), state=state)
    ((_, order),) = sent(effects)
    return state, order


# --- planned orders -----------------------------------------------------------------------------------------------


def test_planned_orders_are_given_at_their_instants_whatever_their_places_in_the_list() -> None:
    role = system((5 * NS, "start", "video"), (3 * NS, "stop", "video"), (3 * NS, "status", "base"))
    state, effects = after(role, Started(0))
    assert effects == [SetTimer("planned", 3 * NS)]
    state, effects = after(role, Timer(3 * NS, "planned"), state=state)
    assert sent(effects) == [
        ("video", order_for("video", 1, STOP, SECRET)),
        ("base", order_for("base", 2, STATUS, SECRET)),
    ]
    assert SetTimer("planned", 5 * NS) in effects
    assert {one.medium for one in effects if isinstance(one, Send)} == {"backbone"}
    state, effects = after(role, answer(4 * NS, order_for("video", 1, STOP, SECRET), "video", STOPPED), state=state)
    assert told(effects) == [(1, "stop", "video", "ok")]
    assert State("stopped", "video") in effects
    assert CancelTimer("answer:video") in effects
    assert lines(effects) == []
    _, effects = after(role, Timer(5 * NS, "planned"), state=state)
    assert [(id, order.verb) for id, order in sent(effects)] == [("video", START)]
    assert not [one for one in effects if isinstance(one, SetTimer) and one.name == "planned"]


def test_a_planned_order_for_nobody_is_told_and_the_others_are_given() -> None:
    role = system((NS, "stop", "camera"), (NS, "stop", "video"))
    _, effects = after(role, Started(0), Timer(NS, "planned"))
    assert told(effects) == [(0, "stop", "camera", "unknown")]
    assert [id for id, _ in sent(effects)] == ["video"]


def test_orders_for_one_process_wait_for_each_other_and_keep_their_order() -> None:
    role = system((NS, "stop", "video"), (NS, "start", "video"), (NS, "status", "video"))
    state, effects = after(role, Started(0), Timer(NS, "planned"))
    verbs = list[int]()
    for now in range(3):
        ((id, order),) = sent(effects)
        verbs.append(order.verb)
        state, effects = after(role, answer(NS + now, order, id), state=state)
    assert sent(effects) == []
    assert verbs == [STOP, START, STATUS]
    assert dict(state.given) == {}


# --- answers that do not come -------------------------------------------------------------------------------------


def test_an_order_is_sent_again_with_more_patience_each_time_and_then_given_up() -> None:
    role = system((NS, "stop", "video"), (NS, "status", "video"))
    state, effects = after(role, Started(0), Timer(NS, "planned"))
    ((_, order),) = sent(effects)
    now, waits = NS, list[int]()
    for _ in range(TRIES - 1):
        (due,) = [one.at for one in effects if isinstance(one, SetTimer)]
        waits.append(due - now)
        now = due
        state, effects = after(role, Timer(now, "answer:video"), state=state)
        assert sent(effects) == [("video", order)]
    (due,) = [one.at for one in effects if isinstance(one, SetTimer)]
    assert [*waits, due - now] == [PATIENCE_NS << i for i in range(TRIES)]
    state, effects = after(role, Timer(due, "answer:video"), state=state)
    assert told(effects) == [(1, "stop", "video", "silent")]
    assert State("silent", "video") in effects
    assert [(id, one.verb) for id, one in sent(effects)] == [("video", STATUS)]  # the next one has its turn
    _, effects = after(role, answer(due + 1, order, "video"), state=state)
    assert effects == [Ignored("unexpected")]  # too late


def test_one_that_is_silent_holds_up_no_other() -> None:
    role = system((NS, "stop", "video"), (2 * NS, "stop", "base"))
    _, effects = after(role, Started(0), Timer(NS, "planned"), Timer(2 * NS, "planned"))
    assert [id for id, _ in sent(effects)] == ["base"]


# --- answers that nobody gave -------------------------------------------------------------------------------------


def forgeries(order: Order) -> dict[str, tuple[Received, str]]:
    """What is no answer of video to this order, and what is said of it."""
    other = order_for("video", order.number, START, SECRET)
    genuine: OrderReply = answer(2 * NS, order, "video").message
    return {
        "key": (answer(2 * NS, order, "video", key=bytes(16)), "forged"),
        "state": (Received(2 * NS, replace(genuine, state=STOPPED), "video"), "forged"),
        "answer": (Received(2 * NS, replace(genuine, answer=REFUSED), "video"), "forged"),
        "mac": (Received(2 * NS, replace(genuine, mac=b""), "video"), "forged"),
        "order": (answer(2 * NS, other, "video"), "forged"),
        "what nobody answers": (answer(2 * NS, order, "video", answer=3), "forged"),
        "whose": (Received(2 * NS, genuine, "base"), "unexpected"),
        "nobody's": (Received(2 * NS, genuine, "nobody"), "unexpected"),
        "number": (answer(2 * NS, order_for("video", 9, STOP, SECRET), "video"), "unexpected"),
        "another's": (Received(2 * NS, reply_to(order, "video", "base", (OK, RUNNING, 0), SECRET), "video"), "forged"),
    }


@pytest.mark.parametrize("case", list(forgeries(order_for("video", 1, STOP, SECRET))))
def test_what_is_no_answer_changes_nothing_and_is_counted(case: str) -> None:
    role = system((NS, "stop", "video"))
    before, effects = after(role, Started(0), Timer(NS, "planned"))
    ((_, order),) = sent(effects)
    forged, said = forgeries(order)[case]
    state, effects = after(role, forged, state=before)
    assert (state, effects) == (before, [Ignored(said)])
    _, effects = after(role, answer(3 * NS, order, "video", STOPPED), state=state)
    assert told(effects) == [(1, "stop", "video", "ok")]


@pytest.mark.parametrize(("said", "word"), [(REFUSED, "refused"), (UNKNOWN, "unknown")])
def test_a_genuine_refusal_is_told(said: int, word: str) -> None:
    role = system()
    state, order = give(role, after(role, Started(0))[0], 1, "stop video")
    _, effects = after(role, answer(2, order, "video", RUNNING, said), state=state)
    assert told(effects) == [(1, "stop", "video", word)]
    assert lines(effects) == ["refused by video, which is running"]


# --- people -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "state", "said"),
    [("stop video", STOPPED, "video stopped"), ("START video", RUNNING, "video running"),
     ("status video", STOPPED, "video stopped"), ("#7 status video", STOPPED, "#7 video stopped"),
     ("  stop   video ", STOPPED, "video stopped")],
)  # fmt: skip
def test_a_line_is_answered_by_a_line(line: str, state: int, said: str) -> None:
    role = system()
    memory, order = give(role, after(role, Started(0))[0], 1, line)
    _, effects = after(role, answer(2, order, "video", state), state=memory)
    assert lines(effects) == [said]


def test_status_of_all_ends_with_a_line_of_its_own() -> None:
    role = system()
    state, effects = after(role, Started(0), typed(1, "#a status\r"))
    asked, said = dict(sent(effects)), list[str]()
    assert list(asked) == list(MANAGED)
    for id in ("video", "base"):
        state, effects = after(role, answer(2, asked[id], id), state=state)
        said += lines(effects)
    for _ in range(TRIES):
        state, effects = after(role, Timer(NS, "answer:camera-control"), state=state)
    assert [*said, *lines(effects)] == ["#a video running", "#a base running", "#a camera-control silent", "#a end"]
    assert dict(state.lines) == {}


def test_who_asks_for_a_process_that_is_not_there_is_told_which_are() -> None:
    state, effects = after(system(), Started(0), typed(1, "stop vidoe\n"))
    assert lines(effects) == ["unknown process vidoe; processes: base, camera-control, video"]
    assert sent(effects) == []
    assert dict(state.lines) == {}


@pytest.mark.parametrize(
    "line", ["go", "stop", "start", "status a b", "stop video now", "\x1b[2J", "#tag", "#tag stop", "st\xe4rt video"]
)
def test_what_is_not_understood_is_answered_by_one_harmless_line(line: str) -> None:
    _, effects = after(system(), Started(0), typed(1, f"{line}\n{line}\r\n".encode("latin-1")))
    (said,) = lines(effects)
    assert "not understood: " in said
    assert said.endswith("; status, status ID, stop ID or start ID is")
    assert said.isprintable()
    assert sent(effects) == []


def test_empty_lines_are_none() -> None:
    assert after(system(), Started(0), typed(1, "\r\n\n  \n\r"))[1] == []


def test_orders_of_people_that_wait_are_bounded() -> None:
    role = system()
    state, effects = after(role, Started(0), typed(1, "status video\n" * (MOST_WAITING + 3)))
    assert lines(effects) == [f"refused: {MOST_WAITING} orders wait for video already"] * 2
    assert len(sent(effects)) == 1
    state, effects = after(role, typed(2, "status\n"), state=state)
    assert lines(effects) == [f"refused: {MOST_WAITING} orders wait for video already"]
    assert sent(effects) == []
    assert len(state.waiting["video"]) == MOST_WAITING


def test_a_planned_order_is_not_refused_because_people_wait() -> None:
    role = system((NS, "stop", "video"))
    state, _ = after(role, Started(0), typed(1, "status video\n" * (MOST_WAITING + 1)), Timer(NS, "planned"))
    assert state.waiting["video"][-1].planned == 0


@given(st.binary(max_size=600), st.lists(st.integers(1, 50), max_size=40))
def test_lines_do_not_depend_on_how_their_bytes_come(data: bytes, sizes: list[int]) -> None:
    whole, expected = lines_of(Typed(), data)
    state, found, rest = Typed(), list[str](), data
    for size in [*sizes, len(data)]:
        state, more = lines_of(state, rest[:size])
        found, rest = [*found, *more], rest[size:]
    assert (state, found) == (whole, expected)
    assert len(state.begun) <= LONGEST
    assert all(len(line) <= LONGEST + 3 for line in found)


@example([b"#\x00", b"\n"])
@example([b"#\x1b[2J status\n"])
@given(st.lists(st.binary(max_size=200) | st.sampled_from([b"stop video\n", b"status\r", b"#x start base\r\n"])))
def test_whatever_is_typed_nothing_fails_and_little_is_kept(chunks: list[bytes]) -> None:
    role = system()
    state, _ = after(role, Started(0))
    for now, chunk in enumerate(chunks):
        state, effects = after(role, typed(now, chunk), state=state)
        assert all(line.isprintable() for line in lines(effects))
        assert len([line for line in lines(effects) if "not understood" in line]) <= 1
        assert len(state.typed.begun) <= LONGEST
        assert all(len(waiting) <= MOST_WAITING for waiting in state.waiting.values())


@pytest.mark.parametrize("length", [LONGEST, LONGEST + 1])
def test_a_line_that_is_too_long_is_no_order(length: int) -> None:
    line = "stop video".ljust(length)
    assert isinstance(understood(lines_of(Typed(), f"{line}\n".encode())[1][0]), Asked) == (length <= LONGEST)


# --- its own lives ------------------------------------------------------------------------------------------------


def stored(effects: Iterable[Effect]) -> bytes:
    return [one.data for one in effects if isinstance(one, Store)][-1]


def test_no_number_is_used_twice_and_what_was_not_answered_is_ordered_again() -> None:
    role = system((NS, "stop", "video"), (2 * NS, "start", "base"), (9 * NS, "status", "base"))
    state, effects = after(role, Started(0), Timer(NS, "planned"))
    state, _ = after(role, answer(NS, sent(effects)[0][1], "video"), state=state)
    _, effects = after(role, Timer(2 * NS, "planned"), state=state)
    _, effects = after(role, Started(5 * NS, stored(effects)))
    assert sent(effects) == [("base", order_for("base", 3, START, SECRET))]
    assert SetTimer("planned", 9 * NS) in effects


def test_numbers_go_round_without_zero() -> None:
    role = system()
    state, order = give(role, replace(role.begin(), number=ITEMS - 1), 1, "status video")
    assert order.number == 1
    assert state.number == 1


@given(st.binary(max_size=40))
def test_bytes_that_it_did_not_store_are_nothing(data: bytes) -> None:
    role = system((NS, "stop", "video"))
    state, _ = after(role, Started(0, data))
    assert 0 <= state.number < ITEMS
    _, effects = after(role, Timer(NS, "planned"), state=state)
    assert len(sent(effects)) == 1 or 0 in state.settled
