"""Standard streams that are closed, full or no longer read: no run ends by them, and no command is noisy about them."""

from __future__ import annotations

import os
import pty
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.running import PATIENCE_S, UNREPORTED, until

TRACKFIELD = f"{sys.executable} -m launcher"
QUICKER = f"{sys.executable} -c {shlex.quote(UNREPORTED)}"
"""The same without drawing reports; of each driver one run without streams draws its own."""
SHORT = "run spcpf --nodes 9 --set target.steps=2 --out mine"
RUN = f"{TRACKFIELD} {SHORT}"
TABLES = {"metrics.json", "messages.parquet", "tracks.parquet", "run.rrd", "report.html"}


def shell(command: str, where: Path) -> subprocess.CompletedProcess[str]:
    """What bash says to this command, whose exit code is that of the first in its pipe that fails."""
    full = ["bash", "-o", "pipefail", "-c", command]
    return subprocess.run(full, cwd=where, capture_output=True, text=True, timeout=100, check=False)


@pytest.mark.parametrize(("program", "streams"), [(TRACKFIELD, ">&- 2>&- <&-"), (QUICKER, "2>/dev/full")])
def test_a_run_over_processes_needs_no_streams(program: str, streams: str, tmp_path: Path) -> None:
    assert shell(f"{program} {SHORT} {streams}", tmp_path).returncode == 0
    assert {file.name for file in (tmp_path / "mine").iterdir()} >= TABLES


@pytest.mark.parametrize(
    ("program", "streams"),
    [(QUICKER, ">&-"), (TRACKFIELD, "2>&-"), (QUICKER, "2>&1 | true"), (QUICKER, "2>/dev/full")],
)
def test_a_run_in_virtual_time_needs_none_either(program: str, streams: str, tmp_path: Path) -> None:
    assert shell(f"{program} {SHORT} --virtual {streams}", tmp_path).returncode == 0
    assert {file.name for file in (tmp_path / "mine").iterdir()} >= TABLES


@pytest.mark.parametrize("driver", ["--virtual --set target.steps=400", "--speed 5 --set target.steps=20"])
def test_a_terminal_that_goes_away_does_not_end_a_run_that_ignores_it(driver: str, tmp_path: Path) -> None:
    """From then on whatever is written to it fails (EIO)."""
    ours, theirs = pty.openpty()
    command = f"trap '' HUP; exec {QUICKER} run spcpf --nodes 9 --out mine {driver}"
    run = subprocess.Popen(["bash", "-c", command], cwd=tmp_path, stdout=theirs, stderr=theirs, start_new_session=True)
    os.close(theirs)
    until((tmp_path / "mine" / "manifest.json").exists)
    os.close(ours)
    assert run.wait(PATIENCE_S) == 0
    assert {file.name for file in (tmp_path / "mine").iterdir()} >= TABLES


@pytest.mark.parametrize(
    ("command", "code", "err"),
    [
        ("list | true", 141, ""),  # as of any program that its reader leaves: 128 + SIGPIPE
        ("--help | true", 141, ""),
        ("run zhai-spcpf --virtual --quiet --json --set target.steps=2 --out mine | true", 141, ""),
        ("list > /dev/full", 1, "trackfield: what should go to stdout was lost (No space left on device)\n"),
        ("list >&-", 0, ""),
        ("lst | true", 2, "trackfield: No such command 'lst'. Did you mean 'list', 'listen'?; see trackfield --help\n"),
    ],
)
def test_what_nobody_reads(command: str, code: int, err: str, tmp_path: Path) -> None:
    program = QUICKER if command.startswith("run ") else TRACKFIELD
    said = shell(f"{program} {command}", tmp_path)
    assert (said.returncode, said.stderr) == (code, err)


def test_any_encoding_will_do(tmp_path: Path) -> None:
    ascii_only = "LC_ALL=C PYTHONCOERCECLOCALE=0 PYTHONUTF8=0"
    said = shell(f"{ascii_only} {TRACKFIELD} list scenarios; {ascii_only} {RUN} --virtual", tmp_path)
    assert said.returncode == 0, said.stderr
    assert "Traceback" not in said.stderr


@pytest.mark.parametrize(
    "arguments", ["run spcpf --out $'m\\xff'", "view $'m\\xff'", "validate spcpf --set $'a\\xff=1'"]
)
def test_arguments_are_text(arguments: str, tmp_path: Path) -> None:
    said = shell(f"{TRACKFIELD} {arguments}", tmp_path)
    assert (said.returncode, said.stdout) == (2, "")
    assert said.stderr.startswith("trackfield: '")
    assert said.stderr.endswith("\\udcff' is not text; expected UTF-8\n") or "\\udcff=1' is not text" in said.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_a_role_that_stands_alone_needs_no_streams_either(tmp_path: Path) -> None:
    command = f"{sys.executable} -m node --connect tcp/127.0.0.1:9 --run r --id n001"
    assert shell(f"{command} >&- 2>&-", tmp_path).returncode == 1
    assert shell(f"{command} 2>/dev/full", tmp_path).returncode == 1


def test_a_script_without_streams_runs_processes(tmp_path: Path) -> None:
    """What it opens gets the numbers of the streams, and is not for its processes."""
    script = tmp_path / "script.py"
    script.write_text(
        "import os, trackfield as tf\n"
        "held = [os.open(os.devnull, os.O_RDONLY) for _ in range(3)]\n"
        "field = tf.Scenario.load('zhai-spcpf', {'target.steps': 2, 'field.nodes': 9})\n"
        "tf.run(field, driver='processes', out='mine')\n"
    )
    assert shell(f"{sys.executable} {script} <&- >&- 2>&-", tmp_path).returncode == 0
    assert {file.name for file in (tmp_path / "mine").iterdir()} >= TABLES
