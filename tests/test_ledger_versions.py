"""The ledger of frames that are taken back or replaced, and beside what processes say in their final records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.ledger import Ledger
from launcher.record.metrics import CAUSES
from launcher.record.samples import final_of
from tests.test_ledger import END, IDEAL, MS, frame, ledger, processes, timer, told
from trackfield.drivers.engine.frames import Frame, Overflowed, Refused, Undone
from trackfield.drivers.exchange.versions import Digest, Sum, digest
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NEIGHBOURHOOD, NS, Note, Radio, State
from trackfield.wire.error import WireError

Put = tuple[Frame, int]
GONE = b""
LOSSY = {"model": "fixed", "loss": 0.5, "delay_ms": 5}


def gone(one: Frame) -> Frame:
    """The frame as it is taken back."""
    return replace(one, payload=GONE)


def closed(*puts: Put, link: dict[str, Any] = IDEAL) -> Ledger:
    """A ledger of these puts."""
    book = ledger(link)
    for one, version in puts:
        book.sent(one, version)
    book.close()
    return book


def said(prefix: str, of: Digest) -> dict[str, int]:
    """As it stands in a final record."""
    count, total = of
    return {"sent": count, "sent_hash": total} if prefix == "sent" else {"heard": count, "heard_hash": total}


def traces(book: Ledger) -> tuple[Any, ...]:
    """All accounts of what is left of the frames."""
    return (
        book.rows, book.sent_kinds, book.payload_max, book.payload_bytes, book.on_air, dict(book.sent_bytes),
        book.clock_errors, book.sent_by, book.sums(), book.leaving.left, +book.leaving.ways,
    )  # fmt: skip


# --- versions ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [(0, 1), (1, 0), (0, 1, 0), (1, 1, 0)])
def test_what_was_taken_back_leaves_no_trace(order: tuple[int, ...]) -> None:
    one, other = frame(100), frame(200)
    versions = {0: (one, 0), 1: (gone(one), 1)}
    book = closed((other, 0), *(versions[n] for n in order))
    assert traces(book) == traces(closed((other, 0)))
    assert book.balance.puts == {"a": 3}


def test_what_replaces_a_frame_has_a_fate_of_its_own() -> None:
    """A longer payload, on a link on which the size matters."""
    link = {"model": "lognormal_prr", "radio": "802154-0dbm"}
    short, long = frame(100), frame(100, payload=bytes(90))
    places = [replace(p, x=10.0 * n) for n, p in enumerate(processes())]
    books = []
    for puts in ([(short, 0), (long, 1)], [(long, 1), (short, 0)], [(long, 1)], [(short, 0)]):
        book = Ledger(RunSpec("r", 1, END, link), places)
        for one, version in puts:
            book.sent(one, version)
        book.close()
        books.append(book)
    assert traces(books[0]) == traces(books[1]) == traces(books[2]) != traces(books[3])
    assert books[0].rows[0].due_ns != books[3].rows[0].due_ns
    assert books[0].payload_max == {"doa": 90}


def test_a_frame_can_come_back() -> None:
    one = frame(100)
    assert traces(closed((one, 0), (gone(one), 1), (one, 2))) == traces(closed((one, 0)))
    assert closed((one, 0), (one, 2), (gone(one), 1)).balance.puts == {"a": 3}


def test_what_becomes_of_a_frame_is_by_the_telemetry_that_is_left() -> None:
    book = ledger()
    one = frame(100)
    book.sent(one, 0)
    book.told("b", Refused(one.key(101 * MS), "late"))
    book.sent(gone(one), 1)
    book.told("b", Undone(one.key(101 * MS)))
    book.sent(one, 2)
    book.close()
    assert [row.outcome for row in book.rows] == ["delivered"]


def test_a_frame_that_overflowed_and_was_undone_is_none() -> None:
    book = ledger()
    book.told("a", told(50, Overflowed(frame(50))))  # type: ignore[arg-type]
    book.told("a", Undone(timer(50)))
    book.close()
    assert book.rows == []


# --- what is settled --------------------------------------------------------------------------------------------------


def test_a_settled_frame_stays_and_the_ledger_says_so() -> None:
    book = ledger()
    one = frame(100)
    book.sent(one, 0)
    assert len(book.settle(100 * MS - 1)[0]) == 0
    book.sent(gone(one), 1)
    book.sent(one, 2)
    assert [row.outcome for row in book.settle(101 * MS)[0]] == ["delivered"]
    book.sent(gone(one), 3)
    assert book.close()[0] == []
    assert book.complaints() == ["1 frames were taken back or replaced when they were recorded for good"]
    book.final("a", {"puts": 4, **said("sent", Digest())})
    assert (book.dropped(), book.interference()["frames"]) == (0, 0)


def test_a_frame_that_only_comes_late_is_entered() -> None:
    book = ledger()
    book.settle(5 * NS)
    book.sent(frame(100), 0)
    assert [row.outcome for row in book.settle(5 * NS)[0]] == ["delivered"]
    assert book.complaints() == []


def test_settled_telemetry_stays_and_the_ledger_says_so() -> None:
    book = ledger()
    for t_ms in (10, 20, 30):
        book.told("b", told(t_ms, Note(f"at {t_ms}")))
    assert [e.t_ns for e in book.settle(25 * MS)[1]] == [10 * MS, 20 * MS]
    book.told("b", Undone(timer(20)))
    for t_ms in (20, 30, 40):
        book.told("b", told(t_ms, Note(f"again at {t_ms}")))
    assert [e.effect for e in book.close()[1]] == [Note("again at 30"), Note("again at 40")]
    assert [o.effect for o in book.diaries["b"].told] == [
        Note("at 10"), Note("at 20"), Note("again at 30"), Note("again at 40"),
    ]  # fmt: skip
    assert book.complaints() == ["1 times telemetry was taken back when it was recorded for good"]


def test_what_a_process_tells_late_for_the_first_time_is_no_correction() -> None:
    """It stood still for long, undoes what it said last, and goes on; all that is before what is settled by now."""
    book = ledger()
    book.told("b", told(10, Note("first")))
    book.told("b", told(20, Radio(False)))
    book.settle(15 * MS)
    book.settle(5 * NS)
    book.told("b", Undone(timer(20)))
    book.told("b", told(20, Radio(True)))
    for t_ms in (30, 40):
        book.told("b", told(t_ms, Note(f"at {t_ms}")))
    assert [e.effect for e in book.settle(5 * NS)[1]] == [Note("at 30"), Note("at 40")]
    assert [effect for _, effect in book.diaries["b"].radio] == [Radio(False)]
    assert len(book.complaints()) == 1


def test_what_is_not_settled_is_known_provisionally() -> None:
    book = Ledger(RunSpec("r", 1, END, IDEAL), [*processes()[1:], ProcessSpec("a", "toy", "none", kill_ns=60 * MS)])
    one = frame(50)
    book.sent(one, 0)
    book.sent(frame(55), 0)
    book.told("b", told(10, State("awake")))
    book.told("b", told(70, State("asleep")))
    assert (book.leaving.left, book.leaving.ways) == (2, {"delivered": 2})
    assert [(e.t_ns // MS, e.process) for e in book.unsettled(60 * MS)] == [(10, "b"), (60, "a")]
    book.sent(gone(one), 1)
    assert (book.leaving.left, book.leaving.ways) == (1, {"delivered": 1})
    book.settle(65 * MS)
    assert [(e.t_ns // MS, e.process) for e in book.unsettled(80 * MS)] == [(70, "b")]
    assert (book.leaving.left, +book.leaving.ways) == (1, {})


# --- any order --------------------------------------------------------------------------------------------------------


@st.composite
def puts(draw: st.DrawFn) -> list[list[Put]]:
    """The puts of some frames: each one's, in order."""
    found = []
    to = st.sampled_from(["a", "b", NEIGHBOURHOOD])
    keys = st.tuples(st.sampled_from("abc"), to, st.integers(0, 40), st.integers(0, 1))
    for src, dst, t_ms, copy in draw(st.lists(keys, max_size=8, unique=True)):
        payloads = draw(st.lists(st.sampled_from([b"?", b"??", GONE]), min_size=1, max_size=4))
        payloads[0] = payloads[0] or b"!"
        found.append([(frame(t_ms, src, dst, copy=copy, payload=p), v) for v, p in enumerate(payloads)])
    return found


