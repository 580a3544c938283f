"""Recorded tracks: what is in the file comes out, gaps are named, and what is no track is told apart."""

from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.errors import ScenarioError
from trackfield.world import tracks
from trackfield.world.tracks import read_track

DataFile = Callable[[str], Path]
EIGHT = datetime(2024, 5, 6, 8, 0, tzinfo=UTC)


def gpx(file: Path, points: Iterable[tuple[str | None, float, float]]) -> Path:
    """A GPX file of (time, latitude, longitude)."""
    rows = "".join(
        f'<trkpt lat="{lat!r}" lon="{lon!r}">{f"<time>{time}</time>" if time else ""}</trkpt>'
        for time, lat, lon in points
    )
    file.write_text(f'<?xml version="1.0"?><gpx version="1.1"><trk><trkseg>{rows}</trkseg></trk></gpx>')
    return file


def text(file: Path, content: str) -> Path:
    file.write_text(content)
    return file


def clock(seconds: float) -> str:
    return (EIGHT + timedelta(seconds=seconds)).strftime("%Y-%m-%dT%H:%M:%SZ")


@pytest.fixture
def straight(tmp_path: Path) -> Path:
    """Two minutes northward, a fix a second, of which those from 30 s to 50 s are missing."""
    return gpx(tmp_path / "straight.gpx", [(clock(t), 50.0 + 1e-4 * t, 8.0) for t in range(121) if not 30 < t < 50])


# --- positions and velocities --------------------------------------------------------------------------


def test_places_are_metres_east_and_north_of_the_first_fix_inside_the_window(straight: Path) -> None:
    path = read_track(straight, "08:01:00", "08:01:30")
    assert path.at(0.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-9)  # type: ignore[index]
    for t in (10.0, 30.0):
        east, north, _ = pymap3d.geodetic2enu(50.0 + 1e-4 * (60 + t), 8.0, 0.0, 50.006, 8.0, 0.0)
        assert path.at(t)[:2] == pytest.approx((east, north), abs=1e-6)  # type: ignore[index]


def test_velocity_is_that_of_the_fixes(straight: Path) -> None:
    path = read_track(straight, "08:01:00", "08:01:30")
    for t in (0.0, 7.5, 30.0):  # also at the ends, which the fixes outside the window shape
        assert path.at(t)[2:] == pytest.approx((0.0, 11.123), abs=0.01)  # type: ignore[index]


def test_a_window_may_begin_and_end_between_fixes(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "t_s,x,y\n" + "".join(f"{t},{3 * t},{-t}\n" for t in range(0, 40, 4)))
    path = read_track(file, "9", "22.5")
    assert (path.start_s, path.end_s) == (0.0, 13.5)
    assert path.at(0.0) == pytest.approx((27.0, -9.0, 3.0, -1.0))
    assert path.at(13.5) == pytest.approx((67.5, -22.5, 3.0, -1.0))


def test_where_the_file_begins_later_than_the_window_the_target_is_not_there_yet(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "t_s,x,y\n10,0,0\n11,1,0\n12,2,0\n")
    path = read_track(file, "5", "60")
    assert (path.start_s, path.end_s) == (5.0, 7.0)
    assert path.at(4.9) is None


@given(
    st.lists(
        st.tuples(st.sampled_from([0.5, 1.0, 3.0]), st.integers(-50, 50), st.integers(-50, 50)),
        min_size=2,
        max_size=20,
    )
)
def test_a_path_goes_through_its_fixes_and_never_overshoots_them(
    steps: list[tuple[float, float, float]],
) -> None:
    t, x, y = np.cumsum([(0.0, 0.0, 0.0), *steps], axis=0).T
    path = tracks._through(t, np.column_stack([x, y]), *np.zeros((2, len(t) - 1), bool))
    for i in range(len(t)):
        assert path.at(t[i])[:2] == pytest.approx((x[i], y[i]))  # type: ignore[index]
    for i in range(len(t) - 1):
        for share in (0.1, 0.5, 0.9):
            state = path.at(t[i] + share * (t[i + 1] - t[i]))
            assert state is not None
            for place, ends in zip(state[:2], (x[i : i + 2], y[i : i + 2]), strict=True):
                assert min(ends) - 1e-9 <= place <= max(ends) + 1e-9


