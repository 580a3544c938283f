"""What was recorded is not lost: whoever is killed, and however full the disk is."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import psutil
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from launcher.files import PatientFile, locked
from launcher.record.kept.log import LOG, MAGIC, MARK, REFUSED, Entry, Reading, frame
from tests.command_line import Call, trackfield
from tests.rrd import verify
from tests.running import Run, leftovers, until
from trackfield.role import NS

__all__ = ["trackfield"]

FIELD = ("zhai-spcpf", "--nodes", "16", "--set", "target.steps=40")
WHOLE = {"scenario.toml", "manifest.json", "run.rrd", "messages.parquet", "tracks.parquet", "metrics.json", "logs"}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run, in virtual time."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    code, said = Run(folder, *FIELD, "--virtual").finish()
    assert code == 0, said
    return folder


def mid_run(folder: Path, *more: str, reported: bool = False) -> Run:
    """A run with some of it on disk."""
    run = Run(folder, *FIELD, "--speed", "4", *more, reported=reported)
    until(lambda: recorded_s(run) > 14)
    return run


def recorded_s(run: Run) -> float:
    """Up to when its log goes."""
    return max([int(entry.payload) for entry in Reading(run.folder / LOG) if entry.key == MARK], default=0) / NS


def kill(*names: str, run: Run) -> None:
    family = run.family()
    for name in names:
        family[name].kill()


def check_same_until_then(run: Path, undisturbed: Path) -> dict[str, Any]:
    """Its tables are those of the undisturbed run, up to when it says that it was recorded; returns its metrics."""
    metrics: dict[str, Any] = json.loads((run / "metrics.json").read_text())
    ended_ns = round(metrics["ended_s"] * NS)
    assert ended_ns > 10 * NS
    for name, column in (("messages", "due_ns"), ("tracks", "told_ns")):
        found, whole = (pq.read_table(folder / f"{name}.parquet") for folder in (run, undisturbed))
        early = [table.filter(pc.less(table[column], ended_ns)) for table in (found, whole)]
        assert early[0].num_rows > 5
        assert early[0].equals(early[1]), name
    assert verify(run / "run.rrd").returncode == 0
    assert {file.name for file in run.iterdir()} - {"report.html", "plots"} == WHOLE
    return metrics


def test_a_recorder_that_is_killed_costs_nothing_that_came_before(tmp_path: Path, undisturbed: Path) -> None:
    run = mid_run(tmp_path / "run", reported=True)
    kill("recorder", run=run)
    code, said = run.finish()
    assert code == 1
    assert "failed: the recorder did not finish: all was made from its log, " in said
    metrics = check_same_until_then(run.folder, undisturbed)
    assert (metrics["complete"], metrics["end_reason"]) == (False, "the recorder died")
    assert [death["id"] for death in metrics["processes"]["died"]] == ["recorder"]
    assert (metrics["energy_j"]["total"], metrics["frames"]["host_lost"]) == (None, None)
    assert "(the recorder died): " in (run.folder / "report.html").read_text()


def test_nothing_is_recovered_while_the_run_goes_on_without_its_recorder(
    tmp_path: Path, undisturbed: Path, trackfield: Call
) -> None:
    run = mid_run(tmp_path / "run")
    recorder = run.family()["recorder"]
    kill("recorder", run=run)
    until(lambda: not recorder.is_running() or recorder.status() == psutil.STATUS_ZOMBIE)
    said = trackfield("recover", str(run.folder))
    assert (said.code, run.process.poll()) == (2, None)
    assert said.err == f"trackfield: {run.folder}: is still going on; expected a run that is over\n"
    code, said_at_end = run.finish()
    assert code == 1
    assert "failed: the recorder did not finish: all was made from its log, " in said_at_end
    check_same_until_then(run.folder, undisturbed)


def test_a_run_goes_on_in_a_folder_that_somebody_has_locked(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    with locked(folder):
        code, said = Run(folder, "zhai-spcpf", "--nodes", "4", "--speed", "2", "--set", "target.steps=3").finish()
    assert (code, "Traceback" in said) == (0, False), said


def test_one_recovers_a_run_at_a_time(copied: Path, trackfield: Call) -> None:
    with locked(copied):
        said = trackfield("recover", str(copied))
    assert (said.code, "is still going on" in said.err) == (2, True)
    assert (copied / LOG).exists()


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGQUIT, marks=pytest.mark.long)])
def test_a_launcher_that_is_killed_leaves_a_folder_that_says_so(
    number: int, tmp_path: Path, undisturbed: Path, trackfield: Call
) -> None:
    run = mid_run(tmp_path / "run")
    family, sockets = run.family().values(), Path(run.manifest()["endpoint"].partition("/")[2]).parent
    assert sockets.is_dir()
    run.process.send_signal(number)
    run.process.wait()
    until(lambda: leftovers(family) == [])
    assert not sockets.exists()
    metrics = check_same_until_then(run.folder, undisturbed)
    assert (metrics["complete"], metrics["end_reason"]) == (False, "the launcher died")
    assert (metrics["driver"], metrics["wall_s"], metrics["cpu_s"]) == ("processes", None, None)
    assert (metrics["processes"]["died"], metrics["energy_j"]["total"]) == (None, None)
    assert trackfield("report", str(run.folder)).code == 0
    assert "(the launcher died)" in (run.folder / "report.html").read_text()
    said = trackfield("compare", str(run.folder), str(undisturbed))
    assert said.code == 0
    assert "the launcher died" in " ".join(said.out.split())
    assert trackfield("replay", str(run.folder), "--out", str(tmp_path / "again")).code == 0
    said = trackfield("recover", str(run.folder))
    assert (said.code, "is complete: there is nothing to recover" in said.err) == (2, True)


@pytest.fixture(scope="module")
def cut_off(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run all of whose processes were killed at once."""
    run = mid_run(tmp_path_factory.mktemp("cut_off") / "run")
    zygote = psutil.Process(run.process.pid).children()[0]
    kill("recorder", run=run)
    zygote.kill()
    run.process.kill()
    run.process.wait()
    assert not (run.folder / "metrics.json").exists()
    return run.folder


