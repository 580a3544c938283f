"""Two targets that cross in a field of bearings, after a time of setup: what is sensed, tracked, scored and shown."""

from __future__ import annotations

import json
from math import cos, hypot, radians, sin
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from launcher.plan.prepare import load, planned
from launcher.record.virtually import simulate
from launcher.records import Plan
from launcher.report.parts.verdicts import NEAREST
from tests.command_line import Call, trackfield
from tests.reporting import read as page_of
from tests.rrd import read
from tests.running import both_ways
from trackfield.role import NS

__all__ = ["trackfield"]

CROSSING = (
    "target={path='waypoints', waypoints=[[0, 107, 103], [20, 397, 411]], id='car'}",
    "targets=[{path='waypoints', waypoints=[[0, 110, 400], [16, 400, 110]], id='truck'}]",
)
SETUP_S = 3.5
SETTINGS = (*CROSSING, f"run.setup_s={SETUP_S}", "faults=[{kind='kill', nodes=['n060'], at_s=12}]")


def crossing(*settings: str) -> Plan:
    return planned(load("zhai-spcpf", settings=(*CROSSING, *settings)))


# --- what is sensed ---------------------------------------------------------------------------------------------------


def test_each_report_is_of_the_target_that_is_louder_at_the_sensor() -> None:
    """Without noise a bearing points to the nearer of the two, as both are equally loud."""
    plan = crossing("sensor.doa_sd_deg=0.001", "link.model=ideal", "fusion.trackers=['predict-only']")
    ledger, _ = simulate(plan)
    places = {place.id: (place.x, place.y) for place in plan.info.places}
    told = {"car": 0, "truck": 0}
    for row in ledger.rows:
        x, y = places[row.src]
        ways = {id: path.at(row.sent_ns / NS) for id, path in plan.paths.items()}
        away = {id: hypot(way[0] - x, way[1] - y) for id, way in ways.items() if way}
        louder = min(away, key=away.__getitem__)
        told[louder] += 1
        dx, dy = ways[louder][0] - x, ways[louder][1] - y  # type: ignore[index]
        angle = radians(row.values[0])
        assert (sin(angle), cos(angle)) == pytest.approx((dx / hypot(dx, dy), dy / hypot(dx, dy)), abs=1e-3)
        assert away[louder] < 57.0
    assert min(told.values()) > 20


# --- the same in both drivers -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    settings = [part for one in (*SETTINGS, "clock.offset_ms=20") for part in ("--set", one)]
    return both_ways(tmp_path_factory.mktemp("crossing"), "zhai-spcpf", *settings, "--quiet", reported=True)


@pytest.fixture(autouse=True)
def inside(folders: Path, trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folders)


def test_the_drivers_agree(trackfield: Call) -> None:
    said = trackfield("compare", "processes", "virtual", "--exact", "0")
    assert said.code == 0, said.err


def test_steps_come_after_the_setup_and_times_count_from_the_first() -> None:
    rows = pq.read_table("virtual/tracks.parquet").to_pylist()
    assert {row["at_ns"] - round(row["t_s"] * NS) for row in rows} == {round(SETUP_S * NS)}
    assert {row["step"] for row in rows} == set(range(1, 21))
    assert all(row["t_s"] == row["step"] for row in rows)
    assert {round(row["told_s"] - row["t_s"], 9) for row in rows} == {0.3}
    frames = pq.read_table("virtual/messages.parquet").to_pylist()
    asked = [row["sent_ns"] for row in frames if row["kind"] == "sync-request"]
    reports = [row["sent_ns"] for row in frames if row["kind"] == "doa"]
    assert min(asked) < SETUP_S * NS < min(reports)  # clocks are set before the first step


def test_the_nearest_target_is_the_truth_and_each_has_its_figures() -> None:
    metrics = json.loads(Path("virtual", "metrics.json").read_text())
    rows = pq.read_table("virtual/tracks.parquet").to_pylist()
    assert metrics["bound"] == {"position": None, "trajectory": None}
    paths = crossing(f"run.setup_s={SETUP_S}").paths
    for row in rows:
        if row["x"] is not None:
            states = {id: path.at(row["at_ns"] / NS) for id, path in paths.items()}
            away = {id: hypot(row["x"] - state[0], row["y"] - state[1]) for id, state in states.items() if state}
            assert row["true_target"] == min(away, key=away.__getitem__)
    for name, found in metrics["trackers"].items():
        assert found["association"] == "nearest"
        own = [row for row in rows if row["tracker"] == name and row["x"] is not None]
        for target in ("car", "truck"):
            errors = [
                (row["x"] - row["true_x"]) ** 2 + (row["y"] - row["true_y"]) ** 2
                for row in own
                if row["true_target"] == target
            ]
            assert found["targets"][target]["steps"] == len(errors)
            rmse = pytest.approx((sum(errors) / len(errors)) ** 0.5) if errors else None
            assert found["targets"][target]["rmse"] == rmse
        assert sum(one["steps"] for one in found["targets"].values()) == found["steps"]


def test_both_truths_are_in_picture_and_page(trackfield: Call) -> None:
    for target, (x, y) in (("car", (121.5, 118.4)), ("truck", (128.125, 381.875))):
        at = dict(read(Path("virtual", "run.rrd"), f"/field/truth/{target}/position", "Points2D:positions"))
        assert at[1.0][0] == [pytest.approx(x), pytest.approx(y)]
    kills = [t for t, said in read(Path("virtual", "run.rrd"), "/faults", "TextLog:text") if "n060" in said[0]]
    assert kills[0] == 12.0
    said = page_of(Path("virtual")).text
    assert "target car" in said
    assert "target truck" in said
    assert NEAREST in said


def test_it_is_fused_again_the_same(trackfield: Call) -> None:
    assert trackfield("replay", "virtual", "--out", "again").code == 0
    said = trackfield("compare", "virtual", "again", "--exact", "1e-9")
    assert said.code == 0, said.err
