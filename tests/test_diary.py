"""Diaries: what a life told, looked up by time; and the clock it lived by, against hand-made figures."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.diary import Diary, Event
from launcher.record.ledger import Ledger
from trackfield.drivers.engine.frames import Charge, Died, EventKey, Frame, Overflowed, Queued, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NS, Corrected, Note, Radio, State
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa, SyncRequest

MS = 1_000_000


def diary(**spec: Any) -> Diary:
    return Diary(ProcessSpec("n", "node", "none", **spec))


def timer(t_ms: float, name: str = "t") -> EventKey:
    return round(t_ms * MS), 2, round(t_ms * MS), name


# --- when a frame reaches it ------------------------------------------------------------------------------------------


def test_a_life_owns_what_is_due_from_its_start_until_before_its_kill() -> None:
    life = diary(start_ns=10, kill_ns=20)
    assert [t for t in range(30) if life.owns(t)] == list(range(10, 20))
    assert diary(start_ns=10).owns(1 << 61)


@pytest.mark.parametrize(
    ("due_ms", "cause"),
    [(9, None), (10, "frozen"), (14, "frozen"), (15, "frozen"), (20, "asleep"), (25, "asleep"), (30, None), (40, None),
     (40.000001, "dead"), (45, "dead")],
)  # fmt: skip
def test_the_first_cause_that_holds_is_told(due_ms: float, cause: str | None) -> None:
    """Standing still from 10 to 20 ms, silent after 14 and listening again after 25, empty at 40, still from 42 on."""
    life = diary(freezes=((10 * MS, 20 * MS), (42 * MS, 50 * MS)))
    for t, on in ((14, False), (25, True)):
        life.write(Told(timer(t), Radio(on)))
    life.write(Told((40 * MS, 4), Died("battery")))
    assert life.misses("field", round(due_ms * MS)) == cause


def test_who_found_its_battery_empty_at_the_start_hears_nothing_at_all() -> None:
    life = diary(start_ns=10)
    life.write(Told((10, 0, "start"), Died("battery")))
    assert life.misses("field", 10) == "dead"


def test_a_death_that_is_undone_was_none() -> None:
    life = diary()
    life.write(Told((40 * MS, 4), Died("battery")))
    life.write(Told((40 * MS, 4), Charge(0.0)))
    life.write(Undone(timer(30)))
    assert life.misses("field", 50 * MS) is None
    assert life.told == []
    life.write(Told((45 * MS, 4), Died("battery")))
    assert [life.misses("field", t * MS) for t in (45, 46)] == [None, "dead"]


@given(
    st.lists(st.tuples(st.integers(0, 40), st.booleans()), max_size=6),
    st.lists(st.integers(0, 40), max_size=4, unique=True),
    st.none() | st.integers(10, 40),
    st.none() | st.integers(0, 40),
)
def test_the_spans_in_which_it_listens_are_those_in_which_frames_reach_it(
    switches: list[tuple[int, bool]], edges: list[int], kill: int | None, died: int | None
) -> None:
    edges = sorted(edges)
    life = diary(start_ns=3, kill_ns=kill, freezes=tuple(zip(edges[::2], edges[1::2], strict=False)))
    for t, on in sorted(switches):
        life.write(Told((t, 2, t, "t"), Radio(on)))
    if died is not None:
        life.write(Told((died, 3), Died("battery")))
    changes = life.awake("field")
    assert [t for t, _ in changes] == sorted({t for t, _ in changes})
    for due in range(50):
        on = [False, *(on for t, on in changes if t < due)][-1]
        assert on == (life.owns(due) and life.misses("field", due) is None)


# --- what it told -----------------------------------------------------------------------------------------------------


def test_all_of_its_telemetry_but_the_radios_is_handed_on_in_order_and_once() -> None:
    life = diary()
    news = [State("up"), Queued("doa", 5, 4, 3), Charge(0.99), Corrected(7), Note("x"), Died("battery")]
    life.write(Told(timer(0), Radio(False)))
    for t, effect in enumerate(news, 1):
        life.write(Told(timer(t), effect))
    assert [event.effect for event in life.settled(3 * MS)] == news[:3]
    assert list(life.settled(9 * MS)) == [Event(t * MS, "n", effect) for t, effect in enumerate(news, 1)][3:]
    assert list(life.settled(9 * MS)) == []


# --- clocks -----------------------------------------------------------------------------------------------------------


def test_the_clock_with_its_drift_and_jumps() -> None:
    """5 ms ahead, 40 ppm fast, and a jump by -2 ms at 1 s: after 2 s it has gained 80 us."""
    life = diary(clock={"offset_ns": 5 * MS, "drift_ppb": 40_000}, jumps=((NS, -2 * MS),))
    assert life.local_ns(0) == 5 * MS
    assert life.local_ns(NS - 1) == NS - 1 + 5 * MS + 39_999
    assert life.local_ns(NS) == NS + 3 * MS + 40_000
    assert life.local_ns(2 * NS) == 2 * NS + 3 * MS + 80_000


def test_the_error_of_a_clock_is_what_is_left_after_the_correction_known_then() -> None:
    life = diary(clock={"offset_ns": 5 * MS})
    life.write(Told(timer(100), Corrected(-4 * MS)))
    life.write(Told(timer(200), Corrected(-5 * MS - 7)))
    assert [life.clock_error_ns(t * MS) for t in (0, 99, 100, 199, 200)] == [5 * MS, 5 * MS, MS, MS, -7]
    life.write(Undone(timer(200)))
    assert life.clock_error_ns(300 * MS) == MS


def test_a_jump_after_the_correction_shows_as_it_is() -> None:
    life = diary(jumps=((150 * MS, 9 * MS),))
    life.write(Told(timer(100), Corrected(-3)))
    assert [life.clock_error_ns(t * MS) for t in (120, 150)] == [-3, 9 * MS - 3]


def test_the_ledger_notes_the_clock_of_each_sender_but_not_of_one_that_asks_for_the_time() -> None:
    specs = [
        ProcessSpec("n", "node", "none", clock={"offset_ns": 5 * MS}),
        ProcessSpec("m", "node", "none", jumps=((150 * MS, 9 * MS),)),
        ProcessSpec("fusion", "fusion", "none"),
    ]
    book = Ledger(RunSpec("r", 1, NS, {"model": "ideal"}), specs)
    book.told("n", Told(timer(120), Corrected(-5 * MS + 3)))

    def send(t_ms: int, src: str, to: str, message: object, kind: str) -> None:
        book.sent(Frame(src, 0, kind, t_ms * MS, 0, to, "field", encode(message)))

    send(100, "n", "fusion", Doa(1, 0.0, 60.0), "doa")
    send(110, "n", "fusion", SyncRequest(1, 0), "sync-request")
    send(130, "n", "fusion", Doa(1, 0.0, 60.0), "doa")
    send(140, "m", "fusion", Doa(1, 0.0, 60.0), "doa")
    send(160, "m", "fusion", Doa(1, 0.0, 60.0), "doa")
    send(170, "fusion", "n", Doa(1, 0.0, 60.0), "doa")
    book.close()
    assert book.clock_errors == {
        (100 * MS, "n"): 5 * MS, (130 * MS, "n"): 3, (140 * MS, "m"): 0, (160 * MS, "m"): 9 * MS,
    }  # fmt: skip
    assert {row.sent_ns // MS: row.local_ns for row in book.rows} == {
        100: 105 * MS, 110: 115 * MS, 130: 135 * MS, 140: 140 * MS, 160: 169 * MS, 170: 170 * MS,
    }  # fmt: skip


# --- causes of loss in their order ------------------------------------------------------------------------------------


def book_of(link: dict[str, Any], *hearers: ProcessSpec, cuts: Any = ()) -> Ledger:
    return Ledger(RunSpec("r", 1, 100 * MS, link, partitions=cuts), [ProcessSpec("a", "x", "none"), *hearers])


def sent(book: Ledger, *times_ms: float) -> list[str]:
    """The outcomes of frames from a to b."""
    for t in times_ms:
        book.sent(Frame("a", 0, "doa", round(t * MS), 0, "b", "field", b"?"))
    book.close()
    return [row.outcome for row in sorted(book.rows, key=lambda row: row.sent_ns)]


LOSSY = {"model": "fixed", "loss": 1.0, "delay_ms": 1}
IDEAL = {"model": "ideal"}
FROZEN = ((0, 200 * MS),)


@pytest.mark.parametrize(
    ("link", "cut", "t_ms", "killed", "frozen", "outcome"),
    [
        (LOSSY, True, 50, True, True, "partition"),
        (LOSSY, False, 50, True, True, "radio"),
        (IDEAL, True, 99.5, True, True, "partition"),
        (IDEAL, False, 99.5, True, True, "in_flight"),
        (IDEAL, False, 50, True, True, "dead"),
        (IDEAL, False, 50, False, True, "frozen"),
        (IDEAL, False, 50, False, False, "asleep"),
    ],
)
def test_the_first_cause_of_loss_counts(
    link: dict[str, Any], cut: bool, t_ms: float, killed: bool, frozen: bool, outcome: str
) -> None:
    """Each time one cause less holds; its hearer has been asleep all the while."""
    b = ProcessSpec("b", "x", "none", kill_ns=10 * MS if killed else None, freezes=FROZEN if frozen else ())
    book = book_of(link, b, cuts=((0, 200 * MS, ["b"], None),) if cut else ())
    book.told("b", Told(timer(0), Radio(False)))
    assert sent(book, t_ms) == [outcome]


def test_a_process_that_died_unplanned_has_a_next_life_from_its_start_on() -> None:
    """b got the frame due at 11 ms and died; who follows it starts at 40 ms: in between all is lost."""
    first = ProcessSpec("b", "x", "none")
    book = book_of(IDEAL, first)
    following = ProcessSpec("b", "x", "none", incarnation=1, start_ns=40 * MS)
    book.life(following)
    book.life(following)
    book.counts["b"] = {"delivered": 1}
    for t in (10, 20, 38.5, 39, 50):
        book.sent(Frame("a", 0, "doa", round(t * MS), 0, "b", "field", b"?"))
    book.final("b~1", {"delivered": 2})
    book.close(dead=["b"])
    assert [row.outcome for row in book.rows] == ["delivered", "dead", "dead", "delivered", "delivered"]
    assert book.sums()["host_lost"] == 0


def test_a_process_that_died_unplanned_and_was_not_replaced_gets_no_more() -> None:
    book = book_of(IDEAL, ProcessSpec("b", "x", "none"))
    book.counts["b"] = {"delivered": 2}
    for t in (10, 20, 30):
        book.sent(Frame("a", 0, "doa", t * MS, 0, "b", "field", b"?"))
    book.close(dead=["b"])
    assert [row.outcome for row in book.rows] == ["delivered", "delivered", "dead"]


def test_a_frame_that_was_turned_away_is_a_row_for_each_of_its_hearers_and_was_not_sent() -> None:
    hearers = [ProcessSpec(id, "x", "none", cells=("c0",)) for id in "bcd"]
    book = book_of(IDEAL, *hearers)
    frame = Frame("b", 0, "doa", 50 * MS, 0, "*", "field", b"?")
    book.told("b", Told(timer(50), Overflowed(frame)))
    rows, events = book.close()
    assert {(row.dst, row.outcome, row.due_ns) for row in rows} == {("c", "overflow", None), ("d", "overflow", None)}
    assert [event.effect for event in events] == [Overflowed(frame)]
    assert (book.sent_kinds, book.payload_bytes) == ({}, 0)


def test_a_refusal_does_not_save_a_frame_from_its_cause() -> None:
    book = book_of(IDEAL, ProcessSpec("b", "x", "none", freezes=((50 * MS, 60 * MS),)))
    for t in (50, 70):
        book.told("b", Refused(Frame("a", 0, "doa", t * MS, 0, "b", "field", b"?").key((t + 1) * MS), "late"))
    assert sent(book, 50, 70) == ["frozen", "late"]