@given(puts(), st.data())
def test_any_order_of_samples_gives_the_ledger_of_what_is_left(story: list[list[Put]], data: st.DataObject) -> None:
    every = [put for each in story for put in each]
    doubled = every + (data.draw(st.lists(st.sampled_from(every), max_size=6)) if every else [])
    shuffled = data.draw(st.permutations(doubled))
    left = [each[-1] for each in story if each[-1][0].payload]
    mixed = ledger(LOSSY)
    for n, (one, version) in enumerate(shuffled):
        mixed.sent(one, version)
        to_come = [other.sent_ns for other, _ in shuffled[n + 1 :]]
        mixed.settle(min(to_come, default=END) - 1)
    mixed.close()
    ordered, clean = closed(*every, link=LOSSY), closed(*left, link=LOSSY)
    assert traces(mixed) == traces(ordered) == traces(clean)
    assert mixed.balance.puts == ordered.balance.puts
    for of in ("live", "due"):
        assert digests(getattr(mixed.balance, of)) == digests(getattr(ordered.balance, of))
    assert digests(mixed.balance.live) == {id: digest(own(left, id)) for id in "abc" if own(left, id)}
    assert sum(mixed.balance.puts.values()) == len(every)
    assert mixed.complaints() == []


def digests(sums: Mapping[str, Sum]) -> dict[str, Digest]:
    return {name: one.digest for name, one in sums.items()}


