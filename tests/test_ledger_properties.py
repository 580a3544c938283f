"""The ledger against plainer accounts of the same run: one written here, and the hearers' own counters."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.ledger import Ledger
from launcher.record.metrics import CAUSES
from launcher.records import ARRIVED
from tests.simulated import simulated, spcpf
from trackfield.drivers.engine.frames import Frame, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.drivers.virtual import Virtual
from trackfield.link.fate import Transmission
from trackfield.link.models import make_link
from trackfield.role import (
    NEIGHBOURHOOD,
    Effect,
    Event,
    Ignored,
    Note,
    Radio,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
)
from trackfield.wire.messages import Doa

MS = 1_000_000
END = 100 * MS
IDS = ("a", "b", "c")
HEARERS = {NEIGHBOURHOOD: IDS, "a": ("a",), "b": ("b",), "c": ("c",)}


@dataclass(frozen=True)
class Story:
    """What happens in a run: frames by (source, address, ms), switches of radios, refusals, who dies, when it ends."""

    link: dict[str, Any]
    frames: tuple[Frame, ...]
    switches: dict[str, list[tuple[int, bool]]]
    refusals: dict[int, str]
    counted: dict[str, int]
    end_ns: int


@st.composite
def stories(draw: st.DrawFn) -> Story:
    ms = st.integers(0, 110)
    loss, delay = draw(st.sampled_from([0.0, 0.4, 1.0])), draw(st.integers(1, 20))
    sends = draw(st.lists(st.tuples(st.sampled_from(IDS), st.sampled_from(list(HEARERS)), ms), max_size=12))
    copies: Counter[Any] = Counter()
    frames = []
    for src, to, t in sends:
        frames.append(Frame(src, 0, "doa", t * MS, copies[src, to, t], to, "field", b"?"))
        copies[src, to, t] += 1
    switches = {id: sorted(draw(st.lists(st.tuples(ms, st.booleans()), max_size=4))) for id in IDS}
    refusals = draw(st.dictionaries(st.integers(0, 11), st.sampled_from(["late", "repeated", "kind"]), max_size=4))
    dead = draw(st.dictionaries(st.sampled_from(IDS), st.integers(0, 6), max_size=2))
    link = {"model": "fixed", "loss": loss, "delay_ms": delay}
    return Story(link, tuple(frames), switches, refusals, dead, draw(st.integers(1, 100)) * MS)


def run_of(story: Story) -> RunSpec:
    return RunSpec("r", 1, END, story.link)


def book_of(story: Story) -> Ledger:
    """A ledger that saw all of it but its close."""
    book = Ledger(run_of(story), [ProcessSpec(id, "toy", "none", cells=("c0",)) for id in IDS])
    for id, switches in story.switches.items():
        for t, on in switches:
            book.told(id, Told((t * MS, 3, t * MS, "t"), Radio(on)))
    link = make_link(story.link, 1)
    for number, frame in enumerate(story.frames):
        book.sent(frame)
        for id in IDS:
            if number in story.refusals:
                delay = link.fate(Transmission(frame.src, id, frame.kind, frame.sent_ns, frame.copy, 1)).delay_ns
                book.told(id, Refused(frame.key(frame.sent_ns + delay), story.refusals[number]))
    book.end(story.end_ns)
    return book


def plainly(story: Story, number: int, id: str) -> str:
    """What became of a frame at a hearer that did not die."""
    frame = story.frames[number]
    if frame.sent_ns >= END:
        return "in_flight"  # not due in this run, whatever the link would do; a peer may write any time
    fate = make_link(story.link, 1).fate(Transmission(frame.src, id, frame.kind, frame.sent_ns, frame.copy, 1))
    due = frame.sent_ns + fate.delay_ns
    if fate.cause:
        return fate.cause
    if due >= story.end_ns:
        return "in_flight"
    if not [True, *(on for t, on in story.switches[id] if t * MS < due)][-1]:
        return "asleep"
    reason = story.refusals.get(number)
    return "delivered" if reason is None else "late" if reason == "late" else "ignored"


def expected_of(story: Story) -> Counter[tuple[str, str, int, str]]:
    """(source, hearer, sent, outcome) of every frame and hearer, as if nobody died."""
    return Counter(
        (frame.src, id, frame.sent_ns, plainly(story, number, id))
        for number, frame in enumerate(story.frames)
        for id in HEARERS[frame.to]
        if frame.to != NEIGHBOURHOOD or id != frame.src
    )


@given(stories())
def test_every_frame_and_hearer_has_one_outcome_and_it_is_the_right_one(story: Story) -> None:
    book = book_of(story)
    book.close()
    assert Counter((row.src, row.dst, row.sent_ns, row.outcome) for row in book.rows) == expected_of(story)


@given(stories())
def test_all_that_was_expected_was_delivered_or_lost_whoever_died(story: Story) -> None:
    book = book_of(story)
    book.counts = {id: {"delivered": n} for id, n in story.counted.items()}
    book.close(dead=story.counted)
    outcomes = Counter(row.outcome for row in book.rows)
    delivered = sum(row.delivered for row in book.rows)
    assert len(book.rows) == delivered + sum(outcomes[cause] for cause in CAUSES)
    for id in IDS:
        got = sum(row.delivered for row in book.rows if row.dst == id)
        dead = sum(row.outcome == "dead" for row in book.rows if row.dst == id)
        due = sum(n for (_, dst, _, outcome), n in expected_of(story).items() if dst == id and outcome in ARRIVED)
        assert got + dead == due
        assert got == min(due, story.counted.get(id, due))


@given(stories(), st.lists(st.integers(0, 120), max_size=5))
def test_settling_bit_by_bit_comes_to_the_same(story: Story, stops: list[int]) -> None:
    whole, parts = book_of(story), book_of(story)
    handed_out = [row for stop in sorted(stops) for row in parts.settle(stop * MS)[0]]
    handed_out += parts.close()[0]
    whole.close()
    assert handed_out == parts.rows == whole.rows


Telling = tuple[int, int]
"""(ms, what is told: a radio's switch, a state, a refusal)"""


def output(t: int, what: int) -> Told | Refused:
    key = (t * MS, 3, t * MS, "t")
    match what:
        case 0 | 1:
            return Told(key, Radio(bool(what)))
        case 2 | 3:
            return Told(key, State(str(what)))
    return Refused(Frame("a", 0, "doa", (t - 1) * MS, 0, "b", "field", b"?").key(t * MS), "late")


@given(
    st.lists(st.tuples(st.integers(1, 99), st.integers(0, 4)), max_size=12),
    st.lists(st.tuples(st.integers(1, 99), st.integers(0, 4)), max_size=6),
    st.integers(1, 99),
)
def test_undoing_and_telling_anew_is_as_if_only_that_had_been_told(
    first: list[Telling], anew: list[Telling], since: int
) -> None:
    books = []
    before = [t for t in sorted(first) if t[0] < since]
    after = [t for t in sorted(anew) if t[0] >= since]
    for story in ([*sorted(first), None, *after], [*before, *after]):
        book = Ledger(RunSpec("r", 1, END, {"model": "ideal"}), [ProcessSpec("b", "toy", "none")])
        for telling in story:
            book.told("b", Undone((since * MS,)) if telling is None else output(*telling))
        for t in range(100):
            book.sent(Frame("a", 0, "doa", t * MS, 0, "b", "field", b"?"))
        books.append((*book.close(), book.rows))
    assert books[0] == books[1]


# --- beside the counters of those who were there ----------------------------------------------------------------------


class Chatty:
    """Sends to everybody and to two by name, every 5 ms."""

    kinds: frozenset[str] = frozenset()

    def begin(self) -> None:
        return None

    def handle(self, state: None, event: Event) -> tuple[None, tuple[Effect, ...]]:
        report = Doa(1, 0.0, 60.0)
        named, again = Send(report, frozenset({"s0", "s1"})), SetTimer("talk", event.now + 5 * MS)
        return state, (Send(report, NEIGHBOURHOOD), named, named, again)


class Sleepy:
    """Switches its radio every ``every_ms``; has no use for half of what it hears."""

    kinds = frozenset({"doa"})

    def __init__(self, *, every_ms: int) -> None:
        self.every_ms = every_ms

    def begin(self) -> tuple[bool, int]:
        return True, 0

    def handle(self, state: tuple[bool, int], event: Event) -> tuple[tuple[bool, int], tuple[Effect, ...]]:
        on, heard = state
        again = SetTimer("switch", event.now + self.every_ms * MS)
        match event:
            case Started():
                return state, (again,)
            case Timer():
                return (not on, heard), (Radio(not on), Note("switched"), again)
            case Received():
                reason = ("late", "repeated", None, None)[heard % 4]
                return (on, heard + 1), (Ignored(reason),) if reason else ()
        raise AssertionError(event)


@pytest.mark.parametrize("link", [{"model": "ideal"}, {"model": "fixed", "loss": 0.3, "delay_ms": 10}])
def test_what_hearers_counted_is_what_the_ledger_says(link: dict[str, Any]) -> None:
    """Switches fall on the very instants at which frames are due; ideal 1, 6, 11 ms ..., fixed 10, 15, 20 ms ..."""
    here = "tests.test_ledger_properties"
    sleepers = [
        ProcessSpec(f"s{n}", "sleepy", f"{here}:Sleepy", {"every_ms": ms}, cells=("c0",))
        for n, ms in enumerate((1, 5, 7, 20))
    ]
    processes = [ProcessSpec("chatty", "chatty", f"{here}:Chatty"), *sleepers]
    run = RunSpec("r", 1, 400 * MS + 1, link)
    book = Ledger(run, processes)
    virtual = Virtual(run, processes, book)
    virtual.run()
    book.close()
    for sleeper in sleepers:
        mine = Counter(row.outcome for row in book.rows if row.dst == sleeper.id)
        tally = virtual.cores[sleeper.id].tally
        assert mine["late"] == tally["late"] > 5
        assert mine["ignored"] == tally["ignored"] > 5
        assert mine["asleep"] == tally["asleep"] > 5
        assert mine["delivered"] + mine["late"] + mine["ignored"] == tally["delivered"]
        assert mine["in_flight"] > 0
    assert book.sent_kinds["doa"] == (1 + 2 + 2) * 81
    assert len(book.rows) == (4 + 2 + 2) * 81


def test_reports_that_take_longer_than_the_deadline_are_late() -> None:
    plan = spcpf(1, ["link.model=fixed", "link.loss=0", "link.delay_ms=301", "target.steps=10"])
    book, tracks = simulated(plan)
    outcomes = Counter(row.outcome for row in book.rows)
    assert set(outcomes) == {"late"}
    assert book.finals["fusion"]["late"] == book.finals["fusion"]["delivered"] == outcomes["late"] > 20
    assert book.sums()["host_lost"] == book.dropped() == 0
    assert {row.point.reports for row in tracks} == {0}


def test_reports_within_the_deadline_are_all_fused() -> None:
    plan = spcpf(1, ["link.model=fixed", "link.loss=0", "link.delay_ms=299", "target.steps=10"])
    book, tracks = simulated(plan)
    assert {row.outcome for row in book.rows} == {"delivered"}
    fused = sum(row.point.reports for row in tracks if row.point.tracker == "spcpf")
    assert 0 < fused == sum(row.step is not None and row.step >= 1 for row in book.rows)
