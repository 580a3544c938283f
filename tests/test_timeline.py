"""What the timeline of a run holds, read back from the file."""

from __future__ import annotations

import dataclasses
import math
import random
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from launcher.records import TRACKS, FieldInfo, MessageRow, Place, Truth
from launcher.timeline import look, outlook, rows
from launcher.timeline.timeline import Timeline
from tests import fake_run
from tests.rrd import entities, read, verify
from trackfield.role import NS, TrackPoint

MS = 1_000_000


@pytest.fixture(autouse=True, scope="module")
def strict() -> Iterator[None]:
    """Rerun swallows what it cannot log, unless it is told not to."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


# --- a whole run ------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Played:
    file: Path
    info: FieldInfo
    calls: list[fake_run.Call]

    def made(self, method: str) -> list[tuple[Any, ...]]:
        return [arguments for _, name, arguments in self.calls if name == method]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory, strict: None) -> Played:
    file = tmp_path_factory.mktemp("run") / "run.rrd"
    info = fake_run.info(gaps=((20.0, 24.0),))
    calls = list(fake_run.calls(info))
    timeline = Timeline(file, info)
    fake_run.play(timeline, iter(calls))
    timeline.close()
    return Played(file, info, calls)


def test_the_file_is_whole(played: Played) -> None:
    done = verify(played.file)
    assert done.returncode == 0, done.stderr


def test_a_file_that_was_not_closed_is_found_out(tmp_path: Path) -> None:
    timeline = Timeline(tmp_path / "run.rrd", fake_run.info(side=2, steps=2))
    timeline.flush()
    shutil.copy(tmp_path / "run.rrd", tmp_path / "torn.rrd")
    timeline.close()
    assert verify(tmp_path / "run.rrd").returncode == 0
    assert verify(tmp_path / "torn.rrd").returncode != 0


def test_every_part_of_the_picture_is_there(played: Played) -> None:
    lanes = {f"/state/{place.id}" for place in played.info.places}
    tracks = {f"/field/{t}/{part}" for t in fake_run.TRACKERS for part in ("position", "ellipse", "track")}
    assert entities(played.file) - {"/"} == lanes | tracks | {
        "/field",
        "/field/sensors",
        "/field/working",
        "/field/dead",
        "/field/battery",
        "/field/centres",
        "/field/rays",
        "/field/truth/target/path",
        "/field/truth/target/interpolated",
        "/field/truth/target/position",
        "/field/legend/dots",
        "/field/legend/names",
        "/field/legend/dead",
        "/field/legend/battery",
        "/closeup/target",
        "/closeup/target/zoom",
        "/closeup/target/zoom/scale",
        "/closeup/target/zoom/legend/dots",
        "/closeup/target/zoom/legend/names",
        "/field/spcpf/particles",
        "/field/imm-ukf/particles",  # its style only, see below
        "/network",
        "/messages/doa",
        "/times",
        "/faults",
        "/links",
        "/links/reception",
        "/links/sensors",
        "/links/centres",
        "/links/frames",
        "/links/lost",
        "/links/legend/dots",
        "/links/legend/names",
        "/notes",
        "/plots/clock",
        "/plots/queue",
        "/plots/error/bound",
        "/plots/error/imm-ukf",
        "/plots/error/spcpf",
        "/plots/latency",
        "/plots/lost",
        "/plots/bytes",
    }


def test_only_the_timeline_of_emulated_time_is_there(played: Played) -> None:
    chunks = RrdReader(played.file).stream().filter(content="/field/**").to_chunks()
    assert {name for chunk in chunks for name in chunk.timeline_names} == {look.TIME}


def test_every_message_is_listed_at_its_time(played: Played) -> None:
    rows = [row for (row,) in played.made("message")]
    texts = read(played.file, "/messages/doa", "TextLog:text")
    expected = Counter(((row.due_ns or row.sent_ns) / NS, row.src) for row in rows)
    assert Counter((t, text[0].split()[0]) for t, text in texts) == expected
    assert len(texts) == len(rows) > 500


def test_lost_and_late_frames_stand_out(played: Played) -> None:
    outcomes = Counter(row.outcome for (row,) in played.made("message"))
    kept = {
        name: [value[0] for _, value in read(played.file, "/messages/doa", f"TextLog:{name}")]
        for name in ("text", "level", "color")
    }
    listed = Counter(zip(kept["level"], kept["color"], strict=True))
    assert listed == {
        ("INFO", look.INFO): outcomes["delivered"],
        ("WARN", look.LATE): outcomes["late"],
        ("ERROR", look.LOST): outcomes["radio"],
    }
    assert outcomes["late"] > 5 and outcomes["radio"] > 20
    for text, level in zip(kept["text"], kept["level"], strict=True):
        assert ("LOST: radio" in text) == (level == "ERROR")
        assert text.endswith("LATE") == (level == "WARN")


def test_every_state_is_on_its_lane_at_its_time(played: Played) -> None:
    made = Counter((t, process, name) for t, process, name in played.made("state"))
    made += Counter((t, process, "dead") for t, process, _ in played.made("death"))
    found = Counter(
        (round(t * NS), place.id, value[0])
        for place in played.info.places
        for t, value in read(played.file, f"/state/{place.id}", "StateChange:state")
        if t is not None
    )
    assert found == made


def test_the_truth_is_drawn_and_its_gap_flagged(played: Played) -> None:
    at = read(played.file, "/field/truth/target/position", "Points2D:positions")
    assert [(t, *map(pytest.approx, value[0])) for t, value in at] == list(played.info.truths[0].points)
    path = read(played.file, "/field/truth/target/path", "LineStrips2D:strips")
    guessed = read(played.file, "/field/truth/target/interpolated", "LineStrips2D:strips")
    assert [t for t, _ in guessed] == [20.25 + k / 4 for k in range(16)]
    assert len(path) + len(guessed) == len(played.info.truths[0].points) - 1
    for (_, before), (_, after) in pairwise(path[:20]):
        assert before[0][1] == after[0][0]  # a chain
    notes = read(played.file, "/notes", "TextLog:text")
    assert (20.0, ["target: path interpolated until 24 s"]) in notes


def test_tracks_errors_and_particles(played: Played) -> None:
    for tracker in fake_run.TRACKERS:
        points = [(p.at_ns / NS, p, truth) for p, truth in played.made("estimate") if p.tracker == tracker]
        tracking = [(t, p, truth) for t, p, truth in points if p.mean]
        assert len(points) == 60 and len(tracking) == 57

        at = read(played.file, f"/field/{tracker}/position", "Points2D:positions")
        assert [(t, len(value)) for t, value in at] == [(t, int(bool(p.mean))) for t, p, _ in points]
        assert [value[0] for _, value in at if value] == [pytest.approx(p.mean[:2], abs=1e-3) for _, p, _ in tracking]
        track = read(played.file, f"/field/{tracker}/track", "LineStrips2D:strips")
        assert [value[0][1] for _, value in track] == [value[0] for _, value in at if value][1:]
        rings = read(played.file, f"/field/{tracker}/ellipse", "LineStrips2D:strips")
        assert [len(value) for _, value in rings] == [len(value) for _, value in at]
        errors = read(played.file, f"/plots/error/{tracker}", "Scalars:scalars")
        assert errors == [(t, [pytest.approx(math.dist(p.mean[:2], truth))]) for t, p, truth in tracking]

        particles = read(played.file, f"/field/{tracker}/particles", "Points2D:positions")
        assert [len(value) for _, value in particles] == ([200] * 57 if tracker == "spcpf" else [])
        for (_, p, _), (_, value) in zip(tracking, particles, strict=False):
            assert np.array(value, "<f4").tobytes() == p.particles


def test_losses_and_bytes_add_up(played: Played) -> None:
    rows = [row for (row,) in played.made("message")]
    lost = read(played.file, "/plots/lost", "Scalars:scalars")
    assert lost[0] == (0.0, [0, 0])
    assert lost[-1][1] == [sum(not r.delivered for r in rows), sum(r.outcome == "late" for r in rows)]
    sums = np.sum([value for _, value in read(played.file, "/plots/bytes", "Scalars:scalars")], axis=0)
    assert list(sums) == [sum(r.bytes for r in rows), sum(r.bytes for r in rows if r.delivered)]
    assert [t for t, _ in lost] == list(range(len(lost)))


def test_calls_out_of_order_give_the_same_picture(played: Played, tmp_path: Path) -> None:
    rng = random.Random(3)
    jittered = sorted(played.calls, key=lambda call: call[0] + rng.uniform(0, 0.3) * NS)
    states: dict[str, list[int]] = {}
    for _, name, arguments in jittered:
        if name == "state":
            states.setdefault(arguments[1], []).append(arguments[0])
    assert jittered != played.calls
    timeline = Timeline(tmp_path / "run.rrd", played.info)
    fake_run.play(timeline, iter(jittered))
    timeline.close()
    for entity, component in (
        ("/field/working", "Points2D:colors"),
        ("/field/dead", "LineStrips2D:strips"),
        ("/field/battery", "Points2D:colors"),
        ("/network", "GraphNodes:colors"),
        ("/network", "GraphEdges:edges"),
        ("/plots/lost", "Scalars:scalars"),
        ("/plots/bytes", "Scalars:scalars"),
        ("/plots/latency", "Scalars:scalars"),
        ("/plots/clock", "Scalars:scalars"),
        ("/plots/queue", "Scalars:scalars"),
        ("/field/spcpf/position", "Points2D:positions"),
        ("/state/fusion", "StateChange:state"),
    ):
        assert read(tmp_path / "run.rrd", entity, component) == read(played.file, entity, component), entity


# --- small fields, exact answers --------------------------------------------------------------------------

PLACES = (
    Place("fusion", "fusion", 0.0, 0.0, fake_run.CENTRE),
    Place("n1", "node", -100.0, 0.0, fake_run.NODE),
    Place("n2", "node", 100.0, 50.0, fake_run.NODE),
)
Small = Callable[[Callable[[Timeline], None]], Path]


def small_info(**changes: Any) -> FieldInfo:
    info = FieldInfo("small", "small", PLACES, (), ("one",), 10.0, layers={"n1": "rays", "n2": "rays"})
    return dataclasses.replace(info, **changes)


@pytest.fixture
def small(tmp_path: Path) -> Small:
    """The file of a field of two sensors after these calls."""

    def make(calls: Callable[[Timeline], None]) -> Path:
        timeline = Timeline(tmp_path / "small.rrd", small_info())
        calls(timeline)
        timeline.close()
        return tmp_path / "small.rrd"

    return make


def report(src: str, sent_ms: int, delay_ms: int, outcome: str = "delivered", **changes: Any) -> MessageRow:
    sent = sent_ms * MS
    due = sent + delay_ms * MS
    row = MessageRow("doa", src, "fusion", "field", sent, due, outcome, 14, values=(90.0, 60.0))
    return dataclasses.replace(row, **changes)


def track_point(step: float, mean: tuple[float, ...] = (), tracker: str = "one") -> TrackPoint:
    covariance = tuple(np.eye(4).ravel()) if mean else ()
    return TrackPoint(tracker, "target", round(step * NS), "tracking" if mean else "waiting", mean, covariance)


def test_sensors_are_asleep_until_told_otherwise(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(3 * NS, "n2", "reporting")
        timeline.state(5 * NS, "n2", "asleep")

    file = small(calls)
    asleep, reporting = look.STATE_COLOURS["asleep"], look.STATE_COLOURS["reporting"]
    assert read(file, "/field/sensors", "Points2D:colors") == [(None, [asleep])]
    assert read(file, "/field/sensors", "Points2D:labels") == [(None, ["n1", "n2"])]
    assert read(file, "/field/working", "Points2D:positions") == [(3.0, [[100.0, 50.0]]), (5.0, [])]
    assert read(file, "/field/working", "Points2D:colors") == [(3.0, [reporting]), (5.0, [])]
    assert read(file, "/network", "GraphNodes:node_ids") == [(None, ["n1", "n2", "fusion"])]
    assert read(file, "/network", "GraphNodes:colors") == [
        (0.0, [asleep, asleep, asleep]),
        (3.0, [asleep, reporting, asleep]),
        (5.0, [asleep, asleep, asleep]),
    ]


def test_a_change_between_the_instants_of_the_picture_is_exact_on_its_lane(small: Small) -> None:
    file = small(lambda timeline: timeline.state(3_010 * MS, "n2", "awake"))
    assert read(file, "/state/n2", "StateChange:state") == [(3.01, ["awake"])]
    assert [t for t, _ in read(file, "/field/working", "Points2D:colors")] == [3.05]


def test_any_name_of_process_state_and_lane_will_do(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(0, "n1", "pondering")
        timeline.state(0, "stranger", "awake")
        timeline.state(0, "a/b c", "x", lane="head 1")
        timeline.message(report("stranger", 1000, 5))

    file = small(calls)
    assert read(file, r"/state/a\/b\ c/head\ 1", "StateChange:state") == [(0.0, ["x"])]
    assert read(file, "/field/working", "Points2D:colors") == [(0.0, [look.OTHER_STATE])]
    assert read(file, "/network", "GraphEdges:edges") == []
    assert len(read(file, "/messages/doa", "TextLog:text")) == 1


def test_a_ray_points_along_its_bearing_and_goes_when_the_step_is_over(small: Small) -> None:
    file = small(lambda timeline: timeline.message(report("n1", 2000, 10)))
    rays = read(file, "/field/rays", "LineStrips2D:strips")
    (start, end) = rays[0][1][0]
    assert [(t, len(strips)) for t, strips in rays] == [(2.05, 1), (3.0, 0)]
    assert start == [-100.0, 0.0]
    assert end == [pytest.approx(-50.0), pytest.approx(0.0, abs=1e-3)]  # east, a quarter of the field


def test_a_ray_goes_a_little_past_the_estimate_of_its_time(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.message(report("n1", 2000, 10, values=(0.0, 60.0)))
        timeline.message(report("n1", 5000, 10, values=(0.0, 60.0)))
        for step, north in ((1, 40.0), (2, 50.0), (5, 500.0)):
            timeline.estimate(track_point(step, (-100.0, north, 0.0, 0.0)), None)

    rays = [value[0] for _, value in read(small(calls), "/field/rays", "LineStrips2D:strips") if value]
    ends = [end for _, end in rays]
    assert [east for east, _ in ends] == pytest.approx([-100.0, -100.0], abs=1e-3)
    assert 50.0 < ends[0][1] < 70.0
    assert 500.0 < ends[1][1] < 600.0


def test_an_edge_stands_for_a_frame_that_arrived(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.message(report("n1", 2000, 10))
        timeline.message(report("n2", 2000, 60))
        timeline.message(report("n2", 2000, 60, copy=1))

    edges = read(small(calls), "/network", "GraphEdges:edges")
    one, two = ({"first": name, "second": "fusion"} for name in ("n1", "n2"))
    assert edges == [(2.05, [one]), (2.1, [one, two]), (3.0, [])]


def test_a_node_whose_frame_was_lost_is_red_for_the_step(small: Small) -> None:
    file = small(lambda timeline: timeline.message(report("n2", 2000, 10, "radio")))
    asleep = look.STATE_COLOURS["asleep"]
    assert read(file, "/network", "GraphNodes:colors") == [
        (0.0, [asleep] * 3),
        (2.0, [asleep, look.LOST, asleep]),
        (3.0, [asleep] * 3),
    ]
    assert read(file, "/network", "GraphEdges:edges") == []
    assert read(file, "/field/rays", "LineStrips2D:strips") == []
    assert read(file, "/messages/doa", "TextLog:level") == [(2.0, ["ERROR"])]


@pytest.mark.parametrize(("outcome", "rays", "edges"), [("late", 0, 1), ("ignored", 0, 1), ("asleep", 0, 0)])
def test_only_what_was_of_use_has_a_ray(small: Small, outcome: str, rays: int, edges: int) -> None:
    file = small(lambda timeline: timeline.message(report("n2", 2000, 10, outcome)))
    assert len([1 for _, v in read(file, "/field/rays", "LineStrips2D:strips") if v]) == rays
    assert len([1 for _, v in read(file, "/network", "GraphEdges:edges") if v]) == edges
    assert read(file, "/messages/doa", "TextLog:level")[0][1] == ["WARN" if edges else "ERROR"]


def test_a_frame_later_than_its_step_is_listed_but_not_drawn(small: Small) -> None:
    file = small(lambda timeline: timeline.message(report("n2", 2000, 1500, "late")))
    assert read(file, "/network", "GraphEdges:edges") == []
    assert read(file, "/messages/doa", "TextLog:level") == [(3.5, ["WARN"])]


def test_a_frame_is_seen_for_as_long_as_a_step(tmp_path: Path) -> None:
    timeline = Timeline(tmp_path / "run.rrd", small_info(step_ns=NS // 2))
    timeline.message(report("n1", 1000, 10))
    timeline.close()
    assert [t for t, _ in read(tmp_path / "run.rrd", "/network", "GraphEdges:edges")] == [1.05, 1.5]


def test_times_count_from_the_first_step(tmp_path: Path) -> None:
    """A frame 3 s after the start of the run, in the middle of a setup of 5 s, is at -2 s; the axis begins with it."""
    absolute = rrb.TimeRangeBoundary.absolute
    whole = rrb.TimeAxis(view_range=rr.TimeRange(start=absolute(seconds=-5.0), end=absolute(seconds=9.0)))
    assert outlook.whole_run(small_info(origin_ns=5 * NS, end_s=9.0)) == whole
    info = small_info(origin_ns=5 * NS, truths=(Truth("target", ((0.0, 1.0, 2.0), (1.0, 3.0, 4.0))),))
    timeline = Timeline(tmp_path / "run.rrd", dataclasses.replace(info, marks=((0.5, "n1", "kill"),)))
    timeline.message(report("n1", 3000, 10))
    timeline.estimate(dataclasses.replace(track_point(6), step=1), None)
    timeline.close()
    file = tmp_path / "run.rrd"
    assert read(file, "/messages/doa", "TextLog:text")[0][0] == pytest.approx(-1.99)
    assert [t for t, _ in read(file, "/field/truth/target/position", "Points2D:positions")] == [0.0, 1.0]
    assert [t for t, _ in read(file, "/field/one/position", "Points2D:positions")] == [1.0]
    assert [t for t, _ in read(file, "/faults", "TextLog:text")] == [0.5]


def test_several_targets_are_several_truths_by_name(tmp_path: Path) -> None:
    truths = tuple(Truth(name, ((0.0, x, 0.0), (1.0, x, 5.0))) for name, x in (("car", 1.0), ("truck", 2.0)))
    timeline = Timeline(tmp_path / "run.rrd", small_info(truths=truths))
    timeline.state(2 * NS, "n1", "awake")
    timeline.close()
    for name, x in (("car", 1.0), ("truck", 2.0)):
        file, entity = tmp_path / "run.rrd", f"/field/truth/{name}/position"
        assert [value for _, value in read(file, entity, "Points2D:positions") if value] == [[[x, 0.0]], [[x, 5.0]]]
        assert [value for _, value in read(file, entity, "Points2D:labels") if value] == [[name]]


def test_what_several_processes_track_is_drawn_apart(tmp_path: Path) -> None:
    info = small_info(places=tuple(dataclasses.replace(p, tags=p.tags | {TRACKS}) for p in PLACES[1:]))
    timeline = Timeline(tmp_path / "run.rrd", info)
    for source in ("n1", "n2"):
        timeline.estimate(dataclasses.replace(track_point(1, (1.0, 2.0, 0.0, 0.0)), source=source), (1.0, 2.0))
    timeline.close()
    for source in ("n1", "n2"):
        assert read(tmp_path / "run.rrd", f"/field/one/{source}/position", "Points2D:positions")
        assert read(tmp_path / "run.rrd", f"/plots/error/one/{source}", "Scalars:scalars") == [(1.0, [0.0])]


def test_a_tracker_that_lost_its_target_leaves_the_picture(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        here = (3.0, 4.0, 0.0, 0.0)
        particles = np.array([[1, 2], [3, 4]], "<f4").tobytes()
        timeline.estimate(dataclasses.replace(track_point(1, here), particles=particles), (0.0, 0.0))
        timeline.estimate(track_point(2), (0.0, 0.0))
        timeline.estimate(track_point(3, here), None)

    file = small(calls)
    assert read(file, "/field/one/position", "Points2D:positions") == [
        (1.0, [[3.0, 4.0]]),
        (2.0, []),
        (3.0, [[3.0, 4.0]]),
    ]
    assert [len(v) for _, v in read(file, "/field/one/ellipse", "LineStrips2D:strips")] == [1, 0, 1]
    assert [len(v) for _, v in read(file, "/field/one/particles", "Points2D:positions")] == [2, 0, 0]
    assert read(file, "/field/one/track", "LineStrips2D:strips") == []
    assert read(file, "/plots/error/one", "Scalars:scalars") == [(1.0, [5.0])]


@pytest.mark.parametrize("late", [False, True])
def test_a_tracker_whose_process_dies_leaves_the_picture_at_once(small: Small, late: bool) -> None:
    """Also if the death is told of late; what its next life says of times before itself is drawn as a line only."""

    def calls(timeline: Timeline) -> None:
        here = (3.0, 4.0, 0.0, 0.0)
        points = [dataclasses.replace(track_point(step, here), source="fusion") for step in range(1, 7)]
        timeline.estimate(points[0], (0.0, 0.0))
        timeline.estimate(points[1], (0.0, 0.0))
        if not late:
            timeline.death(2_200 * MS, "fusion", "killed")
        timeline.state(4_900 * MS, "fusion", "waiting")
        if late:
            timeline.death(2_200 * MS, "fusion", "killed")
        timeline.estimate(points[3], (0.0, 0.0))
        timeline.estimate(points[4], (0.0, 0.0))

    file = small(calls)
    at = read(file, "/field/one/position", "Points2D:positions")
    assert [(t, len(value)) for t, value in at] == [(1.0, 1), (2.0, 1), (2.2, 0), (5.0, 1)]
    assert [t for t, _ in read(file, "/field/one/track", "LineStrips2D:strips") if t] == [2.0, 5.0]


def test_a_tracker_that_says_nothing_for_a_while_leaves_the_picture(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        for step in (1, 2, 6, 7):
            timeline.estimate(track_point(step, (float(step), 0.0, 0.0, 0.0)), (0.0, 0.0))
        timeline.flush()

    file = small(calls)
    at = read(file, "/field/one/position", "Points2D:positions")
    assert [(t, len(value)) for t, value in at] == [(1.0, 1), (2.0, 1), (3.5, 0), (6.0, 1), (7.0, 1)]
    assert [t for t, _ in read(file, "/field/one/track", "LineStrips2D:strips") if t] == [2.0, 7.0]
    errors = read(file, "/plots/error/one", "Scalars:scalars")
    assert [t for t, (value,) in errors if math.isnan(value)] == [3.5]


def test_what_a_frozen_tracker_says_when_it_is_back_was_not_there_before(small: Small) -> None:
    """It leaves the picture; of the steps that it tells of late only the line is drawn. Told again, a step stays."""

    def calls(timeline: Timeline) -> None:
        for step, late_ns in ((1, 0), (2, 0), (3, 3 * NS), (4, 2 * NS), (5, NS), (6, 0), (5, 2 * NS), (6, NS), (7, 0)):
            timeline.estimate(track_point(step, (float(step), 0.0, 0.0, 0.0)), (0.0, 0.0), late_ns)

    file = small(calls)
    for entity, what in (("position", "Points2D:positions"), ("ellipse", "LineStrips2D:strips")):
        at = [(t, len(value)) for t, value in read(file, f"/field/one/{entity}", what)]
        assert at == [(1, 1), (2, 1), (3.5, 0), (5, 1), (5, 1), (6, 1), (6, 1), (7, 1)]
    drawn = {t for t, _ in read(file, "/field/one/track", "LineStrips2D:strips") if t}
    assert drawn == {2, 3, 4, 5, 6, 7}


def test_trackers_have_colours_of_their_own(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        for tracker in ("one", "two", "unannounced"):
            timeline.estimate(track_point(1, (1.0, 1.0, 0.0, 0.0), tracker), None)

    info = small_info(trackers=("one", "two"))
    assert len({look.tracker_colour(info, name) for name in ("one", "two", "unannounced")}) == 3
    file = small(calls)
    for name in ("one", "unannounced"):
        (colour,) = {v[0] for _, v in read(file, f"/field/{name}/track", "LineStrips2D:colors")}
        assert colour == look.tracker_colour(small_info(), name)


def test_notes_are_listed_with_their_level(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.note(2 * NS, "n1", "all is well")
        timeline.note(1 * NS, "n2", "it is not", "ERROR")

    file = small(calls)
    assert read(file, "/notes", "TextLog:text") == [(1.0, ["n2: it is not"]), (2.0, ["n1: all is well"])]
    assert read(file, "/notes", "TextLog:level") == [(1.0, ["ERROR"]), (2.0, ["INFO"])]
    assert read(file, "/notes", "TextLog:color")[0] == (1.0, [look.LOST])


def test_the_truth_is_drawn_only_as_far_as_the_run_came(tmp_path: Path) -> None:
    truth = tuple((float(t), 10.0 * t, 0.0) for t in range(11))
    timeline = Timeline(tmp_path / "run.rrd", small_info(truths=(Truth("target", truth),)))
    timeline.state(4_500 * MS, "n1", "awake")
    timeline.close()
    times = [t for t, _ in read(tmp_path / "run.rrd", "/field/truth/target/position", "Points2D:positions")]
    assert times == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_table_of_lost_frames_has_no_column_for_their_arrival() -> None:
    """Of a column without any value Rerun would have to guess the type."""
    lost = dataclasses.replace(report("n2", 2000, 10, "radio"), due_ns=None, local_ns=2 * NS)
    columns = {str(column.component_descriptor().component) for column in rows.times([(lost, 0)])}
    assert columns == {name for name in rows.TIMES if name != "received at"}


def test_what_comes_much_too_late_is_shown_late_but_not_dropped(small: Small) -> None:
    def calls(timeline: Timeline) -> None:
        timeline.state(8 * NS, "n1", "awake")
        timeline.flush()
        timeline.state(2 * NS, "n2", "awake")
        timeline.message(report("n2", 2000, 10))

    file = small(calls)
    awake = look.STATE_COLOURS["awake"]
    assert read(file, "/field/working", "Points2D:colors")[-1] == (8.0, [awake, awake])
    assert read(file, "/state/n2", "StateChange:state") == [(2.0, ["awake"])]
    sent = [value[0] for _, value in read(file, "/plots/bytes", "Scalars:scalars")]
    assert sum(sent) == 14


def test_a_flush_puts_what_is_ripe_into_the_file(tmp_path: Path) -> None:
    """A recorder that is killed loses four seconds of pictures at most, and of dense rows nothing."""
    timeline = Timeline(tmp_path / "run.rrd", small_info())
    for k in range(300):
        timeline.message(report("n1", 1000 + k, 5))
    timeline.state(1 * NS, "n1", "awake")
    timeline.flush()
    after_one = {path for path, _ in timeline._pending}
    assert "/messages/doa" not in after_one and "/state/n1" in after_one
    for _ in range(15):
        timeline.flush()
    assert not timeline._pending
    timeline.close()
    assert len(read(tmp_path / "run.rrd", "/messages/doa", "TextLog:text")) == 300


def test_the_lanes_shown_are_those_that_the_target_passes() -> None:
    info = fake_run.info(side=11)
    first = look.lanes(info)[: look.LANES]
    assert first[0].id == "fusion"
    closest = [min(math.dist((p.x, p.y), (x, y)) for _, x, y in info.truths[0].points) for p in first[1:]]
    assert max(closest) < 36  # half the diagonal of a cell
    assert sorted(p.id for p in look.lanes(info)) == sorted(p.id for p in info.places)


def test_no_path_no_sensor_and_one_place_can_be_shown(tmp_path: Path) -> None:
    assert [p.id for p in look.lanes(small_info())] == ["fusion", "n1", "n2"]
    assert list(look.graph_positions(small_info(places=PLACES[:1]))) == ["fusion"]
    timeline = Timeline(tmp_path / "run.rrd", small_info(places=PLACES[:1]))
    timeline.state(0, "fusion", "waiting")
    timeline.close()
    assert verify(tmp_path / "run.rrd").returncode == 0


def test_the_network_is_drawn_at_an_even_scale_with_north_up() -> None:
    """The names would cover each other in a field of 5 m, and be lost in one of 5 km."""
    for spacing in (5.0, 50.0, 500.0):
        places = tuple(
            Place(f"n{i}{j}", "node", spacing * i, spacing * j, fake_run.NODE) for i in range(4) for j in range(4)
        )
        at = look.graph_positions(small_info(places=places))
        east = at["n10"][0] - at["n00"][0]
        north = at["n00"][1] - at["n01"][1]
        assert 45.0 < east < 60.0 and 40.0 < north < east


def test_the_centre_covers_no_sensor_in_the_network() -> None:
    info = fake_run.info(side=3)
    at = look.graph_positions(info)
    (x, y) = at.pop("fusion")
    assert at["n004"][0] == pytest.approx(x) and at["n004"][1] + 20 < y < at["n001"][1] - 20


# --- size and speed ---------------------------------------------------------------------------------------


def test_a_field_of_1000_sensors(tmp_path: Path) -> None:
    info = fake_run.info(side=32, steps=8)
    timeline = Timeline(tmp_path / "run.rrd", info)
    fake_run.play(timeline, fake_run.calls(info))
    timeline.close()
    file = tmp_path / "run.rrd"
    assert len(read(file, "/field/sensors", "Points2D:positions")[0][1]) == 1024
    working = [value for _, value in read(file, "/field/working", "Points2D:colors")]
    assert max(map(len, working)) < 300 and len({tuple(value) for value in working}) > 3
    assert len(read(file, "/network", "GraphNodes:node_ids")[0][1]) == 1025
    assert verify(file).returncode == 0


def test_many_messages_take_little_room(tmp_path: Path) -> None:
    """1000 sensors that report twenty times a second; what that costs is measured by ``bench.recorder``."""
    info = fake_run.info(side=32, steps=2)
    sensors = [place.id for place in info.places if place.role == "node"][:1000]
    text = "DOA 90.0 deg, 61.2 dB"
    batches = [
        [
            report(
                name,
                50 * tick,
                3 + index % 7,
                "radio" if (index + tick) % 10 == 0 else "delivered",
                text=text,
            )
            for index, name in enumerate(sensors)
        ]
        for tick in range(40)
    ]
    timeline = Timeline(tmp_path / "run.rrd", info)
    empty = (tmp_path / "run.rrd").stat().st_size
    for tick, batch in enumerate(batches, 1):
        for row in batch:
            timeline.message(row)
        if tick % 5 == 0:
            timeline.flush()
    timeline.close()
    size = (tmp_path / "run.rrd").stat().st_size - empty
    assert size / 40 < 95 * 1024
    assert len(read(tmp_path / "run.rrd", "/messages/doa", "TextLog:text")) == 40_000
