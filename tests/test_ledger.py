"""The ledger: every (frame, hearer) with what became of it, by hand and against a plainer account."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.books.said import describe
from launcher.record.ledger import Ledger
from launcher.records import MessageRow
from trackfield.drivers.engine.frames import EventKey, Frame, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NEIGHBOURHOOD, NS, Note, Publish, Radio, State, TrackPoint
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa

MS = 1_000_000
END = 10 * NS
IDEAL: dict[str, Any] = {"model": "ideal"}


def processes() -> list[ProcessSpec]:
    """``a`` to ``c`` hear broadcasts in their cell, ``far`` those in another; ``deaf`` none."""
    near = [ProcessSpec(name, "toy", "none", cells=("c0",), media=("field", "backbone")) for name in ("a", "b", "c")]
    return [*near, ProcessSpec("far", "toy", "none", cell="c1", cells=("c1",)), ProcessSpec("deaf", "toy", "none")]


def ledger(link: dict[str, Any] = IDEAL) -> Ledger:
    return Ledger(RunSpec("r", 1, END, link, media={"backbone": IDEAL}), processes())


def frame(t_ms: float, src: str = "a", to: str = "b", *, copy: int = 0, payload: bytes | None = None) -> Frame:
    payload = encode(Doa(1, 90.0, 60.0)) if payload is None else payload
    return Frame(src, 0, "doa", round(t_ms * MS), copy, to, "field", payload)


def timer(t_ms: float, name: str = "step") -> EventKey:
    return (round(t_ms * MS), 2, round(t_ms * MS), name)


def told(t_ms: float, effect: State | Radio | Publish | Note) -> Told:
    return Told(timer(t_ms), effect)


def outcomes(book: Ledger) -> dict[str, int]:
    """How many of each outcome, after the books are closed."""
    book.close()
    return dict(Counter(row.outcome for row in book.rows))


# --- one frame --------------------------------------------------------------------------------------------------------


def test_a_frame_that_arrives_is_delivered_after_its_delay() -> None:
    book = ledger()
    book.sent(frame(100))
    rows, events = book.close()
    assert events == []
    assert rows == book.rows
    assert rows == [
        MessageRow("doa", "a", "b", "field", 100 * MS, 101 * MS, "delivered", len(frame(0).payload), 0, 0,
                   "DOA 90.0 deg 60.0 dB", (90.0, 60.0), 1, 100 * MS, frame(0).payload),
    ]  # fmt: skip
    assert (book.sent_kinds, book.payload_bytes) == ({"doa": 1}, len(frame(0).payload))


def test_a_link_that_loses_it_is_the_first_cause() -> None:
    """Lost on the radio it is, though its hearer slept and the run was over when it would have arrived."""
    book = ledger({"model": "fixed", "loss": 1.0, "delay_ms": 5})
    book.told("b", told(50, Radio(False)))
    book.sent(frame(100))
    book.sent(frame(9999))
    assert outcomes(book) == {"radio": 2}
    assert [row.due_ns for row in book.rows] == [None, None]


def test_what_is_due_at_the_end_or_later_is_in_flight() -> None:
    book = ledger()
    for t_ms in (9998.999999, 9999.0, 9999.5):
        book.sent(frame(t_ms))
    book.close()
    assert [row.outcome for row in book.rows] == ["delivered", "in_flight", "in_flight"]
    assert book.rows[1].due_ns == END


def test_a_run_that_is_ended_early_has_its_end_then_and_never_later() -> None:
    for end_ns, found in ((101 * MS, {"in_flight": 1}), (102 * MS, {"delivered": 1}), (2 * END, {"delivered": 1})):
        book = ledger()
        book.end(end_ns)
        book.sent(frame(100))
        assert outcomes(book) == found
        assert book.run.end_ns == min(end_ns, END)


def test_late_and_ignored_frames_are_delivered_all_the_same() -> None:
    book = ledger()
    for t_ms, reason in ((100, "late"), (200, "repeated"), (300, "malformed"), (400, None)):
        book.sent(frame(t_ms))
        if reason:
            book.told("b", Refused(frame(t_ms).key(round((t_ms + 1) * MS)), reason))
    assert outcomes(book) == {"late": 1, "ignored": 2, "delivered": 1}
    assert all(row.delivered for row in book.rows)


def test_the_same_key_refused_by_another_hearer_is_none_of_its_business() -> None:
    book = ledger()
    book.sent(frame(100, to=NEIGHBOURHOOD))
    book.told("c", Refused(frame(100, to=NEIGHBOURHOOD).key(101 * MS), "late"))
    book.close()
    assert {row.dst: row.outcome for row in book.rows} == {"b": "delivered", "c": "late"}


# --- asleep -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("due_ms", "outcome"),
    [(99, "delivered"), (100, "delivered"), (100.000001, "asleep"), (200, "asleep"), (200.000001, "delivered")],
)
def test_a_change_of_the_radio_counts_for_what_is_due_after_it(due_ms: float, outcome: str) -> None:
    book = ledger()
    book.told("b", told(100, Radio(False)))
    book.told("b", told(200, Radio(True)))
    book.sent(frame(due_ms - 1))
    assert outcomes(book) == {outcome: 1}


def test_each_medium_has_a_receiver_of_its_own() -> None:
    book = ledger()
    book.told("b", told(100, Radio(False, "backbone")))
    book.sent(frame(150))
    book.sent(replace(frame(150), medium="backbone"))
    book.close()
    assert {row.medium: row.outcome for row in book.rows} == {"field": "delivered", "backbone": "asleep"}


def test_a_refusal_is_of_the_frame_on_its_medium() -> None:
    book = ledger()
    both = [frame(100), replace(frame(100), medium="backbone")]
    book.told("b", Refused(both[1].key(101 * MS), "late"))
    for one in both:
        book.sent(one)
    book.close()
    assert {row.medium: row.outcome for row in book.rows} == {"field": "delivered", "backbone": "late"}


def test_of_two_changes_at_one_instant_the_later_told_counts() -> None:
    for on in (True, False):
        book = ledger()
        book.told("b", told(100, Radio(not on)))
        book.told("b", told(100, Radio(on)))
        book.sent(frame(150))
        assert outcomes(book) == {"delivered" if on else "asleep": 1}


def test_only_the_sleeper_misses_a_broadcast() -> None:
    book = ledger()
    book.told("c", told(100, Radio(False)))
    book.sent(frame(150, to=NEIGHBOURHOOD))
    book.close()
    assert {row.dst: row.outcome for row in book.rows} == {"b": "delivered", "c": "asleep"}


# --- undoing ----------------------------------------------------------------------------------------------------------


def test_telemetry_that_is_undone_was_never_told() -> None:
    book = ledger()
    late = frame(100).key(101 * MS)
    book.told("b", told(50, Radio(False)))
    book.told("b", told(60, Radio(True)))
    book.told("b", told(90, State("reporting")))
    book.told("b", Refused(late, "late"))
    book.told("b", told(120, Radio(False)))
    book.told("b", told(130, Publish(TrackPoint("t", "x", NS, "waiting", step=1))))
    book.told("b", Undone(late))
    for t_ms in (54, 100, 140):
        book.sent(frame(t_ms))
    _, events = book.close()
    assert [row.outcome for row in book.rows] == ["asleep", "delivered", "delivered"]
    assert [(e.t_ns, e.process, e.effect) for e in events] == [(90 * MS, "b", State("reporting"))]
    assert book.estimates() == []


def test_what_a_provisional_ledger_handed_on_and_was_undone_comes_again_as_it_is_told_again() -> None:
    book = Ledger(RunSpec("r", 1, END, IDEAL), processes(), provisional=True)
    for t_ms in (10, 20, 30):
        book.told("b", told(t_ms, Note(f"at {t_ms}")))
    assert [e.t_ns for e in book.settle(25 * MS)[1]] == [10 * MS, 20 * MS]
    book.told("b", Undone(timer(20)))
    book.told("b", told(20, Note("corrected")))
    _, events = book.settle(25 * MS)
    assert [e.effect for e in events] == [Note("corrected")]
    assert book.settle(END)[1] == []
    assert book.complaints() == []


def test_an_undoing_is_one_processs_own() -> None:
    book = ledger()
    for name in ("b", "c"):
        book.told(name, told(100, Radio(False)))
    book.told("b", Undone(timer(0)))
    for to in ("b", "c"):
        book.sent(frame(150, to=to))
    book.close()
    assert {row.dst: row.outcome for row in book.rows} == {"b": "delivered", "c": "asleep"}


def test_of_estimates_told_twice_the_last_stays() -> None:
    book = ledger()
    first, second = (Publish(TrackPoint("t", "x", NS, "tracking", (float(x), 0.0, 0.0, 0.0))) for x in (1, 2))
    book.told("b", told(300, first))
    book.told("a", told(200, first))
    book.told("b", Undone(timer(300)))
    book.told("b", told(300, second))
    assert book.estimates() == [(200 * MS, "a", 0, first.estimate), (300 * MS, "b", 0, second.estimate)]


# --- who is expected to hear ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("src", "to", "hearers"),
    [
        ("a", NEIGHBOURHOOD, ["b", "c"]),
        ("far", NEIGHBOURHOOD, []),
        ("deaf", NEIGHBOURHOOD, ["a", "b", "c"]),
        ("a", "deaf", ["deaf"]),
        ("a", "nobody", []),
        ("stranger", "b", ["b"]),
        ("stranger", NEIGHBOURHOOD, []),
    ],
)
def test_hearers_are_the_scenarios_not_whoever_subscribes(src: str, to: str, hearers: list[str]) -> None:
    book = ledger()
    book.sent(frame(100, src, to))
    book.close()
    assert [row.dst for row in book.rows] == hearers
    assert sum(book.sent_kinds.values()) == 1


def test_the_longest_payload_of_a_kind_is_kept() -> None:
    book = ledger()
    for n in (3, 9, 5):
        book.sent(frame(n, payload=bytes(n)))
    book.close()
    assert book.payload_max == {"doa": 9}
    assert book.payload_bytes == 17


# --- settling ---------------------------------------------------------------------------------------------------------


def test_rows_settle_once_in_the_order_in_which_they_are_due() -> None:
    book = ledger({"model": "fixed", "loss": 0.0, "delay_ms": 5})
    for t_ms in (30, 10, 20):
        book.sent(frame(t_ms))
    assert book.settle(14 * MS) == ([], [])
    assert [row.sent_ns for row in book.settle(25 * MS)[0]] == [10 * MS, 20 * MS]
    assert book.settle(25 * MS) == ([], [])
    assert [row.sent_ns for row in book.close()[0]] == [30 * MS]
    assert [row.sent_ns for row in book.rows] == [10 * MS, 20 * MS, 30 * MS]


# --- the hearers' own counters ----------------------------------------------------------------------------------------


def test_who_died_got_what_it_had_counted_and_no_more() -> None:
    book = ledger()
    for t_ms in (300, 100, 400):
        book.sent(frame(t_ms))
    book.settle(350 * MS)
    for t_ms, to in ((200, "b"), (150, "c")):  # recorded when later ones had been settled
        book.sent(frame(t_ms, to=to))
    book.counts["b"] = {"delivered": 2}
    book.close(dead=["b"])
    assert {(row.dst, row.sent_ns // MS): row.outcome for row in book.rows} == {
        ("b", 100): "delivered", ("b", 200): "delivered", ("b", 300): "dead", ("b", 400): "dead",
        ("c", 150): "delivered",
    }  # fmt: skip
    assert book.sums()["host_lost"] == 0


def test_who_died_before_it_counted_anything_got_nothing() -> None:
    book = ledger()
    book.told("b", told(150, Radio(False)))
    for t_ms in (100, 200):
        book.sent(frame(t_ms))
    book.close(dead=["b"])
    assert [row.outcome for row in book.rows] == ["dead", "asleep"]


# --- payloads in words ------------------------------------------------------------------------------------------------


def test_a_payload_in_words() -> None:
    said = describe(encode(Doa(7, 123.4, 55.5)))
    assert said == ("DOA 123.4 deg 55.5 dB", (pytest.approx(123.4), pytest.approx(55.5)), 7)
    for payload in (b"", b"\xff", encode(Doa(7, 123.4, 55.5))[:-1]):
        text, values, step = describe(payload)
        assert text.startswith("malformed (")
        assert (values, step) == ((), None)


@given(st.binary(min_size=1, max_size=40))
def test_no_payload_upsets_the_ledger(payload: bytes) -> None:
    book = ledger()
    book.sent(frame(100, payload=payload))
    book.close()
    assert [(row.outcome, row.bytes) for row in book.rows] == [("delivered", len(payload))]