def test_a_target_that_stands_has_no_speed(tmp_path: Path) -> None:
    rows = [(t, min(t, 10), 0) for t in range(30)]
    path = read_track(text(tmp_path / "a.csv", "t_s,x,y\n" + "".join(f"{t},{x},{y}\n" for t, x, y in rows)))
    assert all(path.at(t / 10) == (10.0, 0.0, 0.0, 0.0) for t in range(100, 291))


# --- gaps --------------------------------------------------------------------------


def test_a_gap_is_crossed_straight_at_constant_speed_and_named(straight: Path) -> None:
    path = read_track(straight)
    assert path.gaps == ((30.0, 50.0),)
    begin, end = path.at(30.0), path.at(50.0)
    assert begin is not None
    assert end is not None
    for t in (30.0, 33.0, 40.0, 49.9):
        y = begin[1] + (end[1] - begin[1]) * (t - 30) / 20
        assert path.at(t) == pytest.approx((0.0, y, 0.0, (end[1] - begin[1]) / 20), abs=1e-6)


def test_five_seconds_are_no_gap_and_more_are(tmp_path: Path) -> None:
    for pause, gaps in ((5, ()), (6, ((4.0, 10.0),))):
        times = [*range(5), *range(4 + pause, 30)]
        file = text(tmp_path / f"{pause}.csv", "t_s,x,y\n" + "".join(f"{t},{t},0\n" for t in times))
        assert read_track(file).gaps == gaps


def test_a_slow_receiver_has_no_gap_between_all_its_fixes(tmp_path: Path) -> None:
    for pause, gaps in ((30, ()), (31, ((90.0, 121.0),))):  # three of its intervals, and more
        times = [*range(0, 100, 10), *range(90 + pause, 200, 10)]
        file = text(tmp_path / f"{pause}.csv", "t_s,x,y\n" + "".join(f"{t},{t},0\n" for t in times))
        assert read_track(file).gaps == gaps


def test_an_interval_usual_elsewhere_in_the_file_is_a_gap_amid_shorter_ones(tmp_path: Path) -> None:
    times = [*range(0, 300, 30), *range(300, 420, 10), *range(445, 565, 10), *range(600, 1200, 30)]
    file = text(tmp_path / "a.csv", "t_s,x,y\n" + "".join(f"{t},{t},0\n" for t in times))
    assert read_track(file).gaps == ((410.0, 445.0),)
    assert read_track(file, "400", "430").gaps_inside == ((10.0, 30.0),)  # the window hides nothing of what is usual


def test_a_gap_over_the_edge_of_the_window_is_named_as_far_as_it_lies_inside(straight: Path) -> None:
    path = read_track(straight, "08:00:20", "08:00:40")
    assert path.gaps_inside == ((10.0, 20.0),)
    assert path.end_s == 20.0
    assert path.interpolated(20.0)


def test_a_lone_fix_between_two_gaps_is_passed_through(tmp_path: Path) -> None:
    times = [*range(5), 20, *range(40, 50)]
    file = text(tmp_path / "a.csv", "t_s,x,y\n" + "".join(f"{t},{t % 20},0\n" for t in times))
    path = read_track(file)
    assert path.gaps == ((4.0, 20.0), (20.0, 40.0))
    assert path.at(19.0) == pytest.approx((0.25, 0.0, -0.25, 0.0))
    assert path.at(21.0) == pytest.approx((0.0, 0.0, 0.0, 0.0))


