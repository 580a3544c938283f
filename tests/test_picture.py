"""Batteries, deaths, faults and links in the pictures; what a large field costs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from launcher.records import FieldInfo, MessageRow, Place
from launcher.timeline import look, rows
from launcher.timeline.picture import PACE_NS
from launcher.timeline.timeline import Timeline
from tests.fake_run import CENTRE, NODE
from tests.rrd import entities, read
from trackfield.role import NS

MS = 1_000_000
ASLEEP, AWAKE, DEAD = (look.STATE_COLOURS[name] for name in ("asleep", "awake", "dead"))


@pytest.fixture(autouse=True, scope="module")
def strict() -> Iterator[None]:
    """Rerun swallows what it cannot log, unless it is told not to."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def field_of(count: int, **changes: Any) -> FieldInfo:
    """A row of sensors 100 m apart, with a centre beside them; a run of 100 s."""
    places = [Place(f"n{index}", "node", 100.0 * index, 0.0, NODE) for index in range(count)]
    every = (*places, Place("fusion", "fusion", 0.0, -50.0, CENTRE))
    info = FieldInfo("r", "s", every, (), (), 100.0, layers={place.id: "rays" for place in places})
    return dataclasses.replace(info, **changes)


Played = Callable[[FieldInfo, Callable[[Timeline], None]], Path]


@pytest.fixture
def played(tmp_path: Path) -> Played:
    """The file of a field after these calls."""

    def make(info: FieldInfo, calls: Callable[[Timeline], None]) -> Path:
        timeline = Timeline(tmp_path / "run.rrd", info)
        calls(timeline)
        timeline.close()
        return tmp_path / "run.rrd"

    return make


def report(src: str, sent_ns: int, outcome: str = "delivered", **changes: Any) -> MessageRow:
    row = MessageRow("doa", src, "fusion", "field", sent_ns, sent_ns + 20 * MS, outcome, 14, values=(90.0, 60.0))
    return dataclasses.replace(row, **changes)


# --- batteries ---------------------------------------------------------------------------------------------