@pytest.fixture
def copied(cut_off: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(cut_off, tmp_path / "run"))


def test_a_run_that_was_cut_off_is_recovered(copied: Path, undisturbed: Path, trackfield: Call) -> None:
    assert verify(copied / "run.rrd").returncode == 1
    assert trackfield("report", str(copied)).code == 2
    said = trackfield("recover", str(copied))
    assert said.code == 0, said.err
    metrics = check_same_until_then(copied, undisturbed)
    assert (metrics["complete"], metrics["end_reason"]) == (False, "the recorder died")
    assert (copied / "report.html").exists()
    assert trackfield("recover", str(copied)).code == 2


@pytest.mark.parametrize("left", [0.9, pytest.param(0.5, marks=pytest.mark.long)])
def test_of_a_damaged_log_what_precedes_the_damage_is_recovered(left: float, copied: Path, trackfield: Call) -> None:
    log = copied / LOG
    content = bytearray(log.read_bytes())
    content[round(left * len(content))] ^= 1
    log.write_bytes(content)
    said = trackfield("recover", str(copied))
    assert said.code == 1
    assert "failed: its log is damaged: what came after the damage is lost" in said.err
    assert {file.name for file in copied.iterdir()} - {"report.html", "plots"} == WHOLE


def edited(log: Path, *more: Entry) -> None:
    """The log with these entries before all others."""
    log.write_bytes(MAGIC + b"".join(map(frame, more)) + log.read_bytes()[len(MAGIC) :])


def test_entries_that_are_none_of_the_run_are_left_out(copied: Path, undisturbed: Path, trackfield: Call) -> None:
    strange = [
        Entry("data/strange", b""),
        Entry("telemetry/n001/event", b"\xc1"),
        Entry("control/start", b"-5"),
        Entry("control/finish", b"5"),
        Entry(MARK, b"soon"),
        Entry(MARK, b"9" * 5000),
        Entry(REFUSED, b"5"),
        Entry(REFUSED, msgpack.packb([("data", "seal", -1)])),
    ]
    edited(copied / LOG, *strange)
    said = trackfield("recover", str(copied))
    assert (said.code, said.err.count("failed: ")) == (1, 1), said.err
    assert "failed: its log is damaged: 8 entries are none of this run, and are left out" in said.err
    check_same_until_then(copied, undisturbed)


def test_the_log_of_another_run_is_nothing_of_this(copied: Path, tmp_path: Path, trackfield: Call) -> None:
    other = tmp_path / "other"
    small = ("bus", "--set", "target.steps=3")
    assert trackfield("run", *small, "--virtual", "--out", str(other)).code == 0
    (other / "metrics.json").unlink()
    (copied / LOG).rename(other / LOG)
    said = trackfield("recover", str(other))
    assert (said.code, "Traceback" in said.err) == (1, False)
    assert "entries are none of this run, and are left out" in said.err


def test_however_many_samples_were_refused_they_are_one_entry(copied: Path, trackfield: Call) -> None:
    edited(copied / LOG, Entry(REFUSED, msgpack.packb([("telemetry", "seal", 10**12)])))
    said = trackfield("recover", str(copied))
    assert (said.code, "failed: somebody interfered with the run: " in said.err) == (1, True)
    assert json.loads((copied / "metrics.json").read_text())["interference"]["telemetry"] == 10**12