# --- times --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ("08:01", "08:01:30"),
        ("08:01:00", "08:01:30"),
        ("2024-05-06T08:01", "2024-05-06 08:01:30"),
        ("2024-05-06T08:01:00Z", "2024-05-06T10:01:30+02:00"),
        ("10:01:00+02:00", "08:01:30Z"),
    ],
)
def test_times_may_be_written_in_many_ways(straight: Path, start: str, end: str) -> None:
    path = read_track(straight, start, end)
    assert (path.start_s, path.end_s) == (0.0, 30.0)
    assert path == read_track(straight, "08:01:00", "08:01:30")


def test_times_of_day_are_those_of_the_files_own_zone(tmp_path: Path) -> None:
    rows = [(f"2024-05-06T10:00:{t:02}+02:00", 50.0 + 1e-5 * t, 8.0) for t in range(60)]
    assert read_track(gpx(tmp_path / "a.gpx", rows), "10:00:10", "10:00:20").end_s == 10.0


def test_a_time_without_a_zone_is_utc(tmp_path: Path) -> None:
    file = text(
        tmp_path / "a.csv",
        "time,lat,lon\n" + "".join(f"2024-05-06 08:00:{t:02},50,{8 + t / 1e4}\n" for t in range(20)),
    )
    assert read_track(file, "08:00:05Z").end_s == 14.0


def test_a_ride_over_midnight(tmp_path: Path) -> None:
    late = datetime(2024, 5, 6, 23, 59, tzinfo=UTC)
    rows = [(f"{late + timedelta(seconds=t):%Y-%m-%dT%H:%M:%SZ}", 50.0 + 1e-5 * t, 8.0) for t in range(121)]
    file = gpx(tmp_path / "a.gpx", rows)
    assert read_track(file, "23:59:30", "00:00:30").end_s == 60.0
    assert read_track(file, "00:00:10", "00:00:30").end_s == 20.0


def test_fixes_are_sorted_and_those_of_one_instant_averaged(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "t_s,x,y\n2,4,0\n0,0,0\n1,1,0\n1,3,2\n")
    path = read_track(file)
    assert path.t == (0.0, 1.0, 2.0)
    assert path.at(1.0)[:2] == (2.0, 1.0)  # type: ignore[index]


# --- what is no track --------------------------------------------------------------------------


def failure(file: Path, start: str | None = None, end: str | None = None) -> str:
    with pytest.raises(ScenarioError) as caught:
        read_track(file, start, end)
    assert str(file) in str(caught.value)
    assert all(part.expected or "cannot be read" in str(part) for part in caught.value.parts)
    return str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "hello",
        "<html><body>",
        "\x00\x01",
        "<a>" * 100_000,
        "<!DOCTYPE gpx><gpx><trk><trkseg/></trk></gpx>",
    ],
)
def test_not_a_gpx_file(tmp_path: Path, content: str) -> None:
    assert "not a GPX file" in failure(text(tmp_path / "a.gpx", content))


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    for name, what in (("a.gpx", "not a GPX file"), ("a.csv", "not a CSV file")):
        (tmp_path / name).write_bytes(b"\xff\xfe\x00t_s")
        assert what in failure(tmp_path / name)


def test_a_gpx_file_without_points(tmp_path: Path) -> None:
    assert "no track points" in failure(gpx(tmp_path / "a.gpx", []))
    assert "no track points" in failure(text(tmp_path / "b.gpx", "<html></html>"))


def test_a_gpx_file_without_times(tmp_path: Path) -> None:
    file = gpx(tmp_path / "a.gpx", [(None, 50.0, 8.0), (None, 50.1, 8.0), (None, 50.2, 8.0)])
    assert "its 3 points have no times" in failure(file)


def test_points_without_a_time_are_left_out_where_others_have_one(tmp_path: Path) -> None:
    file = gpx(tmp_path / "a.gpx", [(clock(0), 50.0, 8.0), (None, 10.0, 10.0), (clock(1), 50.0, 8.0)])
    assert read_track(file).end_s == 1.0


