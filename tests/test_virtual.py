"""The virtual driver: who hears what when, up to the end of the run, and the same every time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from tests.puppet import MS, Puppet
from tests.toys import Request, party
from trackfield.drivers.engine.frames import Frame, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.drivers.virtual import Virtual
from trackfield.link.fate import Fate
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Radio,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
    Write,
)

IDEAL: dict[str, Any] = {"model": "ideal"}

Plan = Sequence[tuple[int, Effect]]
"""What a role asks for at which time (ms)."""


def planned(plan: Plan) -> Puppet:
    """A role that does things at planned times; made by name, as every role of a run is."""

    def react(event: Event) -> list[Effect]:
        if isinstance(event, Started):
            return [SetTimer(f"{i:03}", t * MS) for i, (t, _) in enumerate(plan)]
        return [plan[int(event.name)][1]] if isinstance(event, Timer) else []

    return Puppet(react)


@dataclass
class Witness:
    """Sees all of a run, in the order in which it is shown."""

    frames: list[Frame] = field(default_factory=list)
    told_by: list[tuple[str, Told | Refused | Undone]] = field(default_factory=list)
    finals: dict[str, Mapping[str, Any]] = field(default_factory=dict)

    def sent(self, frame: Frame) -> None:
        self.frames.append(frame)

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        self.told_by.append((process, output))

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        self.finals[process] = record


def process(id: str, *plan: tuple[int, Effect], cell: str = "c0", cells: tuple[str, ...] = ()) -> ProcessSpec:
    return ProcessSpec(id, id, "tests.test_virtual:planned", {"plan": plan}, cell=cell, cells=cells)


def play(*processes: ProcessSpec, end_ns: int = NS, link: dict[str, Any] = IDEAL) -> tuple[Virtual, Witness]:
    witness = Witness()
    virtual = Virtual(RunSpec("v", 1, end_ns, link), processes, witness)
    virtual.run()
    return virtual, witness


def heard(virtual: Virtual, id: str) -> list[tuple[int, str, int]]:
    """When (ns), from whom and what this process received."""
    state: tuple[Event, ...] = virtual.cores[id].state
    return [(e.now, e.sender, e.message.chain) for e in state if isinstance(e, Received)]


# --- who hears it -------------------------------------------------------------------------------------------------


def test_a_frame_to_one_reaches_that_one_a_millisecond_later() -> None:
    virtual, witness = play(process("a", (5, Send(Request(7), "b"))), process("b"), process("c", cells=("c0",)))
    assert heard(virtual, "b") == [(6 * MS, "a", 7)]
    assert heard(virtual, "a") == heard(virtual, "c") == []
    assert [(f.src, f.to, f.sent_ns) for f in witness.frames] == [("a", "b", 5 * MS)]


def test_a_frame_to_several_is_a_transmission_to_each() -> None:
    send = Send(Request(7), frozenset({"b", "d", "nobody"}))
    virtual, witness = play(process("a", (5, send)), process("b"), process("c", cells=("c0",)), process("d"))
    assert heard(virtual, "b") == heard(virtual, "d") == [(6 * MS, "a", 7)]
    assert heard(virtual, "c") == []
    assert [f.to for f in witness.frames] == ["b", "d", "nobody"]


def test_a_broadcast_reaches_all_who_listen_to_the_senders_cell() -> None:
    """b listens to it, c to that and another, d to another only, e to none; a listens too, but hears not itself."""
    virtual, witness = play(
        process("a", (5, Send(Request(7), NEIGHBOURHOOD)), cells=("c0",)),
        process("b", cells=("c0",)),
        process("c", cells=("c0", "c1")),
        process("d", cells=("c1",)),
        process("e"),
    )
    assert [id for id in virtual.cores if heard(virtual, id)] == ["b", "c"]
    assert heard(virtual, "c") == [(6 * MS, "a", 7)]
    assert [f.to for f in witness.frames] == ["*"]


def test_who_stands_in_a_cell_need_not_listen_to_it() -> None:
    """A broadcast goes into the cell of its sender, whatever cells that one hears."""
    virtual, _ = play(
        process("a", (5, Send(Request(7), NEIGHBOURHOOD)), cell="c1", cells=("c0",)),
        process("b", cell="c1", cells=("c0",)),
        process("c", cell="c0", cells=("c1",)),
    )
    assert [id for id in virtual.cores if heard(virtual, id)] == ["c"]


def test_a_frame_to_nobody_known_is_sent_and_heard_by_none() -> None:
    virtual, witness = play(process("a", (5, Send(Request(7), "ghost"))), process("b", cells=("c0",)))
    assert [f.to for f in witness.frames] == ["ghost"]
    assert heard(virtual, "a") == heard(virtual, "b") == []


def test_one_can_write_to_oneself() -> None:
    virtual, _ = play(process("a", (5, Send(Request(7), "a"))))
    assert heard(virtual, "a") == [(6 * MS, "a", 7)]


def test_whoever_is_addressed_twice_at_one_instant_hears_both() -> None:
    sends = [(5, Send(Request(i), to)) for i, to in enumerate(("b", frozenset({"b", "c"}), "b", NEIGHBOURHOOD))]
    virtual, witness = play(process("a", *sends), process("b", cells=("c0",)), process("c"))
    assert sorted(heard(virtual, "b")) == [(6 * MS, "a", i) for i in range(4)]
    assert [(f.to, f.copy) for f in witness.frames] == [("b", 0), ("b", 1), ("c", 0), ("b", 2), ("*", 0)]


# --- what the link does -------------------------------------------------------------------------------------------


def test_the_link_delays() -> None:
    send = (5, Send(Request(7), "b"))
    virtual, _ = play(process("a", send), process("b"), link={"model": "fixed", "loss": 0, "delay_ms": 20})
    assert heard(virtual, "b") == [(25 * MS, "a", 7)]


def test_a_link_that_loses_all_delivers_nothing_but_all_is_sent() -> None:
    virtual, witness = play(
        process("a", (5, Send(Request(7), "b")), (6, Send(Request(8), NEIGHBOURHOOD))),
        process("b", cells=("c0",)),
        link={"model": "fixed", "loss": 1, "delay_ms": 1},
    )
    assert len(witness.frames) == 2
    assert heard(virtual, "b") == []
    assert virtual.cores["b"].tally == {}


def test_each_hearer_of_a_broadcast_has_a_fate_of_its_own() -> None:
    """40 broadcasts to 5 hearers at a loss of one half: no two lose the same ones (chance about 1e-11)."""
    virtual, _ = play(
        process("a", *((i, Send(Request(i), NEIGHBOURHOOD)) for i in range(1, 41))),
        *(process(f"b{i}", cells=("c0",)) for i in range(5)),
        link={"model": "fixed", "loss": 0.5, "delay_ms": 1},
    )
    got = {tuple(heard(virtual, f"b{i}")) for i in range(5)}
    assert len(got) == 5
    assert all(0 < len(mine) < 40 for mine in got)


def test_a_link_that_delivers_before_the_cause_is_refused() -> None:
    class Backwards:
        def fate(self, *frame: object) -> Fate:
            return Fate(None, -4 * MS)

    virtual = Virtual(RunSpec("v", 1, NS, IDEAL), [process("a", (5, Send(Request(7), "b"))), process("b")], Witness())
    virtual._link = Backwards()
    with pytest.raises(IllegalEvent, match="before it was sent"):
        virtual.run()


# --- time ---------------------------------------------------------------------------------------------------------


def test_events_before_the_end_are_handled_and_no_others() -> None:
    """The run ends at 10 ms: a timer or frame due then does not happen any more."""
    virtual, witness = play(
        process("a", (8, Send(Request(1), "b")), (9, Send(Request(2), "b")), (9, Note("last")), (10, Note("never"))),
        process("b"),
        end_ns=10 * MS,
    )
    assert heard(virtual, "b") == [(9 * MS, "a", 1)]
    assert [output.effect for _, output in witness.told_by if isinstance(output, Told)] == [Note("last")]
    assert len(witness.frames) == 2
    assert virtual.now_ns == 9 * MS


def test_the_last_nanosecond_belongs_to_the_run() -> None:
    virtual, _ = play(process("a", (10, Note("late"))), end_ns=10 * MS + 1)
    assert virtual.cores["a"].state[-1] == Timer(10 * MS, "000")


def test_a_run_of_no_length_does_not_even_start() -> None:
    virtual, _ = play(process("a"), end_ns=0)
    assert virtual.cores["a"].state == ()


def test_a_run_in_which_nothing_is_due_any_more_ends_early() -> None:
    virtual, _ = play(process("a", (5, Note("all"))), end_ns=10**18)
    assert virtual.now_ns == 5 * MS


def test_all_processes_share_one_time() -> None:
    """Whatever they do at the same instants is shown in the order of time, and of their ids' events within it."""
    plan = [(t, State(f"{t}")) for t in (1, 3, 2)]
    _, witness = play(process("b", *plan), process("a", *plan), process("c", *plan))
    told = [(output.key[0] // MS, who) for who, output in witness.told_by if isinstance(output, Told)]
    assert told == sorted(told)
    assert len(told) == 9


def test_an_earlier_event_that_comes_up_on_the_way_is_not_missed() -> None:
    """b waits for 50 ms; a frame at 11 ms and another one at 12 ms come first."""
    virtual, _ = play(
        process("a", (10, Send(Request(1), "b")), (11, Send(Request(2), "b"))),
        process("b", (50, Note("timer")), (5, Note("timer"))),
    )
    assert [type(e).__name__ for e in virtual.cores["b"].state] == ["Started", "Timer", "Received", "Received", "Timer"]
    assert [e.now // MS for e in virtual.cores["b"].state] == [0, 5, 11, 12, 50]


def test_it_can_be_stopped_between_any_two_events() -> None:
    virtual = Virtual(RunSpec("v", 1, NS, IDEAL), [process("a", *((t, Note(f"{t}")) for t in range(1, 9)))], Witness())
    virtual.run(stop=lambda: virtual.now_ns >= 4 * MS)
    assert virtual.cores["a"].state[-1].now == 4 * MS


# --- what is shown ------------------------------------------------------------------------------------------------


def test_telemetry_is_shown_with_its_process_and_time() -> None:
    _, witness = play(
        process("a", (5, State("awake")), (6, Radio(False)), (7, Ignored("late")), (8, Write("tty", b"x")))
    )
    assert witness.told_by == [
        ("a", Told((5 * MS, 3, 5 * MS, "000"), State("awake"))),
        ("a", Told((6 * MS, 3, 6 * MS, "001"), Radio(False))),
        ("a", Refused((7 * MS, 3, 7 * MS, "002"), "late")),
        ("a", Told((8 * MS, 3, 8 * MS, "003"), Write("tty", b"x"))),
    ]


def test_a_frame_is_shown_before_anything_comes_of_it() -> None:
    """The hub replies at once to what it hears, and after a second tells what it has and broadcasts it."""
    order: list[str] = []

    class Keen(Witness):
        def sent(self, frame: Frame) -> None:
            order.append(frame.kind)

        def told(self, process: str, output: Told | Refused | Undone) -> None:
            order.append(process)

    run, (hub, talker) = party(1, steps=1, link=IDEAL)
    Virtual(run, [hub, talker], Keen()).run()
    assert order[:3] == ["request", "reply", "feedback"]
    assert order[3:5] == ["hub", "t00"]


# --- the same every time ------------------------------------------------------------------------------------------

LINKS: dict[str, dict[str, Any]] = {
    "ideal": IDEAL,
    "fixed": {"model": "fixed", "loss": 0.2, "delay_ms": 5},
    "gilbert_elliott": {
        "model": "gilbert_elliott", "good_s": 5, "bad_s": 1, "loss_good": 0, "loss_bad": 1,
        "delay_ms": 20, "jitter_ms": 10,
    },
}  # fmt: skip


def party_story(link: str, *, seed: int = 1, reverse: bool = False) -> tuple[Witness, dict[str, Any]]:
    run, processes = party(6, steps=15, link=LINKS[link], seed=seed)
    witness = Witness()
    virtual = Virtual(run, processes[::-1] if reverse else processes, witness)
    virtual.run()
    return witness, {id: core.state for id, core in virtual.cores.items()}


@pytest.mark.parametrize("link", LINKS)
def test_a_run_tells_the_same_story_again(link: str) -> None:
    """Frames, telemetry and all states at the end; roles that talk back make any difference grow."""
    witness, states = party_story(link)
    assert len(witness.frames) > 100
    assert (witness, states) == party_story(link)


@pytest.mark.parametrize("link", LINKS)
def test_the_order_in_which_processes_are_named_leaves_no_trace(link: str) -> None:
    """What each of them sends and tells; between processes only the order within an instant may differ."""
    (one, states), (two, others) = party_story(link), party_story(link, reverse=True)
    assert states == others
    for id in states:
        assert [f for f in one.frames if f.src == id] == [f for f in two.frames if f.src == id]
        assert [o for who, o in one.told_by if who == id] == [o for who, o in two.told_by if who == id]


def test_another_seed_loses_other_frames() -> None:
    assert party_story("fixed", seed=1)[1] != party_story("fixed", seed=2)[1]


def test_no_frame_is_ever_out_of_order() -> None:
    run, processes = party(6, steps=15, link=LINKS["gilbert_elliott"])
    virtual = Virtual(run, processes, Witness())
    virtual.run()
    assert {(core.inversions, core.host_late, core.behind) for core in virtual.cores.values()} == {(0, 0, False)}
    assert virtual.cores["hub"].tally["delivered"] > 50


def test_a_frame_on_a_medium_that_one_does_not_have_never_comes() -> None:
    spec = ProcessSpec("a", "toy", "tests.toys:Hub", media=("field",), cells=("c0",))
    for to in ("a", NEIGHBOURHOOD):
        assert spec.hears("field", to, "b", "c0")
        assert not spec.hears("backbone", to, "b", "c0")
