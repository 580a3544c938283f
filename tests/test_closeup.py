"""The close-up of a target: where it is, how large, and what it is told to show."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from launcher.records import FieldInfo, Place, Truth
from launcher.timeline import look
from launcher.timeline.layers.closeup import scale_bar, size, zoomed
from launcher.timeline.timeline import Timeline
from tests.fake_run import CENTRE, NODE
from tests.rrd import read, views
from trackfield.role import NS, TrackPoint

PLACES = (
    Place("fusion", "fusion", 0.0, 0.0, CENTRE),
    *(Place(f"n{index}", "node", 50.0 * index, 50.0, NODE) for index in range(10)),
)
CAR = tuple((0.5 * k, 10.0 * k, 3.0 * k) for k in range(20))
INFO = FieldInfo("r", "s", PLACES, (Truth("car", CAR),), ("one", "two"), 10.0, receptions=(("n0", "fusion", 1.0),))


def point(step: int, sd: float, tracker: str = "one", off: float = 0.0, target: str = "car") -> TrackPoint:
    """A point that is so far off, east, and says that it is sure to ``sd`` metres."""
    _, x, y = CAR[2 * step]
    covariance = np.diag([sd**2, sd**2, 1.0, 1.0])
    return TrackPoint(tracker, target, step * NS, "tracking", (x + off, y, 0.0, 0.0), tuple(covariance.ravel()))


def played(file: Path, points: list[TrackPoint], info: FieldInfo = INFO) -> Path:
    timeline = Timeline(file, info)
    for one in points:
        _, x, y = CAR[2 * one.at_ns // NS]
        timeline.estimate(one, (x, y))
    timeline.state(9 * NS, "n1", "asleep")
    timeline.close()
    return file


def halves(file: Path, target: str = "car") -> list[tuple[float | None, float]]:
    return [(t, value[0][0]) for t, value in read(file, f"/closeup/{target}/zoom", "Transform3D:scale")]


def test_it_goes_along_with_its_target_with_north_up(tmp_path: Path) -> None:
    file = played(tmp_path / "run.rrd", [])
    at = read(file, "/closeup/car", "Transform3D:translation")
    assert [(t, value[0]) for t, value in at[1:]] == [(t, [x, -y, 0.0]) for t, x, y in CAR if t <= 9]
    shown = views(file)["Close-up of car"]
    assert shown["ViewBlueprint:space_origin"] == ["/closeup/car/zoom"]
    assert {"/field/**", "- /field/legend/**"} <= set(shown["ViewContents:query"])
    assert list(views(file)).count("Field (E right, N up)") == 1


def test_every_target_has_one(tmp_path: Path) -> None:
    truths = (Truth("car", CAR), Truth("truck", tuple((t, x, y + 100.0) for t, x, y in CAR)))
    info = dataclasses.replace(INFO, truths=truths)
    file = played(tmp_path / "run.rrd", [point(1, 1.0), point(1, 30.0, target="truck")], info)
    assert {"Close-up of car", "Close-up of truck"} <= views(file).keys()
    assert halves(file)[-1][1] < 15.0 < 90.0 < halves(file, "truck")[-1][1]


def test_it_is_a_few_times_as_large_as_the_ellipse_and_changes_seldom(tmp_path: Path) -> None:
    sds = [1.0, 0.9, 0.8, 1.05, 10.0, 9.0, 10.5, 1.0]
    found = halves(played(tmp_path / "run.rrd", [point(step, sd) for step, sd in enumerate(sds, 1)]))
    assert [t for t, _ in found] == [0.0, 1.0, 5.0, 8.0]
    for (_, half), sd in zip(found[1:], (1.0, 10.0, 1.0), strict=True):
        semi_axis = sd * math.sqrt(-2 * math.log(0.05))
        assert 2 * semi_axis <= half < 8 * semi_axis


def test_an_estimate_far_off_is_in_it_and_one_lost_tracker_does_not_make_it_huge(tmp_path: Path) -> None:
    (_, start), (_, wide) = halves(played(tmp_path / "a.rrd", [point(1, 1.0, off=90.0)]))
    assert start < 90.0 < wide
    both = [point(1, 1.0), point(1, 100.0, "two", off=150.0)]
    assert halves(played(tmp_path / "b.rrd", both))[-1][1] < 15.0


def test_its_scale_is_a_round_length(tmp_path: Path) -> None:
    for half in (0.5, 1.0, 8.0, 64.0, 4096.0, 30000.0):
        length, text = scale_bar(half)
        number, unit = text.split()
        metres = float(number) * (1000 if unit == "km" else 1)
        assert length == pytest.approx(metres / half) and 0.3 < length <= 1
        assert float(f"{metres:e}".split("e")[0]) in (1, 2, 5)
    file = played(tmp_path / "run.rrd", [point(1, 1.0)])
    ((_, strips),) = read(file, "/closeup/car/zoom/scale", "LineStrips2D:strips")[1:]
    ((_, words),) = read(file, "/closeup/car/zoom/scale", "LineStrips2D:labels")[1:]
    (west, _), (east, _) = strips[0]
    assert (east - west) * halves(file)[-1][1] == pytest.approx(float(words[0].removesuffix(" m")))


def test_its_legend_has_the_trackers_in_their_colours(tmp_path: Path) -> None:
    file = played(tmp_path / "run.rrd", [point(1, 1.0)])
    assert read(file, "/closeup/car/zoom/legend/names", "Points2D:labels") == [(None, ["true path", "one", "two"])]
    ((_, colours),) = read(file, "/closeup/car/zoom/legend/dots", "Points2D:colors")
    assert colours == [look.TRUTH, look.tracker_colour(INFO, "one"), look.tracker_colour(INFO, "two")]
    assert read(file, "/field/one/track", "LineStrips2D:colors") == [(None, [colours[1]])]


def test_zooms_are_powers_of_two_with_room_to_stay() -> None:
    assert zoomed(math.inf, 5.0) == 8.0
    assert [zoomed(8.0, needed) for needed in (8.0, 8.1, 2.1, 2.0)] == [8.0, 16.0, 8.0, 2.0]
    assert zoomed(8.0, 0.0) == 0.5  # of a tracker without any doubt
    ring = np.array([(1.0, 0.0), (-1.0, 0.0)])
    assert size(ring, None) == size(ring, (0.0, 0.0)) == 2.0
    assert size(ring, (0.0, 10.0)) == 12.0


def test_a_field_without_a_target_has_none(tmp_path: Path) -> None:
    timeline = Timeline(tmp_path / "run.rrd", dataclasses.replace(INFO, truths=()))
    timeline.close()
    assert not [name for name in views(tmp_path / "run.rrd") if name.startswith("Close-up")]