@pytest.mark.parametrize(("lat", "lon"), [(91.0, 8.0), (50.0, 181.0), (float("nan"), 8.0)])
def test_a_point_off_the_globe(tmp_path: Path, lat: float, lon: float) -> None:
    said = failure(gpx(tmp_path / "a.gpx", [(clock(0), 50.0, 8.0), (clock(1), lat, lon)]))
    assert "a.gpx:1: l" in said
    assert "; expected degrees from -" in said


@pytest.mark.parametrize(
    "when",
    ["soon", "", "2024-05-06T08:00:01+99:99", "0001-01-01T00:00:00Z", "9999-12-31T23:59:59-01:00", "\n"],
)
def test_a_point_with_a_time_that_cannot_be_read(tmp_path: Path, when: str) -> None:
    rows = [f'<trkpt lat="50" lon="8"><time>{one}</time></trkpt>\n' for one in (clock(0), when, clock(1))]
    file = text(tmp_path / "a.gpx", f"<gpx><trk><trkseg>{''.join(rows)}</trkseg></trk></gpx>")
    said = failure(file)
    assert said == f"{file}:2: time is {when!r}; expected an ISO date and time of the years 1900 to 2199"


def test_of_many_wrong_lines_the_first_are_told(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        read_track(text(tmp_path / "a.csv", "t_s,x,y\n" + "late,1,2\n" * 1000))
    assert len(caught.value.parts) == 6
    assert str(caught.value).endswith("a.csv: 995 more lines are wrong")


def test_entities_are_not_followed(tmp_path: Path) -> None:
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    content = f'<!DOCTYPE gpx [<!ENTITY l0 "ha">{laughs}]><gpx><name>&l9;</name></gpx>'
    said = failure(text(tmp_path / "a.gpx", content))
    assert "not a GPX file (line 1: a document type, which GPX files do not have)" in said


@pytest.mark.parametrize("apart", ["5e-324", "1e-300", "1e-9", "0.0001"])
def test_fixes_too_near_for_a_speed(tmp_path: Path, apart: str) -> None:
    file = text(tmp_path / "a.csv", f"t_s,x,y\n0,1,2\n{apart},900,2\n5,6,7\n")
    assert failure(file).startswith(f"{file}:3: a fix {float(apart):g} s after the one before it; expected fixes")


def test_a_cell_is_shown_in_brief(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", f"t_s,x,y\n0,1,2\n1,{'7' * 90_000}z\x1b[31m,2\n")
    said = failure(file)
    assert said.startswith(f"{file}:3: x is '77777")
    assert len(said.removeprefix(str(file))) < 100
    assert "\x1b" not in said


def test_a_single_fix(tmp_path: Path) -> None:
    assert "single fix" in failure(gpx(tmp_path / "a.gpx", [(clock(0), 50.0, 8.0), (clock(0), 50.0, 8.0)]))


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("", "is empty"),
        ("a,b,c\n1,2,3\n", "has the columns a, b, c"),
        ("t_s,x\n1,2\n", "has the columns t_s, x"),
        ("t_s,x,y\n", "has no rows"),
        ("t_s,x,y\n0,0,0\n1,abc,0\n", "a.csv:3: x is 'abc'; expected metres"),
        ("t_s,x,y\n0,0,0\n1,nan,0\n", "a.csv:3: x is 'nan'; expected metres"),
        ("t_s,x,y\n0,0,0\n1\n", "a.csv:3: x is ''; expected metres"),
        ("time,lat,lon\nnoon,50,8\n", "a.csv:2: time is 'noon'; expected an ISO date and time"),
        ("time,lat,lon\n2024-05-06 08:00,95,8\n", "a.csv:2: lat is '95'; expected degrees from -90 to 90"),
    ],
)
def test_a_csv_file_that_is_no_track(tmp_path: Path, content: str, what: str) -> None:
    assert what in failure(text(tmp_path / "a.csv", content))


def test_columns_may_be_more_and_in_any_order_and_case(tmp_path: Path) -> None:
    file = text(tmp_path / "a.CSV", "\ufeffY, speed, X, T_s\n0, 9, 1, 5\n\n0, 9, 2, 6\n")
    assert read_track(file).at(1.0) == (2.0, 0.0, 1.0, 0.0)


def test_a_file_that_is_missing_or_of_another_kind(tmp_path: Path) -> None:
    assert "cannot be read (No such file or directory)" in failure(tmp_path / "none.gpx")
    assert "cannot be read (Is a directory)" in failure(make_folder(tmp_path / "folder.csv"))
    assert "unknown kind of track; expected a .gpx or .csv file" in failure(tmp_path / "ride.kml")


def make_folder(folder: Path) -> Path:
    folder.mkdir()
    return folder


@pytest.mark.parametrize(("start", "end"), [("09:00", "09:10"), ("07:00", "07:30"), ("08:00:31", "08:00:49")])
def test_an_empty_window_tells_what_the_file_covers(straight: Path, start: str, end: str) -> None:
    message = failure(straight, start, end)
    assert "no fix inside the window" in message
    assert "2024-05-06 08:00:00+00:00 to 2024-05-06 08:02:00+00:00" in message


def test_an_empty_window_of_seconds_tells_what_the_file_covers(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "t_s,x,y\n1,0,0\n2.5,1,0\n")
    assert "1 s to 2.5 s" in failure(file, "10", "20")


def test_a_window_that_ends_before_it_begins(straight: Path) -> None:
    assert "target.to: the window ends before it begins" in failure(straight, "08:01:30", "08:01:00")


@pytest.mark.parametrize("when", ["8 o'clock", "25:00", "08:61", "", "5"])
def test_what_is_no_time(straight: Path, when: str) -> None:
    assert "target.from" in failure(straight, when)
    assert "HH:MM[:SS]" in failure(straight, "08:00", when)


def test_seconds_for_a_file_that_counts_seconds(tmp_path: Path) -> None:
    file = text(tmp_path / "a.csv", "t_s,x,y\n1,0,0\n2.5,1,0\n")
    assert "'08:00' is not a time; expected seconds" in failure(file, "08:00")


# --- real recordings --------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "end"), [("07:50:00", "07:53:00"), ("07:58", "08:01"), ("08:07", "08:10")])
def test_a_real_bus_ride(data_file: DataFile, start: str, end: str) -> None:
    path = read_track(data_file("bus_304.gpx"), start, end)
    assert (path.start_s, path.end_s) == (0.0, 180.0)
    speeds = [hypot(*path.at(t / 10)[2:]) for t in range(1801)]  # type: ignore[index]
    assert 8.0 < max(speeds) < 16.0
    way = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(zip(path.x, path.y, strict=True)))
    assert way == pytest.approx(sum(speeds) / 10, rel=0.05)
    assert all(b - a > 5 for a, b in path.gaps if a > 0 and b < 180)


def test_a_parked_bus_stays_where_it_is(data_file: DataFile) -> None:
    path = read_track(data_file("bus_304.gpx"), "07:46", "07:49")
    assert (65.0, 137.0) in path.gaps  # the receiver slept for 72 s
    states = [path.at(t / 10) for t in range(1801)]
    assert max(hypot(state[0], state[1]) for state in states if state) < 10.0
    assert max(hypot(state[2], state[3]) for state in states if state) < 1.0


def test_a_real_flight(data_file: DataFile) -> None:
    path = read_track(data_file("aircraft_survey.csv"))
    assert path.gaps[:3] == ((33.0, 59.0), (1012.0, 1059.0), (1139.0, 1172.0))  # in turns, with a fix each 8 s else
    straight = read_track(data_file("aircraft_survey.csv"), "15:31", "15:41")
    assert straight.gaps == ()  # a fix each half minute is usual on its straight legs
    assert path.at(0.0)[2:] == pytest.approx((0.0, 66.0), abs=8.0)  # type: ignore[index]  # its log: 65 m/s, 5 degrees
    assert read_track(data_file("aircraft_survey.csv"), "14:40", "15:00").end_s == 1200.0
