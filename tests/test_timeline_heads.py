"""Nodes of which any may lead on the timeline: who leads, claims and polls, hand-overs, and what is said of terms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from launcher.records import BATTERY, PEER, SENSES, TRACKS, FieldInfo, MessageRow, Place, Truth
from launcher.timeline import look
from launcher.timeline.layers.heads import EVENTS
from launcher.timeline.timeline import Timeline
from tests.rrd import entities, read, views
from trackfield.role import NS
from trackfield.wire.clusters import HandOverAck
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.messages import HopAck
from trackfield.wire.peers import Claim, Poll

PLACES = {"base": (0.0, 0.0), "a": (100.0, 0.0), "b": (0.0, 100.0), "c": (110.0, 10.0), "d": (10.0, 110.0)}
IDS = tuple(PLACES)[1:]


def field(origin_ns: int = 0) -> FieldInfo:
    """A base, and nodes a to d of which any may lead."""
    tags = frozenset({SENSES, TRACKS, BATTERY})
    places = [Place(id, PEER, *PLACES[id], tags) for id in IDS]
    base = Place("base", "base", *PLACES["base"], frozenset({TRACKS}))
    way = Truth("target", ((0.0, 0.0, 90.0), (2.0, 90.0, 0.0)))
    return FieldInfo("small", "small", (base, *places), (way,), ("ukf",), 10.0, origin_ns=origin_ns)


def frame(second: float, src: str, dst: str, message: Any, outcome: str = "delivered") -> MessageRow:
    sent_ns = round(second * NS)
    return MessageRow(kind_name(message), src, dst, "field", sent_ns, sent_ns, outcome, 3, payload=encode(message))


def poll(second: float, src: str, dst: str, *sensors: str, step: int = 0, outcome: str = "delivered") -> MessageRow:
    numbers = b"".join(IDS.index(id).to_bytes(2, "little") for id in sensors)
    return frame(second, src, dst, Poll(1, step or int(second) + 1, numbers), outcome)


def header(timeline: Timeline, second: float, process: str, name: str) -> None:
    timeline.state(round(second * NS), process, name, "header")


def drawn(folder: Path, tell: Callable[[Timeline], object], info: FieldInfo | None = None) -> Path:
    timeline = Timeline(folder / "run.rrd", info or field())
    tell(timeline)
    timeline.close()
    return folder / "run.rrd"


def pictures(file: Path, entity: str, component: str) -> dict[float, Any]:
    return {t: value for t, value in read(file, entity, component) if t}


def lines(file: Path, part: str) -> dict[float, set[tuple[tuple[float, ...], ...]]]:
    """The lines of each picture of an entity, by time."""
    found = pictures(file, f"/field/{part}", "LineStrips2D:strips")
    return {t: {tuple(map(tuple, strip)) for strip in strips} for t, strips in found.items()}


def line(*ids: str) -> tuple[tuple[float, float], ...]:
    return tuple(PLACES[id] for id in ids)


def rings(file: Path) -> dict[float, list[tuple[tuple[float, ...], int, str]]]:
    """Place, colour and name of each ring, by time."""
    parts = [pictures(file, "/field/heads", f"Points2D:{part}") for part in ("positions", "colors", "labels")]
    return {t: list(zip(map(tuple, parts[0][t]), parts[1][t], parts[2][t], strict=True)) for t in parts[0]}


def lane(file: Path) -> list[tuple[float, str]]:
    return [(t, value[0]) for t, value in pictures(file, EVENTS, "StateChange:state").items()]


def said(file: Path) -> list[tuple[float, str]]:
    return [(t or 0.0, text[0]) for t, text in read(file, EVENTS, "TextLog:text")]


def test_each_head_has_a_ring_with_its_name_and_two_make_the_lane_red(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        header(timeline, 1.0, "a", "leading")
        header(timeline, 2.0, "b", "leading")
        header(timeline, 3.0, "a", "following")
        header(timeline, 4.0, "b", "idle")

    file = drawn(tmp_path, tell)
    a, b = ((PLACES[id], look.CENTRE, id) for id in ("a", "b"))
    assert rings(file) == {1.0: [a], 2.0: [a, b], 3.0: [b], 4.0: []}
    assert lane(file) == [(1.0, "a"), (2.0, "a and b"), (3.0, "b"), (4.0, "")]
    [words], [colours] = ([value for _, value in read(file, EVENTS, f"StateConfiguration:{part}")]
                          for part in ("values", "colors"))  # fmt: skip
    assert dict(zip(words, colours, strict=True)) == {"a": look.CENTRE, "a and b": look.LOST, "b": look.CENTRE}


def test_a_head_that_dies_leads_no_more(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        header(timeline, 1.0, "a", "leading")
        timeline.death(3 * NS, "a", "killed")

    file = drawn(tmp_path, tell)
    assert lane(file) == [(1.0, "a"), (3.0, "")]
    assert pictures(file, "/field/dead", "LineStrips2D:strips")[3.0]


def test_a_claim_has_a_ring_until_the_election_is_over_and_a_line_of_text(tmp_path: Path) -> None:
    """Node a wins. The one of b lasts until it follows; that of c, which says nothing more, for two steps."""

    def tell(timeline: Timeline) -> None:
        for dst in ("b", "c", "d"):
            timeline.message(frame(1.0, "a", dst, Claim(1, 20, 9), "radio"))
        timeline.message(frame(1.1, "b", "a", Claim(1, 30, 9)))
        timeline.message(frame(1.2, "c", "a", Claim(1, 40, 9)))
        header(timeline, 1.5, "a", "leading")
        timeline.note(round(1.5 * NS), "a", "a leads in term 1: elected")
        header(timeline, 2.0, "b", "following")
        header(timeline, 2.1, "d", "electing")
        timeline.state(5 * NS, "d", "asleep", "member")

    file = drawn(tmp_path, tell)
    claimed = {id: (PLACES[id], look.ELECTING, "") for id in IDS}
    led = PLACES["a"], look.CENTRE, "a"
    assert rings(file) == {
        1.0: [claimed["a"]],
        1.1: [claimed["a"], claimed["b"]],
        1.2: [claimed["a"], claimed["b"], claimed["c"]],
        1.5: [claimed["b"], claimed["c"], led],
        2.0: [claimed["c"], led],
        3.2: [led],
    }
    assert [word for _, word in lane(file)] == ["election"] * 3 + ["a"] * 3
    assert said(file) == [
        (1.0, "a claims term 1, with key 20"),
        (1.1, "b claims term 1, with key 30"),
        (1.2, "c claims term 1, with key 40"),
        (1.5, "a leads in term 1: elected"),
    ]


def test_only_notes_of_terms_are_among_the_heads(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.note(NS, "a", "yields to b, term 4")
        timeline.note(2 * NS, "a", "nearer to the target, and out of reach: n7")
        timeline.note(3 * NS, "base", "knows of term 5")

    assert said(drawn(tmp_path, tell)) == [(1.0, "a: yields to b, term 4")]


def test_a_head_is_tied_to_those_that_it_polls_for_that_step(tmp_path: Path) -> None:
    """Lost or heard; to itself there is no line. The next poll replaces it, and without one it ends with the step."""

    def tell(timeline: Timeline) -> None:
        for dst, outcome in (("b", "radio"), ("c", "delivered"), ("d", "asleep")):
            timeline.message(poll(0.9, "a", dst, "a", "c", "b", outcome=outcome))
        timeline.message(poll(1.9, "a", "b", "d"))
        timeline.message(poll(2.0, "b", "c", "c", step=2))
        timeline.state(6 * NS, "d", "asleep", "member")

    found = lines(drawn(tmp_path, tell), "polled")
    assert found == {
        0.9: {line("a", "c"), line("a", "b")},
        1.9: {line("a", "d")},
        2.0: {line("a", "d"), line("b", "c")},
        3.0: set(),
    }


def test_steps_of_polls_count_from_the_first_step(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(poll(5.9, "a", "b", "c", step=1))
        timeline.state(9 * NS, "d", "asleep", "member")

    assert lines(drawn(tmp_path, tell, field(origin_ns=5 * NS)), "polled") == {0.9: {line("a", "c")}, 2.0: set()}


def test_a_hand_over_is_an_arrow_for_two_steps(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(2.0, "b", "a", HandOverAck(2), "radio"))
        timeline.state(5 * NS, "d", "asleep", "member")

    first, second = lines(drawn(tmp_path, tell), "handed-over").items()
    assert (first[0], second) == (2.0, (4.0, set()))
    [arrow] = first[1]
    assert (arrow[0], arrow[1], arrow[3]) == (*line("a", "b"), PLACES["b"])
    assert arrow[2] != arrow[4]
    tip, barbs = PLACES["b"], (arrow[2], arrow[4])
    assert all(abs(x - tip[0]) + abs(y - tip[1]) < 50 for x, y in barbs), "they are at the tip"


def test_a_way_to_the_base_is_the_last_hop_that_was_acknowledged(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(1.0, "b", "a", HopAck(b"a", 1)))
        timeline.message(frame(3.0, "base", "a", HopAck(b"a", 2)))
        timeline.message(frame(4.0, "b", "a", HopAck(b"a", 3), "radio"))

    assert lines(drawn(tmp_path, tell), "ways") == {1.0: {line("a", "b")}, 3.0: {line("a", "base")}}


def test_a_sensor_has_the_colour_of_its_member(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.state(NS, "a", "active", "member")
        header(timeline, 1.5, "a", "polled")
        header(timeline, 1.7, "b", "electing")
        timeline.state(2 * NS, "a", "asleep", "member")

    file = drawn(tmp_path, tell)
    assert pictures(file, "/field/working", "Points2D:colors") == {1.0: [look.state_colour("active")], 2.0: []}
    assert pictures(file, "/state/a/header", "StateChange:state") == {1.5: ["polled"]}


def test_what_is_malformed_or_names_strangers_is_not_drawn(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        odd = replace(poll(1.9, "a", "b", "c"), payload=b"?")
        timeline.message(odd)
        timeline.message(replace(odd, sent_ns=2 * NS, payload=encode(Poll(1, 3, b"\xff\xff\x00"))))
        timeline.message(frame(3.0, "nobody", "a", Claim(1, 2, 3)))

    file = drawn(tmp_path, tell)
    assert not any(lines(file, "polled").values())
    assert said(file) == []


def test_there_is_a_tab_and_a_legend(tmp_path: Path) -> None:
    file = drawn(tmp_path, lambda _: None)
    assert read(file, "/field/legend/names", "Points2D:labels")[0][1][:5] == [
        "asleep", "sensing", "active", "electing", "leading",
    ]  # fmt: skip
    assert {"Heads", "Messages", "Node states"} <= views(file).keys()


@pytest.mark.parametrize("lane", ["", "header"])
def test_without_such_nodes_there_are_no_such_parts(tmp_path: Path, lane: str) -> None:
    places = (Place("fusion", "fusion", 0.0, 0.0), Place("a", "node", 1.0, 0.0, frozenset({SENSES})))
    info = FieldInfo("small", "small", places, (), ("ukf",), 10.0)

    def tell(timeline: Timeline) -> None:
        timeline.state(NS, "a", "leading", lane)
        timeline.message(poll(1.9, "a", "fusion"))
        timeline.note(NS, "a", "a leads in term 1")

    file = drawn(tmp_path, tell, info)
    assert not entities(file) & {"/field/heads", "/field/polled", "/field/handed-over", EVENTS}
    assert "Heads" not in views(file)
    assert pictures(file, "/field/working", "Points2D:colors") == {1.0: [look.state_colour("leading")]}
