"""Processes that are killed and live again, stand still, are cut off or run out of power, in virtual time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from launcher.record.ledger import Ledger
from launcher.record.metrics import CAUSES
from trackfield.drivers.engine.frames import Died
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core
from trackfield.drivers.virtual import Virtual
from trackfield.link.models import make_link
from trackfield.role import Effect, Event, Received, Send, SetTimer, Started, Store, Timer
from trackfield.wire.messages import Doa

MS = 1_000_000
END = 100 * MS
IDEAL: dict[str, Any] = {"model": "ideal"}
HERE = "tests.test_lives"


@dataclass(frozen=True)
class Past:
    """What this life was given, and all that happened to it."""

    given: bytes = b""
    events: tuple[Event, ...] = ()


class Diarist:
    """Keeps how many lives there were; sends a report to ``to`` every ``every_ms``."""

    kinds = frozenset({"doa"})

    def __init__(self, *, to: str = "", every_ms: int = 10) -> None:
        self.to, self.every_ns = to, every_ms * MS

    def begin(self) -> Past:
        return Past()

    def handle(self, state: Past, event: Event) -> tuple[Past, tuple[Effect, ...]]:
        state = replace(state, events=(*state.events, event))
        match event:
            case Started(now, stored):
                timer = (SetTimer("report", now + self.every_ns),) if self.to else ()
                return replace(state, given=stored), (Store(stored + b"+"), *timer)
            case Timer(now):
                report = Send(Doa(now // MS, 0.0, 60.0), self.to)
                return state, (report, SetTimer("report", now + self.every_ns))
        return state, ()


def talker(id: str = "a", **spec: Any) -> ProcessSpec:
    return ProcessSpec(id, "node", f"{HERE}:Diarist", {"to": "b"}, **spec)


def hearer(id: str = "b", **spec: Any) -> ProcessSpec:
    return ProcessSpec(id, "node", f"{HERE}:Diarist", **spec)


def lives(spec: ProcessSpec, *spans: tuple[int, int | None]) -> list[ProcessSpec]:
    """The process in each of these (from ms, until ms)."""
    return [
        replace(spec, incarnation=i, start_ns=start * MS, kill_ns=None if kill is None else kill * MS)
        for i, (start, kill) in enumerate(spans)
    ]


def played(
    processes: Iterable[ProcessSpec], *, link: dict[str, Any] = IDEAL, cuts: Any = (), queue: int = 32
) -> tuple[Virtual, Ledger]:
    run = RunSpec("r", 1, END, link, partitions=cuts, queues={"field": queue})
    processes = list(processes)
    book = Ledger(run, processes)
    virtual = Virtual(run, processes, book)
    virtual.run()
    book.close()
    return virtual, book


def heard(virtual: Virtual, name: str) -> list[int]:
    """When (ms)."""
    return [event.now // MS for event in virtual.cores[name].state.events if isinstance(event, Received)]


def outcomes(book: Ledger) -> dict[int, str]:
    """Of each frame, by when (ms) it was sent."""
    return {row.sent_ns // MS: row.outcome for row in book.rows}


# --- one life after the other -----------------------------------------------------------------------------------------


def test_each_life_owns_the_frames_due_in_it() -> None:
    """b is killed at 31 ms and up again at 61: the frame due at 31 is nobody's, that of 61 is the second life's."""
    virtual, book = played([talker(), *lives(hearer(), (0, 31), (61, None))])
    assert heard(virtual, "b") == [11, 21]
    assert heard(virtual, "b~1") == [61, 71, 81, 91]
    dead = {t for t, outcome in outcomes(book).items() if outcome == "dead"}
    assert dead == {30, 40, 50}
    assert book.sums()["host_lost"] == 0


def test_a_life_follows_another_without_a_gap() -> None:
    virtual, book = played([talker(), *lives(hearer(), (0, 31), (31, 61), (61, None))])
    assert [heard(virtual, name) for name in ("b", "b~1", "b~2")] == [[11, 21], [31, 41, 51], [61, 71, 81, 91]]
    assert set(outcomes(book).values()) == {"delivered"}


def test_what_was_kept_is_handed_from_life_to_life() -> None:
    virtual, _ = played(lives(hearer(), (0, 10), (20, 30), (40, None)))
    assert [virtual.cores[name].state.given for name in ("b", "b~1", "b~2")] == [b"", b"+", b"++"]
    assert [virtual.cores[name].record(END)["stored"] for name in ("b", "b~1", "b~2")] == [b"+", b"++", b"+++"]


def test_frames_of_two_lives_are_not_the_same() -> None:
    """a sends at 10, is killed and up again at 20: its first life's frame and its second's differ."""
    _, book = played([*lives(talker(), (0, 15), (20, None)), hearer()])
    sent = [(row.sent_ns // MS, row.incarnation) for row in book.rows]
    assert sent == [(10, 0), *((t, 1) for t in range(30, 100, 10))]
    assert book.sent_by == {"a": 1, "a~1": 7}


def test_a_battery_lasts_through_all_lives() -> None:
    """At 5 uW listening, 250 000 fJ are enough for 50 ms of being up: 30 in the first life, 20 in the second."""
    power = {"send_uw": 5, "receive_uw": 5, "listen_uw": 5, "sleep_uw": 1, "battery_fj": 5 * 50 * MS}
    virtual, book = played([talker(), *lives(hearer(power=power), (0, 30), (45, 90), (92, None))])
    assert heard(virtual, "b~1") == [51, 61]
    assert [d.died and d.died[0] // MS for d in (book.diaries[n] for n in ("b", "b~1", "b~2"))] == [None, 65, 92]
    assert [virtual.cores[n].record(END)["metered_ns"] // MS for n in ("b", "b~1", "b~2")] == [30, 20, 0]
    assert {t for t, outcome in outcomes(book).items() if outcome == "dead"} == {30, 40, 70, 80, 90}
    assert virtual.cores["b~2"].state.events == ()
    assert book.sums()["host_lost"] == 0


def test_an_empty_battery_keeps_nobody_from_hearing_what_is_due_then() -> None:
    """Empty at 21 ms: a frame due then is heard, for what it draws is what it would draw anyway."""
    power = {"send_uw": 5, "receive_uw": 5, "listen_uw": 5, "sleep_uw": 1, "battery_fj": 5 * 21 * MS}
    virtual, book = played([talker(), hearer(power=power)])
    assert heard(virtual, "b") == [11, 21]
    assert Counter(outcomes(book).values()) == {"delivered": 2, "dead": 7}
    assert [e.effect for e in book.diaries["b"].told if isinstance(e.effect, Died)] == [Died("battery")]
    assert book.sums()["host_lost"] == 0


# --- standing still, cut off, the clock ------------------------------------------------------------------------------


def test_who_stands_still_hears_nothing_and_says_late_what_was_to_be_said() -> None:
    virtual, book = played([talker(freezes=((35 * MS, 67 * MS),)), hearer(freezes=((11 * MS, 21 * MS),))])
    assert sorted(outcomes(book)) == [10, 20, 30, 67, 77, 87, 97]
    assert heard(virtual, "b") == [21, 31, 68, 78, 88, 98]
    assert outcomes(book)[10] == "frozen"
    assert virtual.cores["b"].tally == {"frozen": 1, "delivered": 6}


def test_who_is_cut_off_hears_nothing_of_what_was_sent_then() -> None:
    """From 20 to 50 ms: what is sent at 20 is lost, what is sent at 50 is not."""
    virtual, book = played([talker(), hearer()], cuts=((20 * MS, 50 * MS, ["b"], None),))
    assert heard(virtual, "b") == [11, 51, 61, 71, 81, 91]
    assert {t for t, outcome in outcomes(book).items() if outcome == "partition"} == {20, 30, 40}


def test_those_who_are_cut_off_together_hear_each_other() -> None:
    virtual, _ = played([talker(), hearer()], cuts=((20 * MS, 50 * MS, ["a", "b"], None),))
    assert len(heard(virtual, "b")) == 9


def test_a_clock_that_jumps_as_a_life_begins_has_jumped_before() -> None:
    """The very first thing that a role sees is the clock after the jump, and the ledger says the same of its frames."""
    spec = talker(clock={"offset_ns": 3}, jumps=((0, 500 * MS),))
    virtual, book = played([spec, hearer()])
    assert virtual.cores["a"].state.events[:2] == (Started(500 * MS + 3), Timer(510 * MS + 3, "report"))
    assert [row.sent_ns // MS for row in book.rows] == [*range(10, 100, 10)]
    assert {row.local_ns - row.sent_ns for row in book.rows if row.local_ns} == {500 * MS + 3}


def test_a_later_life_has_the_clock_with_all_its_jumps() -> None:
    spec = talker(clock={"drift_ppb": 10**6}, jumps=((10 * MS, 7), (50 * MS, 11), (60 * MS, 13)))
    link = make_link(IDEAL, 1)
    for start, shown in ((0, 0), (10, 10 * MS + 10_000 + 7), (50, 50 * MS + 50_000 + 18), (70, 70 * MS + 70_000 + 31)):
        core = build_core(RunSpec("r", 1, END, IDEAL), replace(spec, start_ns=start * MS), link)
        core.handle_next()
        assert core.state.events == (Started(shown),)
        assert [at for at, _ in core.conditions.jumps] == [at for at, _ in spec.jumps if at > start * MS]


# --- all of it at a time ---------------------------------------------------------------------------------------------


def test_every_frame_has_one_outcome_whatever_befalls_its_hearer() -> None:
    """Cut off, standing still, killed, up again, empty: what is expected is delivered and lost, to the last frame."""
    power = {"send_uw": 5, "receive_uw": 5, "listen_uw": 5, "sleep_uw": 1, "battery_fj": 5 * 70 * MS}
    b = replace(hearer(power=power), freezes=((22 * MS, 33 * MS),))
    first, second = lives(b, (0, 45), (55, None))
    virtual, book = played([talker(), first, replace(second, freezes=())], cuts=((9 * MS, 12 * MS, ["b"], None),))
    assert outcomes(book) == {
        10: "partition", 20: "delivered", 30: "frozen", 40: "delivered", 50: "dead", 60: "delivered", 70: "delivered",
        80: "dead", 90: "dead",
    }  # fmt: skip
    counts = Counter(row.outcome for row in book.rows)
    assert len(book.rows) == sum(row.delivered for row in book.rows) + sum(counts[cause] for cause in CAUSES)
    assert book.sums()["host_lost"] == 0
    assert virtual.cores["b"].tally == {"delivered": 2, "frozen": 1}


def test_frames_that_find_the_queue_full_are_expected_and_lost() -> None:
    """On LoRa at SF 9 a report takes 0.2 s: of one every 10 ms one is on its way and two wait."""
    link = {"model": "lognormal_prr", "radio": "lora868", "tx_dbm": 60.0}
    _, book = played([talker(), replace(hearer(), x=10.0)], link=link, queue=2)
    counts = Counter(row.outcome for row in book.rows)
    assert counts == {"in_flight": 3, "overflow": 6}
    assert {row.sent_ns // MS for row in book.rows if row.outcome == "overflow"} == {40, 50, 60, 70, 80, 90}
    assert sum(book.sent_kinds.values()) == 3


def test_nothing_of_it_needs_a_second_run_to_be_the_same() -> None:
    power = {"send_uw": 5, "receive_uw": 5, "listen_uw": 5, "sleep_uw": 1, "battery_fj": 5 * 70 * MS}
    plan = [talker(clock={"offset_ns": -5 * MS}), *lives(hearer(power=power), (0, 45), (55, None))]
    (_, one), (_, two) = (played(order) for order in (plan, plan[::-1]))
    assert sorted(one.rows, key=lambda row: row.sent_ns) == sorted(two.rows, key=lambda row: row.sent_ns)
    assert one.finals == two.finals
