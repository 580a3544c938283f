"""Sensors from a file: what it says comes out on the target's plane, and what is wrong is told with its line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from launcher.records import LIVE, RECORDER, ROUTER
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.places import RESERVED, _id, read_places
from trackfield.wire.error import WireError
from trackfield.wire.keys import check_id
from trackfield.world.tracks import track_origin

ORIGIN = np.array([50.0, 8.0])


def text(file: Path, *lines: str) -> Path:
    file.write_text("\n".join(lines))
    return file


def failure(file: Path, origin: Any = None) -> str:
    with pytest.raises(ScenarioError) as caught:
        read_places(file, origin, "fusion")
    return str(caught.value)


# --- what is right ----------------------------------------------------------------------------------------------------


def test_metres_come_out_as_they_are_in_the_files_order(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "id,x,y", "gate,3.5,-7", "a-1,0,0", "_b.2,1e3,.25")
    assert read_places(file, None, "fusion") == ([("gate", 3.5, -7.0), ("a-1", 0.0, 0.0), ("_b.2", 1000.0, 0.25)], None)


def test_degrees_are_laid_on_the_plane_of_the_origin(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "id,lat,lon", "here,50,8", "there,50.01,7.98")
    sensors, _ = read_places(file, ORIGIN, "fusion")
    east, north, _ = pymap3d.geodetic2enu(50.01, 7.98, 0.0, 50.0, 8.0, 0.0)
    assert sensors[0] == ("here", pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))
    assert sensors[1] == ("there", pytest.approx(east), pytest.approx(north))
    assert (round(east), round(north)) == (-1434, 1112)


def test_columns_may_be_in_any_order_and_case_and_others_do_not_matter(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "Y , model,ID,X", "", "2, m4, a ,1", " , , ,", '4,"m5, new",b,3')
    assert read_places(file, None, "fusion")[0] == [("a", 1.0, 2.0), ("b", 3.0, 4.0)]
    (tmp_path / "b.csv").write_bytes(b"\xef\xbb\xbfid,x,y\r\na,1,2\r\n")
    assert read_places(tmp_path / "b.csv", None, "fusion")[0] == [("a", 1.0, 2.0)]


def test_a_file_with_both_kinds_of_place_is_read_as_the_target_has_it(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "id,x,y,lat,lon", "a,1,2,50,8")
    assert read_places(file, None, "fusion")[0] == [("a", 1.0, 2.0)]
    assert read_places(file, ORIGIN, "fusion")[0][0][1:] == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_role_says_who_is_a_sensor_and_where_the_centre_stands(tmp_path: Path) -> None:
    rows = ["a,1,2,node", "fusion,5,6,fusion", "b,3,4,", "c,7,8"]
    sensors, centre = read_places(text(tmp_path / "a.csv", "id,x,y,role", *rows), None, "fusion")
    assert sensors == [("a", 1.0, 2.0), ("b", 3.0, 4.0), ("c", 7.0, 8.0)]
    assert centre == (5.0, 6.0)


def test_two_sensors_may_share_a_place(tmp_path: Path) -> None:
    assert len(read_places(text(tmp_path / "a.csv", "id,x,y", "a,1,2", "b,1,2"), None, "fusion")[0]) == 2


# --- ids --------------------------------------------------------------------------------------------------------------


def passes(id: str) -> bool:
    try:
        return _id(id) == id
    except ValueError:
        return False


def goes_on_the_wire(id: str) -> bool:
    try:
        return check_id(id) == id
    except WireError:
        return False


@given(st.text(st.sampled_from("aZ09_.-/ é\n*"), max_size=4) | st.text(st.sampled_from("a."), min_size=30, max_size=34))
@example("")
@example("a" * 32)
@example("a" * 33)
@example("a\n")
@example("٣")
def test_an_id_is_one_if_and_only_if_it_is_one_on_the_wire(id: str) -> None:
    assert passes(id) == goes_on_the_wire(id)


def test_the_names_of_other_processes_are_reserved(tmp_path: Path) -> None:
    assert set(RESERVED) == {ROUTER, RECORDER, LIVE}
    for name in (*RESERVED, "fusion"):
        file = text(tmp_path / "a.csv", "id,x,y", "a,0,0", f"{name},1,2")
        expected = "an id other than fusion, router, recorder, live"
        assert failure(file) == f"{file}:3: a node is called {name!r}; expected {expected}"


# --- what is wrong ----------------------------------------------------------------------------------------------------

COLUMNS = "a CSV file with columns id,x,y or id,lat,lon"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", f": is empty; expected {COLUMNS}"),
        (b"\xff\xfe\x00", f": not a CSV file (line 1: the byte 0xff is not text in UTF-8); expected {COLUMNS}"),
        (b"id,x,y\n\x00,1,2", ": not a CSV file (line 2: the byte 0x00 is not text); expected a CSV"),
        (b"It was a dark and stormy night.", f": has the columns it was a dark and stormy night.; expected {COLUMNS}"),
        (b"id,x\na,1\n", f": has the columns id, x; expected {COLUMNS}"),
        (b"name,x,y\na,1,2\n", f": has the columns name, x, y; expected {COLUMNS}"),
        (b"id,lat,y\na,1,2\n", f": has the columns id, lat, y; expected {COLUMNS}"),
        (b"id,x,y\n", f": has no rows; expected {COLUMNS}"),
        (b"id,x,y\n\n , ,\n", f": has no rows; expected {COLUMNS}"),
        (b"id,x,y\na,1,2\nb,east,2\n", ":3: x is 'east'; expected metres"),
        (b"id,x,y\na,1,nan\n", ":2: y is 'nan'; expected metres"),
        (b"id,x,y\na,1\n", ":2: y is ''; expected metres"),
        (b"id,x,y\na b,1,2\n", ":2: id is 'a b'; expected 1 to 32 characters of A-Z a-z 0-9 _ . -, not beginning"),
        (b"id,x,y\n,1,2\n", ":2: id is ''; expected 1 to 32 characters of"),
        (b"id,x,y\n.a,1,2\n", ":2: id is '.a'; expected 1 to 32 characters of"),
        (b"id,x,y\na,1,2\nb,1,2\n\na,3,4\n", ":5: id 'a' is given twice; expected an id other than that of line 2"),
        (b"id,x,y,role\na,1,2,head\n", ":2: role is 'head'; expected one of node, fusion"),
        (b"id,x,y,role\na,1,2,Node\n", ":2: role is 'Node'; expected one of node, fusion"),
        (
            b"id,x,y,role\na,1,2,node\nhub,1,2,fusion\n",
            ":3: a fusion is called 'hub'; expected the id fusion, or archi",
        ),
        (b"id,x,y,role\nfusion,1,2,fusion\n", ": no sensors; expected at least one row with the role node"),
        (b"id,x,y,role\nfusion,1,2,fusion\nfusion,1,2,fusion\n", ":3: id 'fusion' is given twice; expected"),
        (
            b"id,lat,lon\na,50,8\n",
            ": has the columns lat,lon, but the target's path is in metres; expected the columns x,y, "
            "or a track in lat,lon",
        ),
    ],
)
def test_a_file_that_is_none(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    assert failure(file).startswith(f"{file}{message}")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("a,91,8", "lat is '91'; expected degrees from -90 to 90"),
        ("a,50,180.1", "lon is '180.1'; expected degrees from -180 to 180"),
        ("a,50° N,8", "lat is '50° N'; expected degrees from -90 to 90"),
    ],
)
def test_degrees_that_are_none(tmp_path: Path, row: str, message: str) -> None:
    file = text(tmp_path / "a.csv", "id,lat,lon", row)
    assert failure(file, ORIGIN) == f"{file}:2: {message}"


def test_metres_do_not_go_with_a_track_in_degrees(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "id,x,y", "a,1,2")
    message = (
        "has the columns x,y, but the target's path is in lat,lon; expected the columns lat,lon, or a track in x,y"
    )
    assert failure(file, ORIGIN) == f"{file}: {message}"
    missing = text(tmp_path / "b.csv", "id,x", "a,1")
    assert failure(missing, ORIGIN).endswith("expected a CSV file with columns id,lat,lon or id,x,y")


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    assert failure(tmp_path / "none.csv") == f"{tmp_path / 'none.csv'}: cannot be read (No such file or directory)"
    assert failure(tmp_path).endswith("cannot be read (Is a directory)")


# --- in a scenario ----------------------------------------------------------------------------------------------------


def surveyed(places: Path, **target: Any) -> Scenario:
    return Scenario.load({"name": "mine", "target": target, "field": {"layout": "file", "file": str(places)}})


def test_sensors_and_centre_of_a_plan_are_the_files(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "id,x,y,role", "west,60,80,", "east,90,110,", "fusion,500,-20,fusion")
    site = survey(surveyed(file, path="s1"))
    assert site.sensors == site.believed == (("west", 60.0, 80.0), ("east", 90.0, 110.0))
    assert site.centre == (500.0, -20.0)
    assert site.sensor(1).id == "east"
    assert survey(surveyed(file, path="s1").set("fusion.x_m", 7)).centre == (7.0, -20.0)
    nobody = text(tmp_path / "b.csv", "id,x,y", "west,60,80", "east,90,110")
    assert survey(surveyed(nobody, path="s1")).centre == (75.0, 95.0)


def track(file: Path) -> Path:
    """A minute northward, 11.1 m a second, with a fix each second from 50 N 8 E."""
    rows = (f"2024-05-06T08:00:{t:02}Z,{50 + 1e-4 * t!r},8" for t in range(60))
    return text(file, "time,lat,lon", *rows)


@pytest.mark.parametrize("start", [None, "08:00:20", "08:00:20.500"])
def test_sensors_lie_on_the_tracks_own_plane(tmp_path: Path, start: str | None) -> None:
    """A sensor at a fix of the track is where the target then is, wherever the window begins."""
    places = text(tmp_path / "a.csv", "id,lat,lon", "at30,50.003,8", "at50,50.005,8")
    window = {"from": start} if start else {}
    site = survey(surveyed(places, path="file", file=str(track(tmp_path / "t.csv")), **window))
    begin = {None: 0.0, "08:00:20": 20.0, "08:00:20.500": 20.5}[start]
    for (_, *place), t in zip(site.sensors, (30.0, 50.0), strict=True):
        state = site.paths["target"].at(t - begin)
        assert state is not None
        assert state[:2] == pytest.approx(place, abs=1e-6)


def test_a_target_without_a_place_on_the_globe_has_no_plane_for_degrees(tmp_path: Path) -> None:
    degrees = text(tmp_path / "a.csv", "id,lat,lon", "a,50,8")
    metres = text(tmp_path / "t.csv", "t_s,x,y", "0,0,0", "9,9,9")
    for target in (
        {"path": "s1"},
        {"path": "waypoints", "waypoints": [[0, 0, 0], [9, 9, 9]]},
        {"path": "file", "file": str(metres)},
    ):
        with pytest.raises(ScenarioError, match=r"a\.csv: has the columns lat,lon, but the target's path is in metres"):
            survey(surveyed(degrees, **target))


def test_where_a_track_has_its_origin(tmp_path: Path) -> None:
    file = track(tmp_path / "t.csv")
    for start, lat in ((None, 50.0), ("08:00:20", 50.002), ("08:00:20.5", 50.0021)):
        origin = track_origin(file, start)
        assert origin is not None
        assert origin.tolist() == pytest.approx([lat, 8.0], abs=1e-12)
    with pytest.raises(ScenarioError, match="no fix inside the window"):
        track_origin(file, "08:00:20.1", "08:00:20.9")
    assert track_origin(text(tmp_path / "m.csv", "t_s,x,y", "0,0,0", "9,9,9")) is None


def test_a_file_lies_beside_the_scenario_that_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "there").mkdir()
    text(
        tmp_path / "there" / "mine.toml", 'name = "mine"', '[field]\nlayout="file"\nfile="a.csv"', '[target]\npath="s1"'
    )
    loaded = Scenario.load(tmp_path / "there" / "mine.toml")
    assert loaded.plain()["field"] == {"layout": "file", "file": str(tmp_path / "there" / "a.csv")}
    monkeypatch.chdir(tmp_path)
    for scenario in (loaded.set("field.file", "b.csv"), Scenario.load("bus", {"field.file": "b.csv"})):
        assert scenario.plain()["field"] == {"layout": "file", "file": str(tmp_path / "b.csv")}
    assert "file" not in loaded.set("field.layout", "grid").plain()["field"]
