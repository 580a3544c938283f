"""Recorded reports: how files are read, and when a sensor plays what they say."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.sensing.kinds import make_sensor
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.placed import Placed, Played
from trackfield.world.recording import Recording, Start, read_recording
from trackfield.world.scene import Scene

HEADER = "t_s,sensor,rssi_dbm,x_m,y_m\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "reports.csv"


def read(file: Path, text: str) -> Recording:
    file.write_text(text)
    return read_recording(file)


# --- files --------------------------------------------------------------------------------------------------------


def test_reports_are_read_by_sensor_and_the_target_by_its_fixes(file: Path) -> None:
    """Rows that follow each other at once tell of one place of the target."""
    found = read(file, HEADER + "5,a,-70,0,0\n5.002,b,-80,0,0\n6,a,-71,1,2\n6.001,b,-81,1,2\n7,b,-82,2,4\n")
    assert found.readings["a"] == ((5 * NS, (-70.0,)), (6 * NS, (-71.0,)))
    assert [values for _, values in found.readings["b"]] == [(-80.0,), (-81.0,), (-82.0,)]
    assert found.columns == ("rssi_dbm",)
    assert found.truth is not None
    assert found.truth.t == (5.0, 6.0, 7.0)
    assert found.truth.at(6.5) == pytest.approx((1.5, 3.0, 1.0, 2.0))


def test_a_parquet_file_says_the_same(file: Path) -> None:
    rows = {"t_s": [0.0, 0.1], "sensor": ["a", "b"], "level": [1.5, -2.0], "x": [0.0, None], "y": [1.0, None]}
    parquet = file.with_suffix(".parquet")
    pq.write_table(pa.table(rows), parquet)
    found = read_recording(parquet)
    assert found.readings == {"a": ((0, (1.5,)),), "b": ((NS // 10, (-2.0,)),)}
    assert found.truth is None


def test_other_order_of_columns_dates_and_several_numbers(file: Path) -> None:
    text = "level,sensor,bearing,time\n60,a,10,2024-05-01T10:00:00Z\n61,b,20,2024-05-01T12:00:00.5+02:00\n"
    found = read(file, text)
    assert (found.columns, found.zero) == (("level", "bearing"), datetime(2024, 5, 1, 10, tzinfo=UTC))
    assert found.readings["b"] == ((NS // 2, (61.0, 20.0)),)


def test_a_target_whose_place_is_known_at_times(file: Path) -> None:
    found = read(file, HEADER + "0,a,-70,,\n1,a,-70,3,4\n2,b,-70,,\n3,a,-70,5,4\n4,a,-70,,\n")
    assert found.truth is not None
    assert (found.truth.start_s, found.truth.end_s) == (1.0, 3.0)
    assert read(file, HEADER + "0,a,-70,1,1\n1,a,-71,,\n").truth is None


def test_a_file_that_changed_is_read_again(file: Path) -> None:
    assert len(read(file, HEADER + "0,a,-70,,\n").t_s) == 1
    assert len(read(file, HEADER + "0,a,-70,,\n1,a,-70,,\n").t_s) == 2


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "is empty; expected a CSV file with columns t_s (or time), sensor, the numbers of a report, and x_m,y_m"),
        (HEADER, "has no rows"),
        ("a,b\n1,2\n", "has the columns a, b; expected"),
        ("t_s,sensor,v,v\n0,a,1,1\n", "has the column 'v' twice"),
        ("t_s,sensor,v,x_m\n0,a,1,1\n", "has no column y_m"),
        (HEADER + "0,a,nan,0,0\n", ":2: rssi_dbm is 'nan'; expected a number"),
        (HEADER + "0,a,,0,0\n", ":2: rssi_dbm is ''; expected a number"),
        (HEADER + "0,,-70,0,0\n", ":2: sensor is ''; expected a sensor's id"),
        (HEADER + "inf,a,-70,0,0\n", ":2: t_s is 'inf'; expected seconds"),
        (HEADER + "0,a,-70,far,0\n", ":2: x_m is 'far'; expected metres, or empty"),
        (HEADER + "0,a,-70,0,\n", ":2: has one coordinate; expected both, or none"),
        (HEADER + "1,a,-70,0,0\n0,b,-70,0,0\n", ":3: t_s goes back, from 1.0 to 0.0; expected rows in order of time"),
        (HEADER + "1,a,-70,0,0\n1,a,-70,0,0\n", ":3: 'a' reports twice at 1.0; expected one report of a sensor"),
        ("time,sensor,v\n2024-05-01T10:00,a,1\n2024-05-01T10:00Z,a,1\n", ":3: time is 2024-05-01 10:00:00+00:00"),
        ("t_s,sensor,v\n0,a,\x00\n", ": not a CSV file (line 2: the byte 0x00 is not text)"),
    ],
)
def test_what_is_no_recording_is_told(file: Path, text: str, error: str) -> None:
    with pytest.raises(ScenarioError) as raised:
        read(file, text)
    assert str(raised.value).startswith(str(file))
    assert error in str(raised.value)


def test_a_file_that_is_not_there_or_is_none(file: Path) -> None:
    for one in (file, file.parent):
        with pytest.raises(ScenarioError, match="cannot be read"):
            read_recording(one)
    broken = file.with_suffix(".parquet")
    broken.write_text(HEADER)
    with pytest.raises(ScenarioError, match="not a Parquet file"):
        read_recording(broken)


# --- when a run begins --------------------------------------------------------------------------------------------


def recording(*t_s: float, zero: datetime | None = None) -> Recording:
    return Recording("reports.csv", ("v",), t_s, {}, None, zero)


def test_the_first_step_is_half_a_step_before_the_first_report_of_all() -> None:
    assert Start.of([recording(5.0, 6.0), recording(4.0)], 0.5) == (None, 3.75)
    noon = datetime(2024, 5, 1, 12, tzinfo=UTC)
    late = recording(0.0, zero=noon.replace(hour=13))
    assert Start.of([late, recording(0.0, zero=noon)], 1.0) == (late.zero, -3600.5)


def test_dates_and_seconds_do_not_go_together() -> None:
    dated = recording(0.0, zero=datetime(2024, 5, 1, tzinfo=UTC))
    with pytest.raises(ScenarioError, match=r"has seconds, and the target's file has dates; expected dates, so that"):
        recording(0.0).first_step_s(Start(dated.zero, 0.0))
    with pytest.raises(ScenarioError, match="has dates, and another recording has seconds"):
        Start.of([dated, recording(0.0)], 1.0)


# --- a sensor that plays ------------------------------------------------------------------------------------------

PLAYED: tuple[Played, ...] = ((NS, (-70.0,)), (2 * NS, (-71.25,)))


def placed(*, times: bool = False) -> Placed:
    kind = make_sensor("rss", {}, recorded=True)
    return Placed("a", (0.0, 0.0), Scene(()), ((NS, 2 * NS),), kind, {}, kind.threshold, 1, 0, PLAYED, times)


def test_a_sensor_plays_what_was_reported_when_it_was() -> None:
    sensor = placed()
    assert (sensor.next_window(0), sensor.next_window(NS), sensor.next_window(2 * NS)) == (NS, 2 * NS, None)
    reading = sensor.sample(2 * NS)
    assert reading is not None
    assert reading.values == (-71.25,)
    message = reading.report(3, 400_000_000)
    assert sensor.kind.takes(message)
    assert sensor.kind.values(message) == (-71.25,)
    assert sensor.kind.early_s(message) == pytest.approx(0.4)


def test_a_recorded_reading_is_there_for_a_moment() -> None:
    """A clock that is read in whole nanoseconds may be a little early, one that was set a little late."""
    sensor = placed()
    assert sensor.sample(NS - 2000) is None
    assert sensor.sample(NS - 500) == sensor.sample(NS) == sensor.sample(NS + 9_000_000)
    assert sensor.sample(NS + 20_000_000) is None


def test_only_times_are_played_of_an_emulated_target() -> None:
    assert placed(times=True).sample(NS) is None  # no target is there
    assert placed(times=True).next_window(0) == NS


@pytest.mark.parametrize("times", [False, True])
def test_a_sensor_that_plays_is_the_same_at_its_node(times: bool) -> None:
    sensor = placed(times=times)
    again = Placed.from_plain(sensor.to_plain())
    assert (again.times, again.events(), again.to_plain()) == (times, sensor.events(), sensor.to_plain())
    assert again.sample(NS) == sensor.sample(NS)


def test_faults_are_those_of_any_sensor() -> None:
    biased = Faulty(placed(), (SensorFault("bias", 0, None, (3.0,)),)).sample(NS)
    assert biased is not None
    assert biased.values == (-67.0,)
    assert Faulty(placed(), (SensorFault("deaf", 0),)).sample(NS) is None
    stuck = Faulty(placed(), (SensorFault("stuck", NS * 3 // 2),)).sample(2 * NS)
    assert stuck is not None
    assert stuck.values == (-70.0,)
