"""The machine around a run: where its socket is, what it allows; a run that cannot be is refused before it begins."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import time
from pathlib import Path

import pytest

from launcher.plan.prepare import load, planned
from launcher.processes import endpoint, limits
from launcher.processes.endpoint import SocketFolder
from tests.command_line import Call, trackfield
from tests.running import until
from tests.test_streams import RUN, TABLES, shell
from trackfield.errors import RunFailed

__all__ = ["trackfield"]


# --- where the router's socket is --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["x" * 90, "a?b#c", "ä", "not there"])
def test_a_folder_for_temporary_files_in_which_no_router_could_listen(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(endpoint.tempfile, "tempdir", str(tmp_path / name))
    if name != "not there":
        (tmp_path / name).mkdir()
    folder = SocketFolder()
    assert tmp_path not in folder.path.parents
    assert len(folder.endpoint) < 107
    folder.close()
    assert not folder.path.exists()


def test_a_run_does_not_mind_it(tmp_path: Path) -> None:
    strange = tmp_path / f"{'long' * 30}?#"
    strange.mkdir()
    said = shell(f"TMPDIR='{strange}' {RUN}", tmp_path)
    assert said.returncode == 0, said.stderr
    assert {file.name for file in (tmp_path / "mine").iterdir()} >= TABLES


def test_no_place_at_all(trackfield: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(endpoint, "_places", lambda: iter(["/nowhere", "/a?b", "x" * 100, "/proc"]))
    said = trackfield("run", "spcpf", "--nodes", 9)
    assert (said.code, said.out) == (1, "")
    assert said.err.startswith("trackfield: there is no place for the router's socket, not in /nowhere, /a?b, ")
    assert "set TMPDIR to a folder that can be written" in said.err
    assert list(tmp_path.iterdir()) == []


def test_folders_of_launchers_that_were_killed_are_swept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoint, "_places", lambda: iter(["/tmp", "/var/tmp"]))
    long_ago = time.time() - 3600
    in_use = SocketFolder()
    others = {name: in_use.path.parent / f"{endpoint.PREFIX}{os.getpid()}{name}" for name in ("old", "young")}
    for folder in others.values():
        folder.mkdir()
        (folder / "router.sock").touch()
    for old in (in_use.path, others["old"]):
        os.utime(old, (long_ago, long_ago))
    SocketFolder().close()
    assert in_use.path.exists()
    until(lambda: not others["old"].exists())  # another run of this moment may be the one that removes it
    assert others["young"].exists()
    in_use.close()
    os.utime(others["young"], (long_ago, long_ago))
    SocketFolder().close()
    until(lambda: not others["young"].exists())


# --- what the machine allows -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limit", "command", "said"),
    [
        ("-n 90", "run spcpf --nodes 9", "this run needs 100 open files, and 90 are allowed (ulimit -Hn)"),
        ("-n 200", "run zhai-spcpf", "this run needs 324 open files, and 200 are allowed (ulimit -Hn)"),
        ("-v 2000000", "run spcpf", "this run needs 3072 MiB of address space, and 1953 are allowed (ulimit -v)"),
    ],
)
def test_too_little_is_refused_before_anything_starts(limit: str, command: str, said: str, tmp_path: Path) -> None:
    told = shell(f"ulimit {limit}; {RUN.partition(' run ')[0]} {command}", tmp_path)
    end = "a run in virtual time (--virtual) needs much less\n"
    assert (told.returncode, told.stdout, told.stderr) == (1, "", f"trackfield: {said}\n{end}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("options", ["", "--json", "--quiet"])
def test_a_scenario_is_valid_on_a_machine_that_cannot_run_it(options: str, tmp_path: Path) -> None:
    command = f"{RUN.partition(' run ')[0]} validate zhai-spcpf {options}"
    before, told = shell(command, tmp_path), shell(f"ulimit -n 200; {command}", tmp_path)
    assert told.returncode == before.returncode == 0, told.stderr
    said = "this run needs 324 open files, and 200 are allowed (ulimit -Hn)"
    if options == "--json":
        assert json.loads(told.stdout)["machine"][0] == said
        assert json.loads(told.stdout) | {"machine": []} == json.loads(before.stdout)
    elif options == "--quiet":
        assert told.stdout + told.stderr == ""
    else:
        findings, _, machine = " ".join(told.stderr.split()).partition(" warning: not on this machine: ")
        assert findings == " ".join(before.stderr.split())
        assert machine.startswith(said)


def test_what_is_said_to_be_enough_is_enough(tmp_path: Path) -> None:
    said = shell(f"ulimit -n 100; {RUN}", tmp_path)
    assert said.returncode == 0, said.stderr
    assert {file.name for file in (tmp_path / "mine").iterdir()} >= TABLES


def test_few_open_files_are_enough_for_virtual_time(tmp_path: Path) -> None:
    assert shell(f"ulimit -n 64; {RUN} --virtual", tmp_path).returncode == 0


def test_a_limit_on_processes_binds_all_but_root(trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    get = resource.getrlimit
    few = {resource.RLIMIT_NPROC: (250, 250)}
    monkeypatch.setattr(limits.resource, "getrlimit", lambda which: few.get(which) or get(which))
    monkeypatch.setattr(limits.os, "getuid", lambda: 0)
    assert trackfield("validate", "spcpf", "--nodes", 9).code == 0
    monkeypatch.setattr(limits.os, "getuid", lambda: 4711)
    monkeypatch.setattr(limits, "_threads_of", lambda user: 100)
    said = trackfield("run", "spcpf", "--nodes", 9)
    assert said.code == 1
    assert said.err.startswith(
        "trackfield: this run needs 180 processes and threads, and 150 more are allowed (ulimit -u: 250)\n"
    )
    monkeypatch.setattr(limits, "_threads_of", lambda user: 60)
    assert trackfield("validate", "spcpf", "--nodes", 9).code == 0


def test_one_of_a_container_binds_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pids.max").write_text("600\n")
    (tmp_path / "pids.current").write_text("70\n")
    monkeypatch.setattr(limits, "_ROOT", tmp_path)
    plan = planned(load("spcpf"), 1.0)
    with pytest.raises(RunFailed, match=r"needs 516 processes and threads, and 500 more are allowed \(pids.max of /"):
        (tmp_path / "pids.current").write_text("100\n")
        limits.check_machine(plan, router=True)
    limits.check_machine(plan, router=False, guests=len(plan.processes))
    (tmp_path / "pids.max").write_text("max\n")
    limits.check_machine(plan, router=True)


def test_own_threads_are_counted() -> None:
    assert limits._threads_of(os.getuid()) > 0
    assert limits._threads_of(2**31 - 2) == 0


# --- folders ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["run spcpf --nodes 9 --virtual", "study spcpf --nodes 9 --seeds 1"])
def test_a_working_folder_whose_name_is_no_text(command: str, tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path) + b"/m\xff"
    os.mkdir(folder)  # noqa: PTH102  no path of Python's can name it as well
    told = subprocess.run(
        [*RUN.partition(" run ")[0].split(), *command.split()], cwd=folder, capture_output=True, text=True, check=False
    )
    assert told.returncode == 2
    assert "is not text; expected UTF-8" in told.stderr
    assert os.listdir(folder) == []  # noqa: PTH208


@pytest.mark.parametrize("name", ["a\u00a0b", "a\u3000b", "a\u202fb", "a\u200db", "a\u2028b", "a\ufeffb"])
def test_a_folder_with_unusual_blanks_in_its_name(name: str, tmp_path: Path, trackfield: Call) -> None:
    folder, trace = tmp_path / name, Path(__file__).with_name("trace.csv")
    settings = ("--set", "link.model=trace", "--set", f"link.file={trace}")
    done = trackfield("run", "spcpf", "--nodes", 9, "--tracker", "spcpf", "--virtual", *settings, "--out", folder)
    assert (done.code, "no report" in done.err + done.out) == (0, False)
    assert (folder / "report.html").exists()
    assert trackfield("replay", folder, "--out", tmp_path / "again").code == 0


@pytest.mark.parametrize("folder", ["/proc", "gone"])
def test_a_working_folder_that_cannot_be_written(folder: str, tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    told = shell(f"cd {folder}; rmdir {tmp_path}/gone; {RUN.partition(' --out')[0]} --virtual", tmp_path)
    assert told.returncode in (1, 2)
    assert "Traceback" not in told.stderr
    assert len(told.stderr.splitlines()) == 1


def test_neither_home_nor_input_is_needed(tmp_path: Path) -> None:
    assert shell(f"env -u HOME {RUN} --virtual <&-", tmp_path).returncode == 0