def test_a_battery_is_a_ring_once_it_is_low(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.battery(0, "n0", 1.0)
        timeline.battery(0, "n1", 0.5)
        timeline.battery(1 * NS, "n0", 0.2)
        timeline.battery(2 * NS, "n1", 0.0)
        timeline.battery(3 * NS, "n0", 1.0)  # changed by hand
        timeline.battery(4 * NS, "stranger", 0.1)

    file = played(field_of(2), calls)
    yellow, red = look.share_colour(0.5), look.share_colour(0.0)  # of the last fifth
    found = read(file, "/field/battery", "Points2D:colors")
    assert found == [(1.0, [yellow]), (2.0, [yellow, red]), (3.0, [red]), (4.0, [red])]
    at = read(file, "/field/battery", "Points2D:positions")
    assert at[1:3] == [(2.0, [[0.0, 0.0], [100.0, 0.0]]), (3.0, [[100.0, 0.0]])]


def test_a_low_battery_is_drawn_anew_only_when_it_has_lost_a_twentieth(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        for step in range(1001):
            timeline.battery(step * 100 * MS, "n0", 1 - step / 1000)

    found = [t for t, _ in read(played(field_of(2), calls), "/field/battery", "Points2D:positions")]
    assert len(found) == 5


def test_shares_go_from_red_through_yellow_to_green() -> None:
    red, yellow, green = (tuple(look.share_colour(share).to_bytes(4)) for share in (0.0, 0.5, 1.0))
    assert red[0] > 200 > red[1] and min(yellow[:2]) > 200 and green[1] > 180 > green[0]
    between = look.share_colour(0.25).to_bytes(4)
    for a, b, c in zip(red, between, yellow, strict=True):
        assert min(a, c) <= b <= max(a, c)
    assert (look.share_colour(-0.1), look.share_colour(1.1)) == (look.share_colour(0.0), look.share_colour(1.0))


# --- deaths and faults -------------------------------------------------------------------------------------


def test_a_dead_sensor_is_crossed_out_until_it_lives_again(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(1 * NS, "n1", "awake")
        timeline.death(2 * NS, "n1", "battery empty")
        timeline.state(5 * NS, "n1", "asleep")

    file = played(field_of(2), calls)
    dead = read(file, "/field/dead", "LineStrips2D:strips")
    assert [(t, len(strokes)) for t, strokes in dead if t] == [(2.0, 2), (5.0, 0)]
    for one, other in dead[-2][1]:
        assert np.mean([one, other], axis=0) == pytest.approx([100.0, 0.0])
        assert 10.0 < math.dist(one, other) < 100.0
    assert read(file, "/field/working", "Points2D:colors") == [(1.0, [AWAKE]), (2.0, [])]
    assert [value[1] for _, value in read(file, "/network", "GraphNodes:colors")] == [ASLEEP, AWAKE, DEAD, ASLEEP]
    states = read(file, "/state/n1", "StateChange:state")
    assert states == [(1.0, ["awake"]), (2.0, ["dead"]), (5.0, ["asleep"])]


def test_a_dead_fusion_centre_is_crossed_out_too(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(1 * NS, "fusion", "tracking")
        timeline.death(2 * NS, "fusion", "killed")
        timeline.state(5 * NS, "fusion", "waiting")

    dead = read(played(field_of(2), calls), "/field/dead", "LineStrips2D:strips")
    assert [(t, len(strokes)) for t, strokes in dead if t] == [(2.0, 2), (5.0, 0)]


def test_a_death_told_of_after_the_next_life_began_comes_before_it(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(2_200 * MS, "n1", "awake")
        timeline.death(2 * NS, "n1", "killed")

    dead = read(played(field_of(2), calls), "/field/dead", "LineStrips2D:strips")
    assert [(t, len(strokes)) for t, strokes in dead if t] == [(2.0, 2), (2.2, 0)]


def test_faults_and_deaths_are_marks_with_a_lane_and_a_log_of_their_own(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.fault(10 * NS, "n0", "deaf until 30 s")
        timeline.death(20 * NS, "n1", "killed")
        timeline.death(20_500 * MS, "n2", "killed")
        timeline.fault(30 * NS, "n0", "deaf ends")

    file = played(field_of(3), calls)
    kept = [read(file, "/faults", f"TextLog:{name}") for name in ("text", "level", "color")]
    assert kept[0] == [
        (10.0, ["n0: deaf until 30 s"]),
        (20.0, ["n1: killed"]),
        (20.5, ["n2: killed"]),
        (30.0, ["n0: deaf ends"]),
    ]
    assert [value for _, (value,) in kept[1]] == ["WARN", "ERROR", "ERROR", "WARN"]
    assert [value for _, (value,) in kept[2]] == [look.LATE, look.LOST, look.LOST, look.LATE]
    assert read(file, "/faults", "StateChange:state") == [  # each as long as a hundredth of the run
        (10.0, ["n0: deaf until 30 s"]),
        (11.0, [""]),
        (20.0, ["n1: killed"]),
        (20.5, ["n1: killed and 1 more"]),
        (21.0, ["n2: killed"]),
        (21.5, [""]),
        (30.0, ["n0: deaf ends"]),
        (31.0, [""]),
    ]
    ((_, words),) = read(file, "/faults", "StateConfiguration:values")
    ((_, colours),) = read(file, "/faults", "StateConfiguration:colors")
    styles = dict(zip(words, colours, strict=True))
    assert styles["n0: deaf ends"] == look.LATE
    assert styles["n1: killed"] == styles["n1: killed and 1 more"] == look.LOST


def test_planned_faults_are_marked_once_and_only_as_far_as_the_run_came(played: Played) -> None:
    marks = ((10.0, "n0", "freeze until 20 s"), (20.0, "n0", "freeze ends"), (50.0, "n1", "kill"))

    def calls(timeline: Timeline) -> None:
        timeline.fault(10 * NS, "n0", "freeze until 20 s")
        timeline.state(30 * NS, "n0", "awake")

    texts = read(played(field_of(2, marks=marks), calls), "/faults", "TextLog:text")
    assert texts == [(10.0, ["n0: freeze until 20 s"]), (20.0, ["n0: freeze ends"])]


def test_a_process_that_moves_is_drawn_where_it_is(played: Played) -> None:
    legs = ((0, 0.0, -50.0), (2 * NS, 20.0, -50.0), (3 * NS, 20.0, -60.0))
    info = field_of(2, paths=(("fusion", legs),))
    file = played(info, lambda timeline: timeline.state(5 * NS, "n0", "awake"))
    at = {t: value for t, (value,) in read(file, "/field/moving", "Points2D:positions")}
    assert list(at) == [k / 4 for k in range(21)]
    assert [at[t] for t in (0.0, 0.25, 2.5, 5.0)] == [[0.0, -50.0], [2.5, -50.0], [20.0, -55.0], [20.0, -60.0]]
    assert read(file, "/field/moving", "Points2D:labels") == [(None, ["fusion"])]
    assert [value for _, value in read(file, "/field/centres", "Points2D:positions")] == [[]]


# --- clocks, queues, links, messages -----------------------------------------------------------------------


def test_clock_errors_and_queues_are_plots(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.clock_error(100 * MS, "n0", 3.0)
        timeline.clock_error(200 * MS, "n1", -4.0)
        timeline.queue(300 * MS, "n1", 5)
        timeline.queue(1_300 * MS, "n1", 1)

    file = played(field_of(2), calls)
    clock = read(file, "/plots/clock", "Scalars:scalars")
    assert clock == [(1.0, [pytest.approx(math.sqrt(12.5)), 4.0])]
    assert read(file, "/plots/queue", "Scalars:scalars") == [(0.0, [0]), (1.0, [5]), (2.0, [1])]


def test_links_are_coloured_by_their_reception(played: Played) -> None:
    links = (("n0", "fusion", 1.0), ("fusion", "n0", 0.25), ("n1", "fusion", 0.5))
    file = played(field_of(2, receptions=links), lambda _: None)
    ((_, strips),) = read(file, "/links/reception", "LineStrips2D:strips")
    assert strips == [[[0, 0], [0, -25]], [[0, -50], [0, -25]], [[100, 0], [0, -50]]]
    ((_, colours),) = read(file, "/links/reception", "LineStrips2D:colors")
    assert colours == [look.share_colour(share) for _, _, share in links]
    ((_, labels),) = read(file, "/links/reception", "LineStrips2D:labels")
    assert labels == ["n0 → fusion: 100.0%", "fusion → n0: 25.0%", "n1 → fusion: 50.0%"]


def test_without_links_there_is_no_view_of_them(played: Played) -> None:
    assert not [path for path in entities(played(field_of(2), lambda _: None)) if path.startswith("/links")]


def test_the_table_of_messages_has_a_row_for_each(played: Played) -> None:
    """Frames sent at one instant and lost have rows of their own: the table shows one row per instant."""

    def calls(timeline: Timeline) -> None:
        timeline.message(report("n0", 2 * NS, local_ns=2_003_500_000))
        timeline.message(report("n1", 2 * NS, "radio"))
        timeline.message(report("n0", 2 * NS, "radio", kind="sync", due_ns=None, local_ns=2 * NS))

    file = played(field_of(2), calls)
    frame, local, received, sent = (read(file, "/times", name) for name in rows.TIMES)
    assert sorted(value[0] for _, value in frame) == ["n0 → fusion doa", "n0 → fusion sync", "n1 → fusion doa"]
    assert {t for t, _ in frame} == {2.0, 2.000000001, 2.02}
    table = dict(zip([value[0] for _, value in frame], zip(local, received, sent, strict=True), strict=True))
    cells = {name: tuple(value for _, value in row) for name, row in table.items()}
    assert cells == {
        "n0 → fusion doa": ([2.0035], [2.02], [2.0]),
        "n1 → fusion doa": ([], [], [2.0]),
        "n0 → fusion sync": ([2.0], [], [2.0]),
    }


def test_instants_of_a_table_are_moved_apart_and_no_further_than_needed() -> None:
    assert rows.apart(np.array([5, 5, 5, 6, 20, 20])).tolist() == [5, 6, 7, 8, 20, 21]
    assert rows.apart(np.empty(0, np.int64)).tolist() == []


# --- large fields ------------------------------------------------------------------------------------------


def test_of_a_large_network_only_those_are_drawn_that_have_to_do_with_something(played: Played) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(1 * NS, "n7", "awake")
        timeline.message(report("n9", 2 * NS))
        timeline.message(report("n11", 3 * NS, "radio"))

    file = played(field_of(look.WHOLE_NETWORK), calls)
    ids = [(t, set(value)) for t, value in read(file, "/network", "GraphNodes:node_ids")]
    assert ids == [
        (0.0, {"fusion"}),
        (1.0, {"fusion", "n7"}),
        (2.05, {"fusion", "n7", "n9"}),
        (3.0, {"fusion", "n7", "n11"}),
        (4.0, {"fusion", "n7"}),
    ]
    colours = read(file, "/network", "GraphNodes:colors")
    assert sorted(colours[1][1]) == sorted([ASLEEP, AWAKE])


def test_a_layer_of_many_points_is_drawn_less_often_but_its_end_is_right(played: Played) -> None:
    count, step = 1000, 10 * MS

    def calls(timeline: Timeline) -> None:
        for index in range(count):
            timeline.state(index * step, f"n{index}", "awake")

    file = played(field_of(count), calls)
    found = read(file, "/field/working", "Points2D:colors")
    assert len(found[-1][1]) == count
    for (t, before), (after, _) in pairwise(found[:-1]):
        assert after is not None and t is not None
        assert (after - t) * NS >= min(len(before) * PACE_NS, 50 * MS)
    assert len(found) < 100
    assert max(t or 0 for t, _ in found) <= count * step / NS + 0.05


def test_what_was_put_off_is_drawn_when_nothing_else_happens(played: Played) -> None:
    count = 500

    def calls(timeline: Timeline) -> None:
        for index in range(count):
            timeline.state(0, f"n{index}", "awake")
        timeline.state(100 * MS, "n0", "asleep")  # too soon after the picture of all
        timeline.clock_error(60 * NS, "n0", 0.0)
        timeline.flush()

    found = read(played(field_of(count), calls), "/field/working", "Points2D:positions")
    assert [(t, len(at)) for t, at in found] == [(0.0, 500), (0.2, 499)]


def test_a_lane_that_no_view_shows_begins_with_the_first_thing_its_sensor_does(played: Played) -> None:
    count = look.ALL_LANES + 50

    def calls(timeline: Timeline) -> None:
        for index in range(count):
            timeline.state(0, f"n{index}", "asleep")
        timeline.state(5 * NS, f"n{count - 1}", "awake")
        timeline.state(6 * NS, f"n{count - 1}", "asleep")

    file = played(field_of(count), calls)
    shown = {place.id for place in look.lanes(field_of(count))[: look.ALL_LANES]} - {"fusion"}
    lanes = {path.removeprefix("/state/") for path in entities(file) if path.startswith("/state/")}
    assert lanes == shown | {f"n{count - 1}"}
    states = read(file, f"/state/n{count - 1}", "StateChange:state")
    assert states == [(0.0, ["asleep"]), (5.0, ["awake"]), (6.0, ["asleep"])]


def test_a_file_grows_with_what_happens_and_not_with_the_field(tmp_path: Path) -> None:
    def size(count: int, steps: int) -> int:
        file = tmp_path / "run.rrd"
        timeline = Timeline(file, field_of(count))
        for index in range(count):
            timeline.state(0, f"n{index}", "asleep")
        for step in range(1, steps):
            name = f"n{step % 40}"
            timeline.state(step * NS // 8, name, "awake" if step % 3 else "asleep")
            timeline.battery(step * NS // 8, name, 0.5 + 0.5 * (step % 7) / 7)
            timeline.message(report(name, step * NS // 8))
        timeline.close()
        return file.stat().st_size

    small, large = (size(count, 300) - size(count, 1) for count in (3_000, 30_000))
    assert 10_000 < large < 1.1 * small