def own(left: Iterable[Put], src: str) -> list[Put]:
    return [put for put in left if put[0].src == src]


# --- what processes say -----------------------------------------------------------------------------------------------


def accounts(book: Ledger) -> dict[str, int]:
    """The sums; what was expected is accounted for."""
    sums, outcomes = book.sums(), Counter(row.outcome for row in book.rows)
    lost = sum(outcomes[cause] for cause in CAUSES)
    assert sums["expected"] == sums["delivered"] + lost + sums["host_lost"] + sums["host_late"]
    return sums


def test_what_all_say_the_same_of_is_right() -> None:
    one, two = frame(100), frame(200, to=NEIGHBOURHOOD)
    book = closed((one, 0), (gone(one), 1), (one, 2), (two, 0), (frame(9999.5), 0))
    live = [(one, 2), (two, 0), (frame(9999.5), 0)]
    book.final("a", {"puts": 5, **said("sent", digest(live)), **said("heard", Digest())})
    book.final("b", {"puts": 0, **said("sent", Digest()), **said("heard", digest(live[:2]))})
    book.final("c", {"puts": 0, **said("sent", Digest()), **said("heard", digest([(two, 0)]))})
    assert accounts(book) == {"expected": 4, "delivered": 3, "host_lost": 0, "host_late": 0}
    assert (book.dropped(), set(book.interference().values())) == (0, {0})


def test_frames_that_left_and_were_not_recorded_are_dropped() -> None:
    book = closed(*((frame(t_ms, to=NEIGHBOURHOOD), 0) for t_ms in (100, 200)))
    book.final("a", {"puts": 5, "sent": 4, "sent_hash": 7})
    book.final("c", {})
    assert (book.dropped(), book.interference()["frames"]) == (3, 0)
    assert accounts(book) == {"expected": 6, "delivered": 4, "host_lost": 2, "host_late": 0}


