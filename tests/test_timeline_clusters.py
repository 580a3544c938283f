"""Masters and slaves on the timeline: who belongs to whom, who leads, hand-overs, and the ways to the base."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.records import MASTER, SENSES, SLAVE, TRACKS, FieldInfo, MessageRow, Place, Truth
from launcher.timeline import look, views
from launcher.timeline.timeline import Timeline
from tests.rrd import entities, read
from trackfield.protocols.association.joining import NO_PLACE
from trackfield.role import NS, TrackPoint
from trackfield.wire.clusters import Admit, HandOverAck
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.messages import HopAck

PLACES = {"base": (0.0, 0.0), "a": (100.0, 0.0), "b": (0.0, 100.0), "s0": (110.0, 10.0), "s1": (10.0, 110.0)}


def field(masters: int = 2) -> FieldInfo:
    """A base, masters and two slaves; further masters are far away."""
    more = [Place(f"m{i}", MASTER, 500.0 + i, 500.0, frozenset({TRACKS})) for i in range(masters - 2)]
    roles = {"base": "base", "a": MASTER, "b": MASTER, "s0": SLAVE, "s1": SLAVE}
    places = [
        Place(id, roles[id], *at, frozenset({SENSES}) if roles[id] == SLAVE else frozenset({TRACKS}))
        for id, at in PLACES.items()
    ]
    way = Truth("target", ((0.0, 0.0, 90.0), (1.0, 1.0, 95.0), (2.0, 90.0, 0.0)))
    return FieldInfo("small", "small", (*places, *more), (way,), ("ukf",), 10.0)


def frame(second: float, src: str, dst: str, message: Any, outcome: str = "delivered") -> MessageRow:
    sent_ns = round(second * NS)
    return MessageRow(kind_name(message), src, dst, "field", sent_ns, sent_ns, outcome, 3, payload=encode(message))


def drawn(folder: Path, tell: Callable[[Timeline], object], info: FieldInfo | None = None) -> Path:
    timeline = Timeline(folder / "run.rrd", info or field())
    tell(timeline)
    timeline.close()
    return folder / "run.rrd"


def lines(file: Path, part: str) -> list[tuple[float, set[tuple[tuple[float, ...], ...]]]]:
    """The lines of each picture of an entity, by time."""
    found = read(file, f"/field/{part}", "LineStrips2D:strips")
    return [(t or 0.0, {tuple(map(tuple, strip)) for strip in strips}) for t, strips in found]


def line(*ids: str) -> tuple[tuple[float, float], ...]:
    return tuple(PLACES[id] for id in ids)


def test_a_slave_is_tied_to_the_master_that_admits_it_until_it_looks_for_another(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(1.0, "a", "s0", Admit(0, 3, 1)))
        timeline.message(frame(1.0, "a", "s1", Admit(0, 3, 1)))  # overheard
        timeline.message(frame(2.0, "b", "s1", Admit(1, NO_PLACE, 0)))
        timeline.message(frame(3.0, "a", "s1", Admit(1, 0, 0), "ignored"))
        timeline.message(frame(4.0, "b", "s1", Admit(1, 0, 0)))
        timeline.state(6 * NS, "s0", "orphan")

    file = drawn(tmp_path, tell)
    first, second, last = [one for one in lines(file, "members") if one[0]]
    assert first == (1.0, {line("s0", "a")})
    assert second == (4.0, {line("s0", "a"), line("s1", "b")})
    assert last == (6.0, {line("s1", "b")})


def test_the_leader_is_marked_with_its_name_and_helpers_without(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.state(NS, "a", "leading")
        timeline.state(2 * NS, "b", "helping")
        timeline.state(3 * NS, "a", "following")

    file = drawn(tmp_path, tell)
    at, colours, labels = (
        {t: value for t, value in read(file, "/field/leading", f"Points2D:{part}") if t}
        for part in ("positions", "colors", "labels")
    )
    assert at == {1.0: [list(PLACES["a"])], 2.0: [list(PLACES["b"]), list(PLACES["a"])], 3.0: [list(PLACES["b"])]}
    assert colours[2.0] == [look.HELPING, look.CENTRE]
    assert labels == {1.0: ["a"], 2.0: ["", "a"], 3.0: [""]}


def test_a_hand_over_is_a_line_for_two_steps(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(2.0, "b", "a", HandOverAck(2)))
        timeline.state(5 * NS, "s0", "active")

    file = drawn(tmp_path, tell)
    assert [one for one in lines(file, "handed-over") if one[0]] == [(2.0, {line("a", "b")}), (4.0, set())]


def test_a_way_to_the_base_is_the_last_hop_that_was_acknowledged(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(1.0, "b", "a", HopAck(b"a", 1)))
        timeline.message(frame(3.0, "base", "a", HopAck(b"a", 2)))
        timeline.message(frame(4.0, "b", "a", HopAck(b"a", 3), "radio"))

    file = drawn(tmp_path, tell)
    assert [one for one in lines(file, "ways") if one[0]] == [(1.0, {line("a", "b")}), (3.0, {line("a", "base")})]


def test_what_is_malformed_or_of_strangers_is_not_drawn(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        odd = frame(1.0, "a", "s0", Admit(0, 3, 1))
        timeline.message(MessageRow(odd.kind, "a", "s0", "field", NS, NS, "delivered", 1, payload=b"?"))
        timeline.message(frame(2.0, "nobody", "s0", Admit(0, 3, 1)))

    assert [one for one in lines(drawn(tmp_path, tell), "members") if one[1]] == []


def test_without_masters_there_are_no_such_parts(tmp_path: Path) -> None:
    places = (Place("fusion", "fusion", 0.0, 0.0), Place("s0", "node", 1.0, 0.0, frozenset({SENSES})))
    info = FieldInfo("small", "small", places, (), ("ukf",), 10.0)
    file = drawn(tmp_path, lambda timeline: timeline.state(NS, "fusion", "leading"), info)
    parts = {f"/field/{part}" for part in ("members", "ways", "handed-over", "leading", "masters")}
    assert not entities(file) & parts
    assert read(file, "/field/legend/names", "Points2D:labels")[0][1][:3] == ["asleep", "awake", "reporting"]


def test_the_legend_names_the_states_of_slaves(tmp_path: Path) -> None:
    file = drawn(tmp_path, lambda _: None)
    assert read(file, "/field/legend/names", "Points2D:labels")[0][1][:3] == ["asleep", "active", "orphan"]


@pytest.mark.parametrize(("masters", "small"), [(2, False), (30, True)])
def test_many_masters_are_small_and_without_names(tmp_path: Path, masters: int, small: bool) -> None:
    file = drawn(tmp_path, lambda _: None, field(masters))
    named = read(file, "/field/centres", "Points2D:positions")[0][1]
    assert len(named) == (1 if small else masters + 1)
    assert ("/field/masters" in entities(file)) == small


def test_of_many_masters_those_that_the_target_passes_have_the_first_lanes() -> None:
    names = [place.id for place in look.lanes(field(30))]
    assert names[:6] == ["base", "b", "a", "m0", "s1", "s0"]
    assert sorted(names) == sorted(place.id for place in field(30).places)
    assert [place.id for place in look.lanes(field())] == ["base", "a", "b", "s1", "s0"], "a few stand as they are"


# --- tracks -----------------------------------------------------------------------------------------------------------


def led(source: str, step: int, term: int, x: float) -> TrackPoint:
    covariance = tuple(np.eye(4).ravel().tolist())
    mean = (x, 0.0, 0.0, 0.0)
    return TrackPoint("ukf", "target", step * NS, "tracking", mean, covariance, step=step, term=term, source=source)


def test_those_who_take_turns_have_one_track_that_of_the_higher_term(tmp_path: Path) -> None:
    info = replace(field(), headline=("a", "b"))

    def tell(timeline: Timeline) -> None:
        for point in (led("a", 1, 1, 1.0), led("a", 2, 1, 2.0), led("b", 3, 2, 3.0), led("a", 3, 1, 70.0)):
            timeline.estimate(point, (0.0, 0.0))
        timeline.estimate(led("b", 4, 2, 4.0), (0.0, 0.0))
        timeline.estimate(led("a", 4, 1, 80.0), (0.0, 0.0))
        timeline.estimate(led("base", 4, 2, 9.0), (0.0, 0.0))
        timeline.death(5 * NS, "b", "killed")
        timeline.state(8 * NS, "s0", "active")

    file = drawn(tmp_path, tell, info)
    track = read(file, "/field/ukf/track", "LineStrips2D:strips")
    legs = [[point[0] for point in strip] for t, strips in track if t for strip in strips]
    assert legs == [[1.0, 2.0], [2.0, 3.0], [3.0, 4.0]]
    at = read(file, "/field/ukf/position", "Points2D:positions")
    assert [(t, [x for x, _ in points]) for t, points in at] == [
        (1.0, [1.0]), (2.0, [2.0]), (3.0, [3.0]), (4.0, [4.0]), (5.0, []),
    ]  # fmt: skip
    errors = read(file, "/plots/error/ukf", "Scalars:scalars")
    assert [(t, *values) for t, values in errors][:4] == [(t, t) for t in (1.0, 2.0, 3.0, 4.0)]
    assert read(file, "/field/ukf/base/position", "Points2D:positions")[0][0] == 4.0
    assert views.labels(info, "error") == ["bound", "ukf, base", "ukf"]
