"""``calibrate rss``: the kind of sensing fitted to recordings that the emulator drew."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from scipy.stats import binom, norm

from launcher.calibrate.memory import common
from launcher.calibrate.missing import missing_share
from launcher.calibrate.reports import Reports, reports_of
from launcher.calibrate.rss import calibrate_rss, fitted_rss
from launcher.calibrate.sensors import SensorFit
from tests.command_line import Call, trackfield
from tests.emulated_reports import places_of, walk, written
from tests.links import SURE
from trackfield.draw import normal, uniform
from trackfield.scenario import Scenario, survey
from trackfield.sensing.complete import Kind
from trackfield.sensing.rss import Rss

__all__ = ["trackfield"]

RANGES: Final = {
    "level_dbm": (-70.0, -40.0),
    "exponent": (1.5, 4.0),
    "shadow_sd_db": (2.0, 8.0),
    "slow": (0.2, 0.6),
    "slow_s": (2.0, 5.0),
    "missing": (0.0, 0.4),
}
WIDEST: Final = {"level_dbm": 12.0, "exponent": 1.2, "shadow_sd_db": 1.5, "slow": 0.3, "missing": 0.06}
"""No interval reaches farther from its figure: they are of use."""
SENSORS: Final = 10
SIDE_M: Final = 30.0
SEEDS: Final = range(12)


def truth_of(seed: int) -> dict[str, float]:
    return {key: low + (high - low) * uniform(seed, "truth", key) for key, (low, high) in RANGES.items()}


def offsets_of(seed: int) -> dict[str, float]:
    """0 in the mean, as those that are fitted."""
    drawn = np.array([3.0 * normal(seed, "offset", i) for i in range(SENSORS)])
    return {f"s{i}": float(one) for i, one in enumerate(drawn - drawn.mean())}


def drawn(
    folder: Path, seed: int, truth: dict[str, Any], *, walks: int = 3, walk_s: float = 60.0
) -> tuple[list[Path], Path]:
    kind = Kind("rss", Rss(offsets=offsets_of(seed), **truth))
    paths = [walk(number, SIDE_M, walk_s) for number in range(walks)]
    return written(folder, kind, places_of(SENSORS, SIDE_M, seed), paths, 0.5, seed)


def test_known_kinds_are_fitted_back(tmp_path: Path) -> None:
    """Of intervals of 95 %, those that miss are binomial; those of one fit are not independent of each other."""
    missed, of_offsets, far = dict.fromkeys(RANGES, 0), 0, []
    for seed in SEEDS:
        truth, own = truth_of(seed), offsets_of(seed)
        fit = calibrate_rss(*drawn(tmp_path / str(seed), seed, truth))
        assert fit.left.keys() == {"range_m", "fixed"}
        for key, (value, low, high) in fit.fitted.items():
            assert low < value < high
            missed[key] += not low <= truth[key] <= high
            far += [(seed, key)] if value - low > WIDEST.get(key, np.inf) else []
        of_offsets += sum(not one.low <= own[id] <= one.high for id, one in fit.own[1].items())
    assert all(count <= binom(len(SEEDS), 0.05).isf(SURE) for count in missed.values()), missed
    assert sum(missed.values()) <= binom(len(SEEDS) * len(RANGES), 0.05).isf(SURE), missed
    assert of_offsets <= 0.15 * len(SEEDS) * SENSORS
    assert not far


def test_what_is_not_there_is_not_found(tmp_path: Path) -> None:
    found = []
    for seed in range(6):
        truth = {**truth_of(seed), "slow": 0.0, "missing": 0.0}
        fit = calibrate_rss(*drawn(tmp_path / str(seed), seed, truth))
        assert fit.fitted["missing"].value == fit.fitted["missing"].high == 0.0
        found.append("slow" in fit.fitted)
    assert sum(found) <= binom(6, 0.05).isf(SURE)


def test_what_changes_slower_than_recordings_last_is_not_told(tmp_path: Path) -> None:
    truth = {**truth_of(3), "slow": 0.6, "slow_s": 200.0}
    fit = calibrate_rss(*drawn(tmp_path / "slow", 3, truth))
    assert {"slow", "slow_s"} <= fit.left.keys()
    assert fit.left["slow"] == fit.left["slow_s"]


def test_recordings_of_an_instant_each_say_nothing_of_time() -> None:
    """Sixty of them, with one report each."""
    count = np.arange(60)
    away = 2.0 + 18.0 * np.array([[uniform(1, k, i) for i in range(3)] for k in count])
    own = away[count, count % 3]
    value = -50.0 - 20.0 * np.log10(own) + np.array([3.0 * normal(1, k) for k in count])
    reports = Reports(tuple(map(str, count)), ("a", "b", "c"), count, count % 3, np.zeros(60), own, value, count, away)
    fit = fitted_rss(reports)
    assert {"slow", "slow_s", "missing"} <= fit.left.keys()
    assert fit.fitted["exponent"].low < 2.0 < fit.fitted["exponent"].high


def test_the_correlation_is_that_of_the_emulator() -> None:
    """A whole interval apart it is the integral of p (1 - p) / (p^2 + (1 - p)^2)."""
    assert common(np.array([0.0, 1.0, 2.0, 3.0])) == pytest.approx([1.0, np.pi / 4.0 - 0.5, 0.0, 0.0], abs=1e-6)
    assert common(np.array([0.5])) == pytest.approx(0.74, abs=0.005)


@pytest.mark.parametrize(("share", "sensors", "unseen"), [(0.4, 3, 0.06), (0.7, 6, 0.12)])
def test_instants_of_which_nothing_is_left_count_as_well(
    tmp_path: Path, share: float, sensors: int, unseen: float
) -> None:
    """The share of all instants that is ``unseen`` has no report: without these, less would seem to be missing."""
    kind = Kind("rss", Rss(missing=share))
    (file,), where = written(tmp_path / "few", kind, places_of(sensors, SIDE_M, 1), [walk(0, SIDE_M, 1500.0)], 0.5, 1)
    reports = reports_of([file], where)
    assert len(reports.away_m) / 3001 == pytest.approx(1.0 - unseen, abs=0.02)
    sd = (share * (1.0 - share) / 3001 / sensors) ** 0.5
    found = missing_share(reports, np.ones(len(reports.value), bool))
    assert found == pytest.approx(share, abs=norm.isf(SURE) * sd)


def test_sensors_that_report_one_after_the_other_say_nothing_of_what_is_missing(tmp_path: Path) -> None:
    kind, places = Kind("rss", Rss()), places_of(SENSORS, SIDE_M, 1)
    (file,), sensors = written(tmp_path / "walk", kind, places, [walk(0, SIDE_M, 100.0)], 1.0, 1)
    head, *lines = file.read_text().splitlines()
    rows = [line.split(",", 2) for line in lines]
    later = sorted((float(t_s) + 0.09 * int(sensor[1:]), sensor, rest) for t_s, sensor, rest in rows)
    file.write_text("\n".join([head, *(f"{t:.3f},{sensor},{rest}" for t, sensor, rest in later)]) + "\n")
    fit = calibrate_rss([file], sensors)
    assert fit.left["missing"] == "not fitted: the sensors do not report at the same instants"


def test_a_sensor_that_was_heard_for_a_short_time_harms_no_other(tmp_path: Path) -> None:
    """Its own offset has no interval."""
    files, sensors = drawn(tmp_path / "walks", 2, {**truth_of(2), "missing": 0.0})
    whole = calibrate_rss(files, sensors)
    for number, file in enumerate(files):
        lines = file.read_text().splitlines(keepends=True)
        file.write_text(
            "".join(line for i, line in enumerate(lines) if ",s4," not in line or (number == 0 and i < 150))
        )
    part = calibrate_rss(files, sensors)
    assert part.own[1]["s4"].high == np.inf
    assert "s4 = " in part.fragment(sensors).toml()
    assert "no interval: it reported for a short time only" in part.fragment(sensors).toml()
    for key in ("level_dbm", "exponent", "shadow_sd_db"):
        assert part.fitted[key].high - part.fitted[key].low < 2.0 * (whole.fitted[key].high - whole.fitted[key].low)


# --- the command ---


def scenario_of(folder: Path, text: str) -> Scenario:
    head = 'name = "field"\n[field]\nlayout = "file"\nfile = "sensors.csv"\n[target]\npath = "waypoints"\n'
    (folder / "field.toml").write_text(f"{head}waypoints = [[0, 0, 15], [60, 30, 15]]\n{text}")
    return Scenario.load(folder / "field.toml")


def test_a_fragment_is_a_section_of_a_scenario(trackfield: Call, tmp_path: Path) -> None:
    """What is written is what was fitted, and a field takes it."""
    files, sensors = drawn(tmp_path / "walks", 4, truth_of(4))
    said = trackfield("calibrate", "rss", *files, "--sensors", sensors, "--out", "rss.toml")
    assert said.code == 0, said.err
    text, fit = (tmp_path / "rss.toml").read_text(), calibrate_rss(files, sensors)
    section = tomllib.loads(text)["sensor"]
    assert section.pop("offsets") == {id: float(f"{one.value:.4g}") for id, one in fit.own[1].items()}
    assert section == fit.section
    assert all(f"{one.low:.4g} to {one.high:.4g}" in text for one in (*fit.fitted.values(), *fit.own[1].values()))
    (tmp_path / "sensors.csv").write_text(sensors.read_text())
    scenario = scenario_of(tmp_path, text)
    assert scenario.sensor.model_dump(exclude_unset=True) == tomllib.loads(text)["sensor"]
    assert survey(scenario).sensor(3).to_plain()["options"]["offsets"].keys() == {"s3"}


@pytest.mark.rendered
def test_it_is_printed_and_drawn(trackfield: Call, tmp_path: Path) -> None:
    files, sensors = drawn(tmp_path / "walks", 5, truth_of(5))
    once, again = (trackfield("calibrate", "rss", *files, "--sensors", sensors) for _ in range(2))
    assert once.code == 0, once.err
    assert once.out == again.out
    assert "walk_0.csv, walk_1.csv, walk_2.csv" in once.out
    said = trackfield("calibrate", "rss", *files, "--sensors", sensors, "--picture", "left.png")
    assert said.out == once.out
    assert (tmp_path / "left.png").read_bytes().startswith(b"\x89PNG")


def test_residuals_are_those_of_the_line(tmp_path: Path) -> None:
    fit: SensorFit = calibrate_rss(*drawn(tmp_path / "walks", 6, truth_of(6)))
    by_sensor = np.bincount(fit.reports.sensor, fit.residual)
    assert by_sensor == pytest.approx(np.zeros(SENSORS), abs=1e-6)
    assert fit.residual @ np.log10(fit.reports.distance_m) == pytest.approx(0.0, abs=1e-5)


def test_reports_that_no_target_gives_are_left_out_and_told(tmp_path: Path) -> None:
    files, sensors = drawn(tmp_path / "walks", 7, truth_of(7))
    rows = files[1].read_text().splitlines(keepends=True)
    without, with_them = rows.copy(), rows.copy()
    for at, value in ((400, "42"), (700, "-300")):
        t_s, id, _, x, y = rows[at].split(",")
        with_them[at], without[at] = f"{t_s},{id},{value},{x},{y}", ""
    found = []
    for lines in (without, with_them):
        files[1].write_text("".join(lines))
        found.append(calibrate_rss(files, sensors))
    clean, cleaned = found
    assert cleaned.fitted == clean.fitted
    assert cleaned.own == clean.own
    assert clean.notes[1] == ""
    assert cleaned.notes[1].startswith("2 reports are left out, more than 6 standard deviations off: 42 of s")
    assert cleaned.notes[1] in cleaned.fragment(sensors).toml()


def test_where_many_are_far_off_none_is_left_out(tmp_path: Path) -> None:
    """They are no outliers then: the kind does not fit."""
    files, sensors = drawn(tmp_path / "walks", 7, truth_of(7))
    rows = files[1].read_text().splitlines(keepends=True)
    for at in range(20, 400, 10):
        t_s, id, _, x, y = rows[at].split(",")
        rows[at] = f"{t_s},{id},42,{x},{y}"
    files[1].write_text("".join(rows))
    fit = calibrate_rss(files, sensors)
    assert fit.notes[1] == ""
    assert (fit.reports.value == 42.0).sum() == 38


def test_a_recording_with_two_impossible_readings() -> None:
    """The one that comes with Trackfield."""
    fit = calibrate_rss([Path("walk_05.csv")], Path("hall_sensors.csv"))
    assert "42 of sensor30 at 7.4 s, 29 of sensor30 at 86.0 s" in fit.notes[1]
    assert fit.fitted["shadow_sd_db"].value == pytest.approx(5.09, abs=0.005)


Change = Callable[[str], str]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace(",s3,", ",x3,"), "has reports of 'x3', whose place is not in sensors.csv; expected"),
        (lambda text: text + text.splitlines()[5] + "\n", "t_s goes back, from 60.0 to 0.0"),
        (lambda text: text.replace(",s3,-", ",s3,nan", 1), "value is 'nan"),
        (lambda text: _cut(text, (0, 1, 2)), "does not say where the target was; expected the columns x_m and y_m"),
        (lambda text: "", "walk_0.csv: is empty; expected a CSV file with columns t_s"),
        (lambda text: text.splitlines()[0] + "\n", "walk_0.csv: has no rows"),
        (lambda text: "".join(text.splitlines(keepends=True)[:60]), "expected at least"),
        (lambda text: _without(text, "s3"), "0 reports of 's3' while it is known where the target is; expected at"),
        (lambda text: _cut(text, (0, 1, 2, 2, 3, 4)), "has the column 'value' twice"),
        (lambda text: _cut(text, (0, 1, 3, 4)), "has 0 columns of numbers (); expected one, besides t_s, sensor"),
    ],
)
def test_recordings_that_cannot_be_used(trackfield: Call, tmp_path: Path, change: Change, message: str) -> None:
    """One message each; the exit code is 2."""
    files, sensors = drawn(tmp_path / "walks", 7, {**truth_of(7), "missing": 0.0}, walks=1)
    files[0].write_text(change(files[0].read_text()))
    said = trackfield("calibrate", "rss", *files, "--sensors", sensors)
    assert said.code == 2
    assert message in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


def _cut(text: str, columns: tuple[int, ...]) -> str:
    return "".join(",".join(line.split(",")[i] for i in columns) + "\n" for line in text.splitlines())


def _without(text: str, id: str) -> str:
    return "".join(line for line in text.splitlines(keepends=True) if f",{id}," not in line)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("walk.csv",), "Missing option '--sensors'"),
        (("walk.csv", "--sensors", "sensors.csv"), "walk.csv: cannot be read (No such file"),
        (("w.csv", "w.csv", "--sensors", "sensors.csv"), "w.csv: is given twice; expected each recording once"),
        (("walk.csv", "--sensors", "none.csv"), "none.csv: cannot be read"),
        (("walk.csv", "--sensors", "sensors.csv", "--out", "no/such/folder"), "--out"),
        (("walk.csv", "--sensors", "sensors.csv", "--picture", "no/such/folder"), "--picture"),
        (("walk.csv", "--sensors", "sensors.csv", "--picture", "x.pdf"), "is no PNG file; expected a name that ends"),
    ],
)
def test_bad_arguments(trackfield: Call, tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    (tmp_path / "sensors.csv").write_text("id,x,y\ns1,0,0\n")
    said = trackfield("calibrate", "rss", *arguments)
    assert said.code == 2
    assert message in said.err
    assert "Traceback" not in said.err
    assert not (tmp_path / "x.pdf").exists()


def test_a_kind_that_no_scenario_can_have_is_told(trackfield: Call, tmp_path: Path) -> None:
    """Levels that rise with distance."""
    kind = Kind("rss", Rss(level_dbm=-90.0, exponent=-2.0, shadow_sd_db=0.5))
    files, sensors = written(tmp_path / "odd", kind, places_of(5, SIDE_M, 1), [walk(0, SIDE_M, 60.0)], 0.5, 1)
    said = trackfield("calibrate", "rss", *files, "--sensors", sensors)
    assert said.code == 2
    assert "fits only with sensor.exponent = -" in said.err
    assert said.err.count("\n") == 1


def test_walks_through_a_hall(data_file: Callable[[str], Path]) -> None:
    """What docs/calibration.md says of them."""
    files = [data_file(f"ble/walk_0{number}.csv") for number in (1, 2, 3)]
    fit = calibrate_rss(files, data_file("ble/sensors.csv"))
    assert fit.fitted["exponent"].value == pytest.approx(1.61, abs=0.005)
    assert fit.fitted["shadow_sd_db"].value == pytest.approx(5.32, abs=0.005)
    assert fit.fitted["missing"].value == pytest.approx(0.152, abs=0.0005)
    assert fit.own[1]["sensor30"].value == pytest.approx(-7.12, abs=0.005)
