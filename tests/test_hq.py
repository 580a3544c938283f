"""A fusion centre by another name: commands, pages and faults go by what a place is for, not by what it is called."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import trackfield as tf
from tests.command_line import Call, trackfield
from tests.reporting import read as page_of
from tests.rrd import entities
from tests.running import both_ways

__all__ = ["trackfield"]

HQ = "architecture.centre=hq"
FAULTS = (
    "faults=[{kind='restart', nodes=['hq'], at_s=4.4, until_s=6.2},"
    "{kind='freeze', role='fusion', at_s=8, until_s=8.5},"
    "{kind='partition', role='fusion', medium='field', at_s=9, until_s=10},"
    "{kind='kill', role='node', share=0.2, at_s=9},"
    "{kind='clock_jump', nodes=['hq'], at_s=10.5, jump_ms=20}, {kind='stuck', share=0.1, at_s=2}]"
)
COMMON = ("--set", HQ, "--set", FAULTS, "--set", "target.steps=12", "--set", "clock.offset_ms=20", "--nodes", "36")
COMMANDED = ("--set", "sensor.threshold=adaptive", "--set", "energy.centre_battery_j=5000")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return both_ways(tmp_path_factory.mktemp("hq"), "zhai-spcpf", *COMMON, *COMMANDED, "--quiet")


@pytest.fixture(autouse=True)
def inside(folders: Path, trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folders)


def test_its_place_is_known_by_its_tags() -> None:
    metrics = json.loads(Path("virtual", "metrics.json").read_text())
    assert set(metrics["trackers"]["spcpf"]["sources"]) == {"hq"}
    assert metrics["trackers"]["spcpf"]["views"].keys() == {"base"}
    assert metrics["bound"]["trajectory"] is not None
    assert metrics["frames"]["by_kind"].keys() == {"doa", "sync-reply", "sync-request", "threshold"}
    assert metrics["frames"]["lost"]["partition"] > 0
    assert set(pq.read_table("virtual/tracks.parquet")["source"].to_pylist()) == {"hq"}
    ends = pq.read_table("virtual/messages.parquet", columns=["src", "dst"]).to_pydict()
    assert "hq" in ends["dst"] and "hq" in ends["src"] and "fusion" not in {*ends["src"], *ends["dst"]}


def test_the_drivers_agree(trackfield: Call) -> None:
    said = trackfield("compare", "processes", "virtual", "--exact", "0")
    assert said.code == 0, said.err


def test_pictures_and_pages_name_it(trackfield: Call) -> None:
    drawn = entities(Path("virtual", "run.rrd"))
    assert {"/state/hq", "/field/spcpf/position", "/field/truth/target/path"} <= set(drawn)
    assert not [name for name in drawn if "fusion" in name]
    assert trackfield("report", "virtual").code == 0
    assert "4.4 s restart until 6.2 s hq planned" in page_of(Path("virtual")).text


def test_replay_goes_by_its_report_sets(trackfield: Call) -> None:
    said = trackfield("replay", "virtual", "--out", "again")
    assert said.code == 0, said.err
    assert trackfield("compare", "virtual", "again", "--exact", "1e-9").code == 0
    before, after = (json.loads(Path(run, "metrics.json").read_text()) for run in ("virtual", "again"))
    assert {key for key in before if before[key] != after[key]} <= {"driver", "wall_s", "cpu_s"}


def test_validate_names_the_way_to_it(trackfield: Call) -> None:
    said = trackfield("validate", "zhai-spcpf", "--set", HQ, "--set", "clock.offset_ms=5")
    assert said.code == 0
    assert "reception of doa at hq from 25 sensor nodes that will report" in said.err
    assert "reception of sync-reply at 25 sensor nodes that will report from hq" in said.err


def test_a_fault_of_one_that_is_not_there_names_those_who_are(trackfield: Call) -> None:
    def refused(*settings: str) -> str:
        said = trackfield("run", "zhai-spcpf", "--virtual", *(part for one in settings for part in ("--set", one)))
        assert said.code == 2
        return said.err

    assert "there is no 'fusion'" in refused(HQ, "faults=[{kind='kill', nodes=['fusion'], at_s=3}]")
    wrong = refused(HQ, "faults=[{kind='kill', role='hq', at_s=3}]")
    assert "faults[0].role: no process has the role 'hq'; expected one of fusion, node" in wrong
    assert "a fusion has no sensor, and stuck is a fault of sensors" in refused(
        "faults=[{kind='stuck', role='fusion', at_s=3}]"
    )


def test_a_surveyed_field_may_call_it_so(tmp_path: Path, trackfield: Call) -> None:
    posts = [f"n{i},{40 * i},{30 * i}" for i in range(12)]
    (tmp_path / "posts.csv").write_text(
        "\n".join(["id,x,y,role", *(f"{post},node" for post in posts), "hq,100,9,fusion"])
    )
    args = (
        "run",
        "zhai-spcpf",
        "--virtual",
        "--quiet",
        "--sensors",
        str(tmp_path / "posts.csv"),
        "--set",
        "target.steps=3",
    )
    assert trackfield(*args, "--set", HQ, "--out", str(tmp_path / "run")).code == 0
    said = trackfield(*args, "--out", str(tmp_path / "other"))
    assert said.code == 2
    assert "hq" in said.err and "architecture.centre" in said.err


def test_a_study_of_it(tmp_path: Path) -> None:
    found = tf.study(
        tf.Scenario.load("zhai-spcpf").set("architecture.centre", "hq").set("target.steps", 3), range(2), n_jobs=1
    )
    assert set(found.results[0].tracks["source"].to_pylist()) == {"hq"}
