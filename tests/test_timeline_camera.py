"""What is beyond a gateway on the timeline: items on their way as the run goes on, the rest once it is over."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from math import atan2, degrees, hypot
from pathlib import Path
from typing import Any

import av
import pytest
from PIL import Image

from launcher.filming.frames import Frame, Framed
from launcher.outside import Aim, Counts, Exposure, Known, Ordered, Outside, Refusal, Turn
from launcher.plan.prepare import planned
from launcher.record.folder import keep
from launcher.record.outside import filmed
from launcher.record.reading.camera import read_camera
from launcher.records import BATTERY, EAR, SENSES, TRACKS, FieldInfo, MessageRow, Place, Truth
from launcher.run import Outcome, run_virtual
from launcher.timeline import beyond, look
from launcher.timeline.layers.camera import BOXES, IMAGE, INSIDE, ITEMS, LOG, OUTSIDE, TOLD_NS, VIEW
from launcher.timeline.timeline import Timeline
from tests.rrd import entities, read, verify, views
from trackfield.models.pointing import EVI_D30, Direction, Mount, in_view
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.messages import SyncRequest
from trackfield.wire.outside import Carried, Item
from trackfield.wire.passes import FIXES

MOUNT = Mount(30.0, -25.0, 2.0, 90.0)
"""Looks north at pan 0."""
ITEM = Item(1, 0, FIXES, b"a", b"x")


def field(hops: int = 1) -> FieldInfo:
    """A node, a base, a camera beside it, and forwarding nodes on the way to its control."""
    near = ("camera-control", "camera", "video", "system")
    places = [
        Place("base", "gateway", 30.0, -25.0, frozenset({TRACKS})),
        Place("a", EAR, 0.0, 20.0, frozenset({SENSES, TRACKS, BATTERY})),
        *(Place(f"hop{i + 1}", "forwarder", 60.0 + 20 * i, -60.0) for i in range(hops)),
        *(Place(role, role, 30.0, -25.0) for role in near),
    ]
    way = Truth("target", ((0.0, -60.0, 5.0), (12.0, 60.0, 5.0)))
    return FieldInfo("small", "small", tuple(places), (way,), ("ml",), 12.0, hears=True)


def drawn(folder: Path, tell: Callable[[Timeline], object], info: FieldInfo | None = None) -> Path:
    timeline = Timeline(folder / "run.rrd", info or field())
    tell(timeline)
    timeline.close()
    return folder / "run.rrd"


def told(folder: Path, info: FieldInfo | None = None, **parts: Any) -> Path:
    return drawn(folder, lambda timeline: timeline.outside(Outside(MOUNT, **parts)), info)


def strips(file: Path, path: str) -> dict[float, list[list[list[float]]]]:
    return {t: value for t, value in read(file, path, "LineStrips2D:strips") if t is not None}


def curve(file: Path, *parts: str) -> list[tuple[float, list[float]]]:
    found = read(file, look.path("plots", *parts), "Scalars:scalars")
    return [(t, value) for t, value in found if t is not None]


def aim(shot: int = 1, t_s: float = 4.0, outcome: str = "aimed", **changes: Any) -> Aim:
    one = Aim(round(t_s * NS), shot, "a", 7, 1.4, 3 * NS, round((t_s + 1.5) * NS), 10.0, 5.0, -33.7, -2.0, outcome)
    return one._replace(**changes)


def turn(t_s: float, pan0: float, pan1: float) -> Turn:
    return Turn(round(t_s * NS), pan0, 0.0, pan1, 0.0, 80.0, 50.0)


# --- as the run goes on -----------------------------------------------------------------------------------------------


def frame(second: float, src: str, dst: str, message: Any, outcome: str = "delivered") -> MessageRow:
    sent_ns = round(second * NS)
    due_ns = sent_ns + 2_500_000
    return MessageRow(kind_name(message), src, dst, "backbone", sent_ns, due_ns, outcome, 3, payload=encode(message))


def carried(message: Any) -> Carried:
    return Carried(b"base", b"camera-control", 1, 0, encode(message))


def test_items_are_drawn_on_their_way_and_each_link_has_its_delays(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(1.0, "base", "hop1", carried(ITEM)))
        timeline.message(frame(1.5, "hop1", "camera-control", carried(ITEM)))

    file = drawn(tmp_path, tell)
    found = strips(file, ITEMS)
    first, second = [[30.0, -25.0], [60.0, -60.0]], [[60.0, -60.0], [30.0, -25.0]]
    assert found[1.05] == [first]
    assert found[1.55] == [first, second]
    assert (found[2.05], found[2.55]) == ([second], [])
    for link, at in (("base → hop1", 1.0025), ("hop1 → camera-control", 1.5025)):
        assert curve(file, "hops", link) == [(at, [2.5])]


@pytest.mark.parametrize(
    "row",
    [
        frame(1.0, "base", "hop1", carried(SyncRequest(1, 0))),
        frame(1.0, "hop1", "base", carried(ITEM)),
        frame(1.0, "base", "hop1", carried(ITEM), "radio"),
        MessageRow("carried", "base", "hop1", "backbone", NS, NS, "delivered", 3, payload=b"\xc1"),
    ],
)
def test_what_is_no_item_on_its_way_is_not_drawn(tmp_path: Path, row: MessageRow) -> None:
    file = drawn(tmp_path, lambda timeline: timeline.message(row))
    assert not any(strips(file, ITEMS).values())
    assert not curve(file, "hops", "base → hop1")


def test_without_hops_items_go_straight_to_camera_control(tmp_path: Path) -> None:
    file = drawn(tmp_path, lambda timeline: timeline.message(frame(1.0, "base", "camera-control", ITEM)), field(0))
    assert curve(file, "hops", "base → camera-control") == [(1.0025, [2.5])]


# --- where the camera looks -------------------------------------------------------------------------------------------


def edges_deg(strip: list[list[float]]) -> tuple[float, float]:
    """The bearings of both sides of a view, clockwise from north."""
    (x, y), right, left = strip[0], strip[1], strip[-2]
    assert (x, y) == pytest.approx((MOUNT.x_m, MOUNT.y_m))
    return tuple(90.0 - degrees(atan2(b - y, a - x)) for a, b in (left, right))  # type: ignore[return-value]


def test_the_view_on_the_map_turns_as_the_camera_does(tmp_path: Path) -> None:
    file = told(tmp_path, turns=(turn(0.0, 0.0, 0.0), turn(4.0, 0.0, 40.0)))
    found = strips(file, VIEW)
    half = EVI_D30.wide / 2
    for second, pan in ((0.0, 0.0), (4.0, 0.0), (4.25, 20.0), (4.5, 40.0)):
        (outline,) = found[second]
        assert sorted(edges_deg(outline)) == pytest.approx([pan - half, pan + half], abs=1e-3)
    assert max(found) == 4.5


def test_a_turn_ends_where_the_next_one_begins(tmp_path: Path) -> None:
    file = told(tmp_path, turns=(turn(4.0, 0.0, 80.0), turn(4.5, 40.0, 0.0)))
    pan = dict(curve(file, "turn", "pan"))
    assert pan[4.0] == [0.0]
    assert pan[4.5] == [pytest.approx(40.0)]
    assert pan[5.0] == [pytest.approx(0.0)]
    assert max(value for (value,) in pan.values()) == pytest.approx(40.0)


def test_where_it_was_told_to_look_is_a_line_to_the_point_until_a_while_after(tmp_path: Path) -> None:
    file = told(tmp_path, aims=(aim(1, 4.0), aim(2, 7.0, aim_x_m=50.0)))
    found = strips(file, "/field/camera/aim")
    assert found[4.0][0] == [[30.0, -25.0], [10.0, 5.0]]
    assert found[7.0][0] == [[30.0, -25.0], [50.0, 5.0]]
    assert (max(found), found[12.0]) == (12.0, [])
    assert curve(file, "turn", "pan, told") == [(4.0, [-33.7]), (7.0, [-33.7]), (12.0, [-33.7])]
    (tmp_path / "early").mkdir()
    early = strips(told(tmp_path / "early", aims=(aim(1, 2.0),)), "/field/camera/aim")
    assert early[3.5 + TOLD_NS / NS] == []


def test_fixes_that_move_nothing_have_a_delay_and_words_but_no_line(tmp_path: Path) -> None:
    file = told(tmp_path, aims=(aim(0, 4.0, "superseded"), aim(0, 5.0, "out of reach", delay_s=2.5)))
    assert not strips(file, "/field/camera/aim")
    assert curve(file, "delay", "fixes") == [(4.0, [1.4]), (5.0, [2.5])]
    words = read(file, LOG, "TextLog:text")
    assert [text for _, (text,) in words] == ["superseded: fix of a, 1.40 s old", "out of reach: fix of a, 2.50 s old"]
    assert [level for _, (level,) in read(file, LOG, "TextLog:level")] == ["INFO", "WARN"]


def test_all_that_happens_beyond_the_gateway_is_told_in_words(tmp_path: Path) -> None:
    file = told(
        tmp_path,
        aims=(aim(),),
        states=(Known(NS, "ready"), Known(6 * NS, "lost")),
        counts=(Counts(0, 0, 0, 0, 0, 0, 0), Counts(7 * NS, 0, 8, 0, 0, 1, 0), Counts(8 * NS, 0, 8, 0, 0, 1, 2)),
        orders=(Ordered(9 * NS, 1, "stop", "video", "silent"),),
        refusals=(Refusal(10 * NS, "hop1", "stranger", "forged"),),
    )
    words = [(t, text) for t, (text,) in read(file, LOG, "TextLog:text")]
    assert words == [
        (1.0, "camera ready"),
        (4.0, "shot 1: pan -33.7°, tilt -2.0°, fix of a, 1.40 s old"),
        (6.0, "camera lost"),
        (7.0, "gateway: the oldest item is dropped"),
        (8.0, "gateway: nobody wants an item"),
        (9.0, "system control: stop video: silent"),
        (10.0, "hop1 refuses an order of stranger: forged"),
    ]


def test_the_queue_of_the_gateway_is_a_curve_with_steps(tmp_path: Path) -> None:
    file = told(tmp_path, counts=(Counts(NS, 0, 0, 0, 0, 0, 0), Counts(3 * NS, 0, 2, 5, 1, 4, 0)))
    assert curve(file, "gateway") == [(1.0, [0.0, 0.0, 0.0]), (3.0, [2.0, 4.0, 1.0]), (12.0, [2.0, 4.0, 1.0])]


def test_of_a_camera_that_does_not_tell_where_it_looks_only_the_aims_are_drawn(tmp_path: Path) -> None:
    file = told(tmp_path, aims=(aim(),), exposures=(Exposure(4 * NS, 1, 0),))
    assert not strips(file, VIEW) and strips(file, "/field/camera/aim")
    assert not curve(file, "turn", "pan") and curve(file, "turn", "pan, told")


# --- frames -----------------------------------------------------------------------------------------------------------


def test_frames_stand_at_their_exposure_with_the_boxes_of_the_targets_in_them(tmp_path: Path) -> None:
    boxes = (Framed("target", 100.0, 200.0, 160.0, 230.0, True), Framed("b", 600.0, 210.0, 640.0, 240.0, False))

    def tell(timeline: Timeline) -> None:
        for number, framed in enumerate((boxes, ())):
            exposed = Exposure((4 + number) * NS, 1, number)
            timeline.frame(Frame(exposed, Direction(0.0, 0.0), b"\xff\xd8%d" % number, framed))

    file = drawn(tmp_path, tell)
    assert [(t, bytes(value[0])) for t, value in read(file, IMAGE, "EncodedImage:blob")] == [
        (4.0, b"\xff\xd80"),
        (5.0, b"\xff\xd81"),
    ]
    assert read(file, BOXES, "Boxes2D:centers") == [(4.0, [[130.0, 215.0], [620.0, 225.0]]), (5.0, [])]
    assert read(file, BOXES, "Boxes2D:half_sizes")[0] == (4.0, [[30.0, 15.0], [20.0, 15.0]])
    assert read(file, BOXES, "Boxes2D:colors")[0] == (4.0, [INSIDE, OUTSIDE])
    assert read(file, BOXES, "Boxes2D:labels")[0] == (4.0, ["target", "b"])


# --- places -----------------------------------------------------------------------------------------------------------


def test_what_stands_at_one_spot_has_one_mark(tmp_path: Path) -> None:
    info = field(2)
    names = beyond.marks([place for place in info.places if SENSES not in place.tags])
    assert names == [("base + camera", (30.0, -25.0)), ("hop1", (60.0, -60.0)), ("hop2", (80.0, -60.0))]
    file = drawn(tmp_path, lambda timeline: None, info)
    assert read(file, "/field/centres", "Points2D:labels") == [(None, ["base + camera", "hop1", "hop2"])]
    assert read(file, "/links/centres", "Points2D:labels") == []


def test_the_backbone_is_dashed_from_the_gateway_over_each_hop_to_the_camera(tmp_path: Path) -> None:
    file = drawn(tmp_path, lambda timeline: None, field(2))
    dashes = read(file, "/field/backbone/links", "LineStrips2D:strips")[0][1]
    lengths = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in dashes]
    assert len(dashes) > 20
    assert max(lengths) == pytest.approx(min(lengths), rel=1e-3)
    way = hypot(30, 35) + 20 + hypot(50, 35)
    assert 0.4 * way < sum(lengths) < 0.55 * way


def test_in_the_network_nothing_stands_on_another_place() -> None:
    at = list(look.graph_positions(field(3)).values())
    apart = [(abs(a - c), abs(b - d)) for i, (a, b) in enumerate(at) for c, d in at[:i]]
    assert all(x >= 45 or y >= 20 for x, y in apart)


def test_the_states_of_base_and_camera_come_first() -> None:
    assert [place.id for place in look.lanes(field())][:4] == ["base", "camera-control", "camera", "a"]
    assert sorted(place.id for place in look.lanes(field())) == sorted(place.id for place in field().places)


def test_the_views_of_a_camera_are_there_only_with_one(tmp_path: Path) -> None:
    own = {"Camera", "Camera log", "Pan, tilt [deg]", "Delay of fixes [s]", "Hops [ms]", "Gateway"}
    without = FieldInfo("small", "small", field().places[:2], field().truths, ("ml",), 12.0, hears=True)
    for name, info in (("with", field()), ("without", without)):
        (tmp_path / name).mkdir()
        found = views(drawn(tmp_path / name, lambda timeline: None, info)).keys()
        assert {"Field (E right, N up)", "Close-up of target", "Error [m]", "Messages"} <= found
        assert found & own == (own if name == "with" else set())


# --- a run ------------------------------------------------------------------------------------------------------------


def ran(folder: Path, **settings: Any) -> Outcome:
    changes = {"sensor.waveform": False, "camera.kind": "evi-d30", "target.steps": 60, **settings}
    scenario = Scenario.load("yang-ecpa", {key: value for key, value in changes.items() if value is not None})
    (folder / "logs").mkdir()
    keep(scenario, folder)
    return run_virtual(planned(scenario), folder, write=lambda folder: None)


def test_a_run_has_its_frames_boxes_and_video(tmp_path: Path) -> None:
    outcome = ran(tmp_path)
    assert outcome.complaints == ()
    file, outside = tmp_path / "run.rrd", read_camera(tmp_path)
    assert verify(file).returncode == 0
    assert {IMAGE, BOXES, VIEW, LOG, "/plots/turn/pan"} <= entities(file)
    images = read(file, IMAGE, "EncodedImage:blob")
    assert len(images) == len(outside.exposures) > 30
    with Image.open(io.BytesIO(bytes(images[0][1][0]))) as image:
        assert (image.format, image.size) == ("JPEG", (EVI_D30.width, EVI_D30.height))
    with av.open(str(tmp_path / "video.mp4")) as video:
        assert sum(1 for _ in video.decode(video=0)) == len(outside.exposures)
    with Image.open(tmp_path / "plots" / "camera.png") as sheet:
        assert sheet.size[0] >= 320


def test_the_boxes_of_a_run_are_green_where_the_target_is_in_view(tmp_path: Path) -> None:
    ran(tmp_path)
    outside = read_camera(tmp_path)
    plan = planned(Scenario.load(tmp_path / "scenario.toml"))
    colours = [value or [] for _, value in read(tmp_path / "run.rrd", BOXES, "Boxes2D:colors")]
    expected = []
    for one in outside.exposures:
        looks, state = outside.look_at(one.t_ns), plan.paths["target"].at(one.t_ns / NS)
        assert looks is not None
        expected.append(state is not None and in_view(outside.mount, looks, *state[:2]))
    assert [INSIDE in several for several in colours] == expected
    assert set(expected) == {True, False}


def test_a_video_that_fails_is_a_complaint_and_nothing_else_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("launcher.filming.video.writing", fails)
    outcome = ran(tmp_path)
    (complaint,) = outcome.complaints
    assert complaint.startswith(filmed.VIDEO_FAILED) and "No space left" in complaint
    assert not (tmp_path / "video.mp4").exists()
    assert verify(tmp_path / "run.rrd").returncode == 0
    assert {VIEW, LOG} <= entities(tmp_path / "run.rrd")
    assert json.loads((tmp_path / "metrics.json").read_text())["complete"]


def test_frames_that_are_left_out_are_counted_in_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("launcher.filming.film.MOST", 15)
    ran(tmp_path)
    assert len(read(tmp_path / "run.rrd", IMAGE, "EncodedImage:blob")) == 14  # every third of 40
    notes = [text for _, (text,) in read(tmp_path / "run.rrd", "/notes", "TextLog:text")]
    assert "video: 26 of 40 frames are not drawn, but those between them" in notes
    with av.open(str(tmp_path / "video.mp4")) as video:
        assert float(video.duration or 0) / 1e6 == pytest.approx(14 * 0.3, abs=0.01)


def test_a_run_without_a_camera_has_none_of_it(tmp_path: Path) -> None:
    ran(tmp_path, **{"camera.kind": "none"})
    assert not (tmp_path / "video.mp4").exists()
    assert not {path for path in entities(tmp_path / "run.rrd") if "camera" in path or "video" in path}