def test_a_log_that_goes_away_while_it_is_read_is_one_message(
    copied: Path, trackfield: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def once(reading: Reading) -> Iterator[Entry]:
        yield from read(reading)
        reading.file.unlink()

    read = Reading.__iter__
    monkeypatch.setattr(Reading, "__iter__", once)
    said = trackfield("recover", str(copied))
    assert (said.code, said.err.count("\n")) == (1, 1)
    assert "record.log cannot be read (No such file or directory)" in said.err


@pytest.mark.parametrize("content", [b"", b"nothing", MAGIC])
def test_a_log_with_nothing_in_it_is_no_traceback(content: bytes, copied: Path, trackfield: Call) -> None:
    (copied / LOG).write_bytes(content)
    said = trackfield("recover", str(copied))
    assert said.code == (0 if content == MAGIC else 1)
    assert "Traceback" not in said.err


def test_what_cannot_be_recovered_is_refused(copied: Path, trackfield: Call, tmp_path: Path) -> None:
    def refused(what: str) -> None:
        said = trackfield("recover", str(copied))
        assert (said.code, said.err.count("\n")) == (2, 1)
        assert what in said.err

    writer = PatientFile(copied / "other")
    writer.flush()
    (copied / "other").rename(copied / "held")
    log = (copied / LOG).read_bytes()
    (copied / "held").write_bytes(log)
    (copied / "held").rename(copied / LOG)
    refused("is still going on")
    writer.close()
    toml = copied / "scenario.toml"
    text = toml.read_text()
    toml.write_text(text.replace("seed = 1", "seed = 2"))
    refused("is not the scenario of this run")
    toml.write_text(text)
    manifest = copied / "manifest.json"
    told = json.loads(manifest.read_text())
    for damaged, what in (
        ("{", "its manifest.json is damaged"),
        (json.dumps(told | {"scenario": ""}), "is not the scenario of this run"),
        (json.dumps(told | {"speed": None}), "has no run and speed"),
        (json.dumps(told | {"speed": -1}), "--speed: is -1"),
    ):
        manifest.write_text(damaged)
        refused(what)
    manifest.unlink()
    refused("has no manifest.json")
    (copied / LOG).unlink()
    refused("has no record.log")
    copied.rename(tmp_path / "gone")
    refused("has no record.log")


def test_a_replay_wants_the_scenario_of_the_run(undisturbed: Path, tmp_path: Path, trackfield: Call) -> None:
    copy = Path(shutil.copytree(undisturbed, tmp_path / "copy"))
    toml = copy / "scenario.toml"
    toml.write_text(toml.read_text() + "\n# a remark\n")
    said = trackfield("replay", str(copy), "--out", str(tmp_path / "again"))
    assert (said.code, (tmp_path / "again").exists()) == (2, False)
    assert said.err.startswith(f"trackfield: {toml}: is not the scenario of this run: it, or a file that it names, ")


# --- disks -------------------------------------------------------------------------------------------------------


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 3 MB."""
    small = tmp_path / "disk"
    small.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=3m", "none", str(small)]
    if os.getuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("no small disk can be mounted")
    yield small
    subprocess.run(["umount", "-l", str(small)], check=True)


def fill(disk: Path) -> Path:
    """A file that leaves no room on it."""
    filler = disk / "filler"
    with filler.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            return filler


def test_a_disk_that_is_full_for_a_while_loses_nothing(disk: Path, undisturbed: Path) -> None:
    run = mid_run(disk / "run")
    filler = fill(disk)
    time.sleep(2)
    filler.unlink()
    code, said = run.finish()
    assert code == 1, said
    assert said.count("failed: the disk took nothing from ") == said.count("failed: ") == 1
    metrics = check_same_until_then(run.folder, undisturbed)
    assert (metrics["complete"], metrics["frames"]["host_lost"]) == (True, 0)


def test_a_disk_that_stays_full_costs_the_timeline_which_is_recovered(
    disk: Path, undisturbed: Path, trackfield: Call
) -> None:
    run = mid_run(disk / "run")
    filler = fill(disk)
    code, said = run.finish()
    assert (code, "Traceback" in said) == (1, False), said
    assert "failed: the timeline failed: No space left on device; trackfield recover draws it" in said
    filler.unlink()
    assert trackfield("recover", str(run.folder)).code == 0
    assert check_same_until_then(run.folder, undisturbed)["complete"]


def test_a_disk_that_is_full_from_the_start_is_one_message(disk: Path) -> None:
    fill(disk)
    for driver in ((), ("--virtual",)):
        out = disk / "-".join(("run", *driver))
        command = [sys.executable, "-m", "launcher.cli", "run", *FIELD, *driver, "--out", str(out)]
        ended = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "200"}
        )
        assert (ended.returncode, ended.stderr.count("\n")) == (1, 1), ended.stderr
        assert "(No space left on device)" in ended.stderr


def test_a_timeline_that_fails_costs_nothing_else(
    trackfield: Call, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError("drawn by nothing")

    monkeypatch.setattr("launcher.timeline.timeline.Timeline.message", fails)
    said = trackfield("run", *FIELD, "--virtual", "--out", "mine")
    assert said.code == 1
    assert "failed: the timeline failed: ZeroDivisionError: drawn by nothing" in said.err
    for name in ("messages.parquet", "tracks.parquet"):
        assert pq.read_table(Path("mine") / name).equals(pq.read_table(undisturbed / name))
