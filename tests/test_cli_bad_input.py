"""Whatever a user gets wrong: exit code 2, one message that says what, where and what would be right, nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from launcher.timeline.recording import MAGIC
from tests.command_line import Call, Said, trackfield

__all__ = ["trackfield"]

BUS = Path(__file__).parents[1] / "trackfield" / "scenario" / "bus.gpx"
UNWRITABLE = "/proc/trackfield"
"""Not even root may write there; where there is no /proc, the root of the disk is not for users."""

NOWHERE = ("run", "spcpf", "--virtual")


def everything(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def assert_refused(said: Said, *parts: str) -> None:
    assert said.code == 2
    assert said.out == ""
    assert "Traceback" not in said.err
    assert said.err.startswith("trackfield: ")
    assert said.err.count("\n") == 1, said.err  # one message
    for part in parts:
        assert part in said.err


# --- names, keys and values -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (
            ["run", "zhai-spcfp"],
            [
                "unknown scenario",
                "mean zhai-spcpf?",
                "one of bus, hall, ozfidan-clusters, radar, yang-ecpa, yu-mrbpf, zhai-spcpf, zhou-upf, or a",
            ],
        ),
        (["validate", "buss"], ["unknown scenario 'buss'", "did you mean bus?"]),
        (["run", "no/such.toml"], ["no/such.toml: cannot be read (No such file"]),
        ([*NOWHERE, "--set", "link.file=no.csv"], ["link.file: ", "no.csv: cannot be read (No such file"]),
        ([*NOWHERE, "--link", "gilbert"], ["link.model: unknown model 'gilbert'", "did you mean gilbert_elliott?"]),
        ([*NOWHERE, "--link", "ideal "], ["did you mean ideal?", "one of ideal, fixed, gilbert_elliott"]),
        ([*NOWHERE, "--tracker", "fix-imm-ukff"], ["fusion.trackers: unknown tracker", "did you mean imm-ukf?"]),
        ([*NOWHERE, "--tracker", "spcpf", "--tracker", "spcpf"], ["'spcpf' is given twice"]),
        ([*NOWHERE, "--set", "sensor.treshold=0.7"], ["sensor.treshold: unknown", "did you mean threshold?"]),
        (["run", "spcpf", "--connect", "nonsense"], ["--connect: is 'nonsense'", "tcp/127.0.0.1:7447"]),
        ([*NOWHERE, "--set", "link.los=0.1"], ["link.los: unknown", "did you mean loss?"]),
        ([*NOWHERE, "--set", "sensor_.alpha=2"], ["sensor_: unknown", "did you mean sensor?"]),
        ([*NOWHERE, "--set", "field.layout=jitterd"], ["field.layout: unknown layout", "did you mean jittered?"]),
        ([*NOWHERE, "--set", "field.radius=80"], ["field.radius: unknown", "did you mean radius_m?"]),
        ([*NOWHERE, "--set", "sensor.position_eror_m=5"], ["unknown", "did you mean position_error_m?"]),
        ([*NOWHERE, "--sensor", "a.csv"], ["--sensor", "--sensors", "see trackfield run --help"]),
        ([*NOWHERE, "--set", "fusion.deadline=1"], ["fusion.deadline: unknown", "did you mean deadline_s?"]),
    ],
)  # fmt: skip
def test_an_unknown_name_gets_the_nearest(
    trackfield: Call, tmp_path: Path, arguments: list[str], parts: list[str]
) -> None:
    assert_refused(trackfield(*arguments), *parts)
    assert everything(tmp_path) == set()


@pytest.mark.parametrize(
    ("setting", "parts"),
    [
        ("link.loss=2", ["link.loss: is 2", "a number from 0 to 1"]),
        ("link.loss=high", ['link.loss: is "high"', "a number from 0 to 1"]),
        ("sensor.doa_sd_deg=-1", ["sensor.doa_sd_deg: is -1", "a number from 0.001 to 180"]),
        ("sensor.doa_sd_deg=nan", ["sensor.doa_sd_deg: is NaN", "a number from 0.001 to 180"]),
        ("fusion.options={upf={ess=nan}}", ["fusion.options.upf.ess: is NaN", "or a number from -1e15 to 1e15"]),
        ("fusion.options={upf={ess=[1]}}", ["fusion.options.upf.ess: is [1]", "true or false"]),
        ("field.spacing_m=0", ["field.spacing_m: is 0", "a number from 0.001 to 10000000"]),
        ("field.jitter=1.5", ["field.jitter: is 1.5", "a number from 0 to 1"]),
        ("field.radius_m=0", ["field.radius_m: is 0", "a number from 0.001 to 10000000"]),
        ("field.distance_m=0", ["field.distance_m: is 0", "a number from 0.001 to 10000000"]),
        ("sensor.position_error_m=-1", ["sensor.position_error_m: is -1", "a number from 0 to 10000"]),
        ("field.file=", ['field.file: is ""', "a text"]),
        ("target.steps=1.5", ["target.steps: is 1.5", "a whole number"]),
        ("seed=-1", ["seed: is -1", "a whole number from 0 to 9223372036854775807"]),
        ("field=3", ["field", "is 3"]),
        ("sensor.alpha.x=3", ["sensor.alpha: is 2.0", "expected a section"]),
        ("fusion.trackers=[]", ["fusion.trackers: is []", "a list of at least 1"]),
        ("fusion.deadline_s=2", ["fusion.deadline_s: is 2", "at most target.step_s, which is 1"]),
        ("target.waypoints=[[0,0,0],[0,1,1]]", ["target.waypoints: its times do not increase", "increasing times"]),
        ("target.half_width_m=1", ["target.half_width_m: is 1 m; 5000 paths of 1000 steps", "expected a wider square"]),
        ("faults=kill", ['faults: is "kill"', "sections [[faults]]"]),
        ("faults.at_s=3", ["faults: are a list, which can only be set as a whole", "faults=[{kind='...', ...}, ...]"]),
        ("faults=[{kind='kil', share=1, at_s=3}]", ["faults[0].kind: unknown kind 'kil'", "did you mean kill?"]),
        ("faults=[{kind='kill', at_s=3}]", ["faults[0].nodes: affects no process", "nodes (a list of ids), share"]),
        ("faults=[{kind='kill', nodes=['n60'], at_s=3}]", ["faults[0].nodes: there is no 'n60'", "did you mean n060?"]),
        ("faults=[{kind='deaf', nodes=['fusion'], at_s=3}]", ["faults[0].nodes: fusion has no sensor", "sensor nodes"]),
        (
            "faults=[{kind='kill', share=1, at_s=99}]",
            ["faults[0].at_s: is 99, and the run ends at 61 s"],
        ),
        ("link.acks={daa=3}", ["link.acks: there is no message 'daa'", "did you mean data?"]),
        ("sensor.threshold=adaptve", ['sensor.threshold: is "adaptve"', 'a number from 0 to 1, or "adaptive"']),
        ("clock.sync=1", ["clock.sync: is 1", "true or false"]),
        ("energy.batery_j=1", ["energy.batery_j: unknown", "did you mean battery_j?"]),
        ("link.loss", ["--set: 'link.loss' sets nothing", "expected key=value, like link.model=fixed"]),
        ("=3", ["--set: '=3' sets nothing", "expected key=value"]),
        ("", ["--set: '' sets nothing", "expected key=value"]),
    ],
)
def test_a_setting_says_its_key_and_what_is_expected(
    trackfield: Call, tmp_path: Path, setting: str, parts: list[str]
) -> None:
    assert_refused(trackfield(*NOWHERE, "--set", setting), *parts)
    assert everything(tmp_path) == set()


def test_a_files_mistakes_are_told_with_their_lines_all_at_once(trackfield: Call, tmp_path: Path) -> None:
    text = 'name = "mine"\nsed = 3\n\n[sensor]\nalpha = "two"\n\n[target]\npath = "s4"\n'
    (tmp_path / "mine.toml").write_text(text)
    said = trackfield("run", "mine.toml", "--virtual")
    assert (said.code, said.out) == (2, "")
    first, second, third = sorted(said.err.removeprefix("trackfield: ").splitlines())
    assert first.startswith("mine.toml:2: sed: unknown; did you mean seed?; expected one of name, seed")
    assert second == 'mine.toml:5: sensor.alpha: is "two"; expected a number from 0.5 to 20'
    assert third.startswith("mine.toml:8: target.path: unknown path 's4'")
    assert everything(tmp_path) == {tmp_path / "mine.toml"}


@pytest.mark.parametrize("content", [b"name = ", b"\xff\xfe", b'name = "a"\nname = "b"\n[target]\n'])
def test_what_is_no_toml_file_is_called_so(trackfield: Call, tmp_path: Path, content: bytes) -> None:
    (tmp_path / "mine.toml").write_bytes(content)
    assert_refused(trackfield("validate", "mine.toml"), "mine.toml: not a TOML file (")


# --- a field in which nothing can happen ------------------------------------------------------------------------------


def test_a_field_without_sensors_is_refused(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("run", "bus", "--virtual", "--set", "field.spacing_m=2000")
    assert_refused(said, "field.within_m: no sensors", "more than half the spacing of 2000 m")
    assert_refused(trackfield(*NOWHERE, "--nodes", "0"), "field.nodes: is 0", "a whole number from 1")
    assert everything(tmp_path) == set()


def test_a_target_that_never_comes_in_range_is_refused(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield(*NOWHERE, "--set", "target.waypoints=[[0, 800, 900], [9, 900, 900]]")
    # The corner (500, 500) is n120; 56.2 m is the paper's radius at 75 %.
    assert_refused(said, "never comes in range", "500 m from n120, the nearest", "within the 56 m")
    assert everything(tmp_path) == set()


# --- tracks -----------------------------------------------------------------------------------------------------------

POINT = '<trkpt lat="45.0" lon="-30.0"></trkpt>'
TRACK = (
    '<gpx version="1.1" creator="a test" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>{}</trkseg></trk></gpx>'
)


@pytest.mark.parametrize(
    ("name", "content", "parts"),
    [
        ("no-times.gpx", TRACK.format(3 * POINT), ["its 3 points have no times", "elements that have a <time>"]),
        ("empty.gpx", TRACK.format(""), ["has no track points", "expected a GPX file"]),
        ("prose.gpx", "It was a dark and stormy night.", ["not a GPX file", "expected a GPX file"]),
        ("torn.gpx", BUS.read_text()[:5000], ["not a GPX file", "expected a GPX file"]),
        ("nothing.gpx", "", ["not a GPX file", "expected a GPX file"]),
        ("wrong.csv", "time,east,north\n", ["has the columns time, east, north", "time,lat,lon or t_s,x,y"]),
        ("cell.csv", "t_s,x,y\n0,1,2\n1,here,2\n", ["cell.csv:3: x is 'here'", "metres"]),
        ("single.csv", "t_s,x,y\n0,1,2\n", ["has a single fix", "a track of at least two"]),
        ("ride.kml", "<kml/>", ["unknown kind of track", "a .gpx or .csv file"]),
    ],
)
def test_a_track_that_is_none_is_named(
    trackfield: Call, tmp_path: Path, name: str, content: str, parts: list[str]
) -> None:
    (tmp_path / name).write_text(content)
    assert_refused(trackfield("run", "bus", "--virtual", "--target", name), name, *parts)
    assert everything(tmp_path) == {tmp_path / name}


def test_a_track_that_is_not_there_is_named(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("run", "bus", "--virtual", "--target", "ride.gpx")
    assert_refused(said, f"{tmp_path / 'ride.gpx'}: cannot be read (No such file or directory)")
    said = trackfield("run", "bus", "--virtual", "--set", "target.file=")
    assert_refused(said, "target.file", "expected a text")


@pytest.mark.parametrize(
    ("window", "parts"),
    [
        (["--from", "10:00", "--to", "10:05"], ["no fix inside the window", "times in 2025-03-03 08:00:00+00:00 to"]),
        (["--from", "08:01", "--to", "2025-03-03T08:00"], ["target.to: the window ends before it begins", "times in"]),
        (["--from", "eight"], ["target.from: 'eight' is not a time", "HH:MM[:SS] or an ISO date and time"]),
        (["--to", "25:00"], ["target.to: '25:00' is not a time", "HH:MM[:SS]"]),
    ],
)
def test_a_window_with_nothing_in_it_names_the_files_times(
    trackfield: Call, tmp_path: Path, window: list[str], parts: list[str]
) -> None:
    assert_refused(trackfield("run", "bus", "--virtual", "--target", BUS, *window), str(BUS), *parts)
    assert everything(tmp_path) == set()


@pytest.mark.parametrize("option", ["--from", "--to"])
def test_a_window_needs_a_track(trackfield: Call, option: str) -> None:
    said = trackfield(*NOWHERE, option, "07:50")
    assert_refused(said, "--from, --to: there is no track to cut", "expected --target FILE as well")


# --- sensors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [("run", "--virtual"), ("validate",)])
@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("id,x\na,1\n", ["posts.csv: has the columns id, x", "columns id,x,y or id,lat,lon"]),
        ("id,x,y\na,1,2\na,3,4\n", ["posts.csv:3: id 'a' is given twice", "an id other than that of line 2"]),
        ("id,x,y\na/b,1,2\n", ["posts.csv:2: id is 'a/b'", "1 to 32 characters of A-Z a-z 0-9 _ . -"]),
        ("id,x,y\nrecorder,1,2\n", ["posts.csv:2: a node is called 'recorder'", "an id other than fusion, router"]),
        ("id,x,y,role\na,1,2,camera\n", ["posts.csv:2: role is 'camera'", "one of node, fusion"]),
        ("id,x,y\n", ["posts.csv: has no rows"]),
        ("id,lat,lon\na,45,-30\n", ["posts.csv: has the columns lat,lon, but the target's path is in metres"]),
        ("id,x,y\nfar,900,900\n", ["sensor.threshold: the target never comes in range", "from far, the nearest"]),
    ],
)
def test_sensors_that_are_none_are_named(
    trackfield: Call, tmp_path: Path, command: tuple[str, ...], content: str, parts: list[str]
) -> None:
    (tmp_path / "posts.csv").write_text(content)
    assert_refused(trackfield(*command, "spcpf", "--sensors", "posts.csv"), *parts)
    assert everything(tmp_path) == {tmp_path / "posts.csv"}


def test_sensors_in_metres_do_not_go_with_a_ride_on_the_globe(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "posts.csv").write_text("id,x,y\na,1,2\n")
    said = trackfield("run", "bus", "--virtual", "--sensors", "posts.csv")
    assert_refused(said, "has the columns x,y, but the target's path is in lat,lon", "the columns lat,lon, or a track")


def test_sensors_that_are_not_there_are_named(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield(*NOWHERE, "--sensors", "posts.csv")
    assert_refused(said, f"{tmp_path / 'posts.csv'}: cannot be read (No such file or directory)")
    assert everything(tmp_path) == set()


def test_a_file_says_itself_how_many_sensors_there_are(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "posts.csv").write_text("id,x,y\na,60,80\n")
    said = trackfield(*NOWHERE, "--sensors", "posts.csv", "--nodes", "5")
    assert_refused(
        said, "field.nodes: belongs to layout grid or jittered or random or ring or along-path or cells, not to file"
    )


# --- run folders ------------------------------------------------------------------------------------------------------


def test_a_folder_with_something_in_it_stays_as_it_is(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "notes.txt").write_text("mine")
    said = trackfield(*NOWHERE, "--out", "old")
    assert_refused(said, "old: --out: the folder is not empty", "an empty or new one")
    assert everything(tmp_path / "old") == {tmp_path / "old" / "notes.txt"}


def test_a_folder_that_cannot_be_written_is_named(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    for out in ("file", "file/run", UNWRITABLE):
        assert_refused(trackfield(*NOWHERE, "--out", out), f"{out}: --out: cannot write there", "a writable folder")
    assert everything(tmp_path) == {tmp_path / "file"}


@pytest.mark.parametrize(
    ("runs", "parts"),
    [
        (["good"], ["RUN: 1 given", "two run folders or more"]),
        (["good", "no-such-run"], ["no-such-run: has no metrics.json", "the folder of a finished run"]),
        (["empty", "good"], ["empty: has no metrics.json", "the folder of a finished run"]),
        (["good", "half"], ["half: has no tracks.parquet", "the folder of a finished run"]),
        (["good", "torn"], ["torn: its messages.parquet is damaged", "the folder of a finished run"]),
        (["good", "good", "--exact", "-1"], ["--exact", "greater than or equal to 0"]),
        (["good", "good", "--exact", "some"], ["--exact", "valid number"]),
    ],
)
def test_what_is_no_finished_run_is_not_compared(
    trackfield: Call, tmp_path: Path, runs: list[str], parts: list[str]
) -> None:
    assert trackfield(*NOWHERE, "--quiet", "--set", "target.steps=2", "--out", "good").code == 0
    for name, files in {"empty": (), "half": ("metrics.json",), "torn": ("metrics.json", "tracks.parquet")}.items():
        (tmp_path / name).mkdir()
        for file in files:
            (tmp_path / name / file).write_bytes((tmp_path / "good" / file).read_bytes())
    (tmp_path / "torn" / "messages.parquet").write_bytes(b"PAR1 and no more")
    assert_refused(trackfield("compare", *runs), *parts)


def test_a_folder_without_a_timeline_is_not_viewed(trackfield: Call, tmp_path: Path) -> None:
    for arguments in (["."], [".", "--web"], [".", "--png", "a.png"], ["no-such-run"]):
        said = trackfield("view", *arguments)
        assert_refused(said, f"{arguments[0]}: has no timeline", "the folder of a run, with run.rrd in it")
    assert everything(tmp_path) == set()


def test_a_picture_that_cannot_be_written_is_refused_before_it_is_made(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "run.rrd").write_bytes(MAGIC + b" never read further")
    for png in (".", "run.rrd/a.png", "no/such/folder/a.png", f"{UNWRITABLE}.png"):
        said = trackfield("view", ".", "--png", png)
        assert_refused(said, f"{png}: --png: cannot be written (", "a file in a writable folder")
    assert everything(tmp_path) == {tmp_path / "run.rrd"}
    assert (tmp_path / "run.rrd").read_bytes() == MAGIC + b" never read further"


# --- commands and options ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", ["0", "-1", "101", "inf", "nan"])
def test_a_speed_out_of_range_is_refused(trackfield: Call, tmp_path: Path, speed: str) -> None:
    said = trackfield("run", "spcpf", "--speed", speed)
    assert_refused(said, f"--speed: is {float(speed)}", "more than 0: from 0.001 to 100")
    assert everything(tmp_path) == set()


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["rnu"], ["'rnu'", "'run'", "see trackfield --help"]),
        (["--fast"], ["--fast", "see trackfield --help"]),
        (["run"], ["SCENARIO", "see trackfield run --help"]),
        (["run", "spcpf", "--sped", "5"], ["--sped", "--speed", "see trackfield run --help"]),
        (["run", "spcpf", "--speed", "fast"], ["--speed", "a valid number", "see trackfield run --help"]),
        (["run", "spcpf", "--seed", "1.5"], ["--seed", "a valid integer", "see trackfield run --help"]),
        (["run", "spcpf", "--nodes", "many"], ["--nodes", "a valid integer", "see trackfield run --help"]),
        (["run", "spcpf", "bus"], ["bus", "see trackfield run --help"]),
        (["run", "spcpf", "--seed"], ["--seed", "--help"]),
        (["view"], ["RUN: is missing", "or --web"]),
        (["compare"], ["RUN RUN...", "see trackfield compare --help"]),
        (["list", "--schemas"], ["--schemas", "--schema", "see trackfield list --help"]),
    ],
)
def test_a_wrong_command_or_option_is_answered_like_all_else(
    trackfield: Call, tmp_path: Path, arguments: list[str], parts: list[str]
) -> None:
    assert_refused(trackfield(*arguments), *parts)
    assert everything(tmp_path) == set()


def test_the_program_itself_ends_so_too(tmp_path: Path) -> None:
    """As a process of its own, with the streams that a script sees."""
    for arguments in (["run", "spcfp"], ["run", "spcpf", "--sped"]):
        ended = subprocess.run(
            [sys.executable, "-m", "launcher.cli", *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
            capture_output=True,
            text=True,
            check=False,
        )
        assert_refused(Said(ended.returncode, ended.stdout, ended.stderr), arguments[-1])
    assert everything(tmp_path) == set()