def test_more_puts_than_a_process_made_are_somebody_elses() -> None:
    one = frame(100)
    book = closed((one, 0), (gone(one), 1))
    book.final("a", {"puts": 1, **said("sent", digest([(one, 0)]))})
    assert (book.dropped(), book.interference()["frames"]) == (0, 1)


def test_as_many_puts_that_are_not_the_same_are_told() -> None:
    """One was forged, and one is missing."""
    book = closed((frame(100), 0), (frame(200), 0))
    book.final("a", {"puts": 2, **said("sent", digest([(frame(100), 0), (frame(201), 0)]))})
    assert (book.dropped(), book.interference()["frames"]) == (1, 1)


def test_what_a_process_leaves_out_of_its_record_is_not_compared() -> None:
    """One that is no part of Trackfield says no more than three counts, and cannot go back: corrections are counted."""
    one, two = frame(100), frame(200)
    book = closed((one, 0), (two, 0))
    book.final("a", final_of(msgpack.packb({"puts": 2, "sent": 2, "told": 0})))
    book.final("b", {"retractions": 0, **said("heard", digest([(one, 0), (two, 0)]))})
    assert accounts(book)["host_lost"] == 0
    assert (book.dropped(), set(book.interference().values()), book.foreign) == (0, {0}, {"a"})
    for record, dropped, strange in (({"puts": 3, "sent": 2}, 1, 0), ({"puts": 1, "sent": 1}, 0, 1)):
        book = closed((one, 0), (two, 0))
        book.final("a", final_of(msgpack.packb({**record, "told": 0})))
        assert (book.dropped(), book.interference()["frames"]) == (dropped, strange)


@pytest.mark.parametrize("missing", ["sent", "puts", "told"])
def test_a_record_without_its_counts_is_none(missing: str) -> None:
    record = {"sent": 2, "puts": 2, "told": 0, "slip": {1: 2}, "wakings": 3}
    assert final_of(msgpack.packb(record)) == record
    with pytest.raises(WireError, match="malformed"):
        final_of(msgpack.packb({key: value for key, value in record.items() if key != missing}))


def test_a_retraction_that_the_recorder_never_saw_is_told() -> None:
    one, two = frame(100), frame(200)
    book = closed((one, 0), (two, 0))
    book.final("a", {"puts": 3, **said("sent", digest([(two, 0)]))})
    book.final("b", said("heard", digest([(two, 0)])))
    assert book.dropped() == 1
    assert accounts(book)["host_lost"] == 1


def test_a_frame_that_its_hearer_never_saw_is_lost_by_the_host() -> None:
    """Whatever would have become of it there: it may have slept."""
    book = ledger()
    book.told("b", told(250, Radio(False)))
    frames = [frame(t_ms) for t_ms in (100, 200, 300)]
    for one in frames:
        book.sent(one, 0)
        book.sent(replace(one, to="c"), 0)
    book.close()
    for got, lost in ((frames, 0), (frames[1:], 1), (frames[:2], 1), ([], 3)):
        book.final("b", said("heard", digest((one, 0) for one in got)))
        assert accounts(book)["host_lost"] == lost
    book.final("b", {})
    book.final("c", said("heard", digest([(replace(frames[0], to="c"), 0)])))
    assert accounts(book)["host_lost"] == 2


@pytest.mark.parametrize("version", [0, 1])
def test_as_many_frames_that_are_not_the_same_are_lost_by_the_host(version: int) -> None:
    """It has another frame, or the version that was replaced."""
    one, two = frame(100), frame(200)
    book = closed((one, 0), (replace(one, payload=b"another"), 1))
    got = (one, 0) if version == 0 else (two, 1)
    book.final("b", said("heard", digest([got])))
    assert accounts(book) == {"expected": 1, "delivered": 0, "host_lost": 1, "host_late": 0}


