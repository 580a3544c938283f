"""What the command line says when all is well, to people on stderr and to scripts on stdout."""

from __future__ import annotations

import json
import re
import shutil
from importlib.metadata import version
from pathlib import Path
from typing import get_args

import pyarrow.parquet as pq
import pymap3d
import pytest

from tests.command_line import Call, trackfield
from trackfield.filters.single_model import Ekf
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario, names, survey
from trackfield.scenario.links import LINKS
from trackfield.world.tracks import track_origin

__all__ = ["trackfield"]

BUS = Path(__file__).parents[1] / "trackfield" / "scenario" / "bus.gpx"
SHORT = ("--virtual", "--set", "target.steps=8")


def test_a_run_ends_by_naming_its_folder_and_the_next_command(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("run", "spcpf", *SHORT, "--out", "mine")
    assert (said.code, said.out) == (0, "")
    first, *_, folder, page, following = said.err.splitlines()
    assert first == "zhai-spcpf: 121 sensor nodes, 9 s, link lognormal_prr, seed 1, trackers imm-ukf, spcpf"
    assert (folder, page) == ("run folder: mine", "report: mine/report.html")
    assert following == "next: trackfield view mine"
    for tracker in ("imm-ukf", "spcpf"):
        assert re.search(rf"{tracker} +│ +\d\.\d\d m ", said.err)
    files = {file.name for file in (tmp_path / "mine").iterdir()}
    assert files == {
        "scenario.toml", "manifest.json", "run.rrd", "messages.parquet", "tracks.parquet", "metrics.json", "logs",
        "plots", "report.html",
    }  # fmt: skip


def test_a_folder_of_its_own_carries_scenario_seed_and_time(trackfield: Call, tmp_path: Path) -> None:
    assert trackfield("run", "spcpf", *SHORT, "--seed", "7", "--quiet").code == 0
    (run,) = (tmp_path / "runs").iterdir()
    assert re.fullmatch(r"zhai-spcpf-7-\d{8}T\d{6}\.\d{3}", run.name)


def test_an_empty_folder_will_do(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    assert trackfield("run", "spcpf", *SHORT, "--quiet", "--out", "mine").code == 0
    assert (tmp_path / "mine" / "metrics.json").is_file()


def test_json_is_all_of_stdout(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("run", "spcpf", *SHORT, "--json", "--out", "mine")
    assert said.code == 0
    assert said.out == (tmp_path / "mine" / "metrics.json").read_text()
    assert json.loads(said.out)["driver"] == "virtual"
    assert said.err.endswith("next: trackfield view mine\n")


def test_quiet_says_nothing_but_errors(trackfield: Call) -> None:
    said = trackfield("run", "spcpf", *SHORT, "--quiet", "--out", "mine")
    assert (said.code, said.out, said.err) == (0, "", "")
    said = trackfield("run", "spcpf", *SHORT, "--quiet", "--out", "mine")
    assert (said.code, said.out) == (2, "")
    assert "mine" in said.err
    said = trackfield("run", "spcpf", *SHORT, "--quiet", "--json", "--out", "other")
    assert (said.code, said.err) == (0, "")
    assert json.loads(said.out)["scenario"] == "zhai-spcpf"


def test_a_link_that_loses_all_says_so(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("run", "spcpf", "--virtual", "--set", "link.loss=1", "--out", "mine")
    assert said.code == 0
    metrics = json.loads((tmp_path / "mine" / "metrics.json").read_text())
    frames = metrics["frames"]
    assert frames["expected"] == frames["sent"] == frames["lost"]["radio"] > 200
    assert frames["delivered"] == 0
    lost = f"none of {frames['sent']} frames arrived ({frames['sent']} lost on the link)"
    assert f"{lost}: no tracker had any report, only its prior" in said.err.replace("\n", " ")
    assert all(tracker["steps_tracked"] for tracker in metrics["trackers"].values())
    assert [tracker["lost"] for tracker in metrics["trackers"].values()] == [True, True]
    assert len(re.findall(r"│ lost +│", said.err)) == 2


def test_the_schema_knows_every_section(trackfield: Call) -> None:
    said = trackfield("list", "--schema")
    assert (said.code, said.err) == (0, "")
    schema = json.loads(said.out)
    assert {"name", "seed", "field", "sensor", "target", "link", "fusion"} <= schema["properties"].keys()
    assert schema["additionalProperties"] is False


def test_validate_says_what_it_comes_to_and_leaves_nothing(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("validate", "bus", "--set", "link.model=ideal", "--set", "target.from=08:00:30")
    assert (said.code, said.out) == (0, "")
    first, coverage, reports, *receptions, last = said.err.splitlines()
    assert re.fullmatch(r"bus: \d\d sensor nodes, 72 s, link ideal, seed 1, trackers imm-ukf, spcpf", first)
    assert coverage.startswith("coverage: enough sensors for a fix (2) within 56 m of the target in 71 of 71 steps (")
    assert coverage.endswith(" on average), enough reports for a fix (2) in time in 100%")
    assert re.fullmatch(
        r"reports: about 300 from 18 sensor nodes; 100.0% arrive, 100.0% of those in time "
        r"\(delay 1 ms; fusion.deadline_s is 300 ms\)",
        reports,
    )
    assert [line.partition(":")[0] for line in receptions] == [
        "reception of doa at fusion from 18 sensor nodes that will report",
        "reception of sync-request at fusion from 18 sensor nodes that will report",
        "reception of sync-reply at 18 sensor nodes that will report from fusion",
    ]
    assert last == "valid"
    assert list(tmp_path.iterdir()) == []


def test_validate_tells_the_reception_of_the_links_that_count(trackfield: Call) -> None:
    said = trackfield("validate", "bus").err
    assert "24 sensor nodes that will report: mean 92.6%, worst 92.6% (n" in said
    said = trackfield("validate", "spcpf", "--set", "link.loss=0.51").err
    assert "reception of doa at fusion from 25 sensor nodes that will report: mean 49.0%, worst 49.0% (n012)" in said


def test_a_run_keeps_the_trace_that_it_replayed(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "radio.csv").write_text("src,dst,t_s,received,delay_ms\n" + "".join(
        f"n{i:03},fusion,0,{i % 2},5\n" for i in range(121)
    ))  # fmt: skip
    assert trackfield("run", "spcpf", *SHORT, "--set", "link.file=radio.csv", "--out", "first").code == 0
    frames = json.loads((tmp_path / "first" / "metrics.json").read_text())["frames"]
    assert frames["delivered"] > 0
    assert frames["lost"]["radio"] > 0
    (tmp_path / "radio.csv").unlink()
    assert trackfield("run", "first/scenario.toml", "--virtual", "--out", "second").code == 0
    assert same(trackfield, "first", "second")


def test_validate_names_the_gaps_of_a_track(trackfield: Call, tmp_path: Path) -> None:
    rows = [f"{t},{10 * t},0" for t in (*range(20), *range(50, 60))]
    (tmp_path / "ride.csv").write_text("\n".join(["t_s,x,y", *rows]))
    said = trackfield("validate", "bus", "--set", "target.file=ride.csv")
    note = "note: 30 of 59 steps lie in a gap of the recording (from 19.0 s for 31 s): a straight line stands in"
    assert note in " ".join(said.err.split())


def test_the_version_is_that_of_the_package(trackfield: Call) -> None:
    said = trackfield("--version")
    assert (said.code, said.out, said.err) == (0, f"trackfield {version('trackfield')}\n", "")


def test_help_names_what_can_be_chosen(trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setitem(TRACKERS.registered, "mine", Ekf)
    run, again, anew = (trackfield(name, "--help") for name in ("run", "reproduce", "new"))
    assert (run.code, run.err) == (0, "")
    assert f"({', '.join(names())})" in run.out
    for choices in (
        TRACKERS,
        (link for (link, *_) in (get_args(one.model_fields["model"].annotation) for one in LINKS)),
    ):
        assert ", ".join(choices) in " ".join(run.out.replace("│", " ").split())
    assert ": ozfidan, yang, yu, zhai, zhou" in again.out
    assert ", ".join(names()) in anew.out
    assert "<bool>" not in run.out + trackfield("--help").out  # a flag takes no value


def test_help_is_there_for_who_asks_for_nothing(trackfield: Call) -> None:
    asked, silent = trackfield("--help"), trackfield()
    assert (asked.code, silent.code) == (0, 2)
    for said in (asked, silent):
        assert said.err == ""
        assert all(command in said.out for command in ("run", "list", "validate", "view", "compare"))


# --- running it again -------------------------------------------------------------------------------------------------


def same(trackfield: Call, a: str, b: str) -> bool:
    said = trackfield("compare", a, b, "--exact", "0")
    assert (said.code == 0) == said.out.endswith("equal to within 0, and the fate of every frame is the same\n")
    assert (said.code == 0) == (said.err == "")
    assert said.code in (0, 1)
    return said.code == 0


def test_the_resolved_scenario_gives_the_same_run_again(trackfield: Call, tmp_path: Path) -> None:
    options = ("--virtual", "--seed", "3", "--set", "link.loss=0.2", "--set", "sensor.doa_sd_deg=5", "--nodes", "100")
    assert trackfield("run", "spcpf", *options, "--tracker", "spcpf", "--out", "a").code == 0
    assert trackfield("run", "a/scenario.toml", "--virtual", "--out", "b").code == 0
    assert same(trackfield, "a", "b")
    assert (tmp_path / "a/scenario.toml").read_text() == (tmp_path / "b/scenario.toml").read_text()
    assert trackfield("run", "a/scenario.toml", "--virtual", "--seed", "4", "--out", "c").code == 0
    assert not same(trackfield, "a", "c")


@pytest.mark.parametrize(
    ("name", "window"),
    [("ride.gpx", ("--from", "08:00:20", "--to", "08:00:50")), ("ride.CSV", ("--from", "5", "--to", "25.5"))],
)
def test_the_track_goes_into_the_run_folder_and_moves_with_it(
    trackfield: Call, tmp_path: Path, name: str, window: tuple[str, ...]
) -> None:
    track = tmp_path / name
    if track.suffix == ".gpx":
        shutil.copy(BUS, track)
    else:
        track.write_text("\n".join(["t_s,x,y", *(f"{t},{9 * t},{t * t / 7}" for t in range(40))]))
    assert trackfield("run", "bus", "--virtual", "--target", name, *window, "--out", "a").code == 0
    content = track.read_bytes()
    track.unlink()
    (tmp_path / "elsewhere").mkdir()
    shutil.move(tmp_path / "a", tmp_path / "elsewhere" / "b")
    copy = tmp_path / "elsewhere" / "b" / f"target{track.suffix}"
    assert copy.read_bytes() == content
    assert f'file = "{copy.name}"' in copy.with_name("scenario.toml").read_text()
    assert trackfield("run", "elsewhere/b/scenario.toml", "--virtual", "--out", "c").code == 0
    assert same(trackfield, "elsewhere/b", "c")
    assert (tmp_path / "c/scenario.toml").read_text() == copy.with_name("scenario.toml").read_text()


def posts(file: Path) -> Path:
    """A CSV file of the sensors along the packaged bus ride, under names of their own."""
    origin = track_origin(BUS)
    assert origin is not None
    rows = ["id,lat,lon"]
    for id, x, y in survey(Scenario.load("bus")).sensors:
        lat, lon, _ = pymap3d.enu2geodetic(x, y, 0.0, *origin, 0.0)
        rows.append(f"post-{id},{lat},{lon}")
    file.write_text("\n".join(rows))
    return file


def test_sensors_of_a_file_go_into_the_run_folder_and_move_with_it(trackfield: Call, tmp_path: Path) -> None:
    file = posts(tmp_path / "posts.CSV")
    options = ("--virtual", "--set", "target.steps=20", "--set", "sensor.position_error_m=2")
    assert trackfield("run", "bus", *options, "--target", BUS, "--sensors", "posts.CSV", "--out", "a").code == 0
    content = file.read_bytes()
    file.unlink()
    (tmp_path / "elsewhere").mkdir()
    shutil.move(tmp_path / "a", tmp_path / "elsewhere" / "b")
    copy = tmp_path / "elsewhere" / "b" / "sensors.CSV"
    assert copy.read_bytes() == content
    resolved = copy.with_name("scenario.toml").read_text()
    assert 'file = "sensors.CSV"' in resolved
    assert 'file = "target.gpx"' in resolved
    senders = set(pq.read_table(copy.with_name("messages.parquet"))["src"].to_pylist())
    assert senders
    assert all(name.startswith("post-") for name in senders - {"fusion"})
    assert trackfield("run", "elsewhere/b/scenario.toml", "--virtual", "--out", "c").code == 0
    assert same(trackfield, "elsewhere/b", "c")
    assert (tmp_path / "c/scenario.toml").read_text() == resolved


def test_validate_takes_sensors_too(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "posts.csv").write_text("id,x,y\ngate,60,80\ndoor,90,110\n")
    said = trackfield("validate", "spcpf", "--sensors", "posts.csv")
    assert (said.code, said.out) == (0, "")
    assert said.err.startswith("zhai-spcpf: 2 sensor nodes, 61 s, ")
    assert list(tmp_path.iterdir()) == [tmp_path / "posts.csv"]


@pytest.mark.parametrize("layout", ["jittered", "random", "ring"])
def test_an_irregular_field_comes_out_of_its_resolved_scenario_again(
    trackfield: Call, tmp_path: Path, layout: str
) -> None:
    options = (*SHORT, "--nodes", "150", "--set", f"field.layout={layout}", "--set", "sensor.threshold=0.5")
    assert trackfield("run", "spcpf", *options, "--seed", "5", "--out", "a").code == 0
    assert trackfield("run", "a/scenario.toml", "--virtual", "--out", "b").code == 0
    assert same(trackfield, "a", "b")