def test_a_retraction_that_a_hearer_never_saw_is_lost_by_the_host() -> None:
    one, two = frame(100), frame(200)
    book = closed((one, 0), (gone(one), 1), (two, 0))
    book.final("a", {"puts": 3, **said("sent", digest([(two, 0)]))})
    book.final("b", said("heard", digest([(one, 0), (two, 0)])))
    assert accounts(book) == {"expected": 2, "delivered": 1, "host_lost": 1, "host_late": 0}
    assert book.dropped() == 0


def test_what_only_the_recorder_missed_was_delivered() -> None:
    one, two = frame(100), frame(200)
    book = closed((one, 0))
    book.final("a", {"puts": 2, **said("sent", digest([(one, 0), (two, 0)]))})
    book.final("b", said("heard", digest([(one, 0), (two, 0)])))
    assert accounts(book) == {"expected": 2, "delivered": 2, "host_lost": 0, "host_late": 0}
    assert book.dropped() == 1


def test_what_a_hearer_could_not_apply_any_more_is_late() -> None:
    """Of three frames two came too late, and one never."""
    book = closed(*((frame(t_ms), 0) for t_ms in (100, 200, 300, 400)))
    book.final("b", {"host_late": 2, **said("heard", digest([(frame(100), 0)]))})
    assert accounts(book) == {"expected": 4, "delivered": 1, "host_lost": 1, "host_late": 2}


def test_a_retraction_that_came_too_late_is_late() -> None:
    one = frame(100)
    book = closed((one, 0), (gone(one), 1))
    book.final("b", {"host_late": 1, **said("heard", digest([(one, 0)]))})
    assert accounts(book) == {"expected": 0, "delivered": 0, "host_lost": 0, "host_late": 0}
    assert book.balance.missed(book.finals).uncounted == 0


@pytest.mark.parametrize("back", [False, True])
def test_what_comes_after_a_last_word_is_late(back: bool) -> None:
    """A life that was killed said its last word; a frame for it, or word that one was taken back, comes after it."""
    lives = [ProcessSpec("b", "toy", "none", kill_ns=NS), ProcessSpec("b", "toy", "none", incarnation=1, start_ns=NS)]
    book = Ledger(RunSpec("r", 1, END, IDEAL), [ProcessSpec("a", "toy", "none"), *lives])
    one = frame(100)
    if back:
        book.sent(one, 0)
    book.final("b", said("heard", digest([(one, 0)] if back else [])))
    book.sent(gone(one) if back else one, int(back))
    book.sent(frame(1100), 0)
    book.close()
    book.final("b~1", said("heard", digest([(frame(1100), 0)])))
    late = 0 if back else 1
    assert accounts(book) == {"expected": 1 + late, "delivered": 1, "host_lost": 0, "host_late": late}
    assert book.balance.missed(book.finals).uncounted == 1


def test_a_frame_that_the_recorder_had_after_a_last_word_may_have_been_in_time() -> None:
    book = ledger()
    book.final("b", said("heard", digest([(frame(100), 0)])))
    book.sent(frame(100), 0)
    book.close()
    assert accounts(book)["host_late"] == book.balance.missed(book.finals).uncounted == 0


def test_telemetry_that_never_came_is_a_complaint() -> None:
    book = ledger()
    book.told("b", told(10, Note("one")))
    book.final("b", {"told": 1})
    assert book.complaints() == []
    book.final("b", {"told": 3})
    book.final("c", {"told": 1})
    assert book.complaints() == ["3 pieces of telemetry never reached the recorder: states or tracks may be missing"]
    assert book.balance.strange_telemetry(book.finals) == 0


def test_corrections_are_counted_for_each_place_that_may_have_heard_them() -> None:
    one, two = frame(100, to=NEIGHBOURHOOD), frame(200)
    book = closed((one, 0), (gone(one), 1), (two, 0), (replace(two, payload=b"new"), 1), (frame(300), 0))
    assert book.corrected == {"b": 2, "c": 1}
