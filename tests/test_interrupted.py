"""Ctrl-C in a virtual run, whenever it comes: a whole folder or none, and exit code 130."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from launcher.signals import handling
from tests.command_line import Call, trackfield
from tests.interrupting import interrupt_at
from tests.reporting import read
from tests.running import PATIENCE_S, until

__all__ = ["trackfield"]

RUN = ("run", "zhai-spcpf", "--virtual", "--out", "mine")


def interrupt_in(module: str, name: str, monkeypatch: pytest.MonkeyPatch, number: int = signal.SIGINT) -> None:
    """Have this signal come as soon as this function is called."""

    def interrupted(*arguments: Any, **options: Any) -> None:
        os.kill(os.getpid(), number)

    monkeypatch.setattr(f"{module}.{name}", interrupted)


def test_a_run_ends_early_and_leaves_a_whole_folder(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    interrupt_at(100, monkeypatch)
    said = trackfield(*RUN)
    assert said.code == 130
    assert "ended early; everything up to then is in the run folder" in said.err
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    folder = Path("mine")
    metrics = json.loads((folder / "metrics.json").read_text())
    assert 10 < metrics["ended_s"] < 40
    assert pq.read_table(folder / "tracks.parquet")["step"].to_pylist()[-1] < 40
    assert pq.read_table(folder / "messages.parquet").num_rows == metrics["frames"]["expected"] == 100
    assert "The run ended early, " in read(folder).text
    assert trackfield("report", "mine").code == 0
    assert trackfield("replay", "mine", "--out", "again").code == 0
    assert trackfield("compare", "mine", "again", "--exact", "1e-9").code == 0
    interrupt_in("launcher.study.replay", "_fuse", monkeypatch)
    assert trackfield("replay", "mine", "--out", "third").code == 130
    assert not Path("third").exists()


def test_a_replay_without_late_reports_says_that_there_were_none(trackfield: Call) -> None:
    assert trackfield(*RUN, "--set", "target.steps=3", "--quiet").code == 0
    said = trackfield("replay", "mine", "--drop-late", "--out", "again")
    assert said.code == 0
    assert "note: no report of the run was late (frames.late): --drop-late changes nothing" in said.err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_one_while_the_run_is_planned_leaves_nothing(
    number: int, trackfield: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    interrupt_in("launcher.plan.prepare", "make_plan", monkeypatch, number)
    said = trackfield(*RUN)
    assert (said.code, said.out) == (128 + number, "")
    assert said.err == "trackfield: interrupted before the run began; there is no run folder\n"
    assert list(tmp_path.iterdir()) == []


def test_one_while_the_folder_is_begun_leaves_nothing(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    interrupt_in("launcher.record.folder", "keep", monkeypatch)
    assert trackfield(*RUN).code == 130
    assert list(tmp_path.iterdir()) == []


def test_one_while_the_report_is_drawn_leaves_the_run_without_it(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = os.getpid()

    def drawn(*_: object) -> None:
        os.kill(run, signal.SIGINT)
        time.sleep(300)

    monkeypatch.setattr("launcher.report.page.write_page", drawn)
    begun = time.monotonic()
    said = trackfield(*RUN, "--set", "target.steps=5")
    assert said.code == 130
    assert time.monotonic() - begun < 200
    assert "no report: interrupted; trackfield report mine draws it" in said.err
    assert "interrupted after its end; the run is complete" in said.err
    assert {file.name for file in Path("mine").iterdir()} == {
        "scenario.toml", "manifest.json", "run.rrd", "messages.parquet", "tracks.parquet", "metrics.json", "logs",
    }  # fmt: skip


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_closed_terminal_ends_a_run_as_any_other_signal_does(number: int, tmp_path: Path) -> None:
    """It reaches the whole process group, with the process that draws the report."""
    command = [sys.executable, "-m", "launcher", *RUN, "--set", "target.steps=4000"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, process_group=0, env={**os.environ, "COLUMNS": "200"}
    ) as run:
        until((tmp_path / "mine" / "manifest.json").exists)
        time.sleep(0.5)
        os.killpg(run.pid, number) if number == signal.SIGHUP else run.send_signal(number)
        _, said = run.communicate(timeout=PATIENCE_S)
    assert run.returncode == 128 + number, said
    assert "ended early; everything up to then is in the run folder" in said
    assert (tmp_path / "mine" / "report.html").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_one_while_a_class_is_made_ends_the_program_with_its_own_code(number: int, tmp_path: Path) -> None:
    """Dataclasses are made by ``exec``, most of them as the program starts."""
    (tmp_path / "program.py").write_text(
        "import os\n"
        "from launcher import cli\n"
        f"cli.app = lambda **_: exec('os.kill(os.getpid(), {number:d})')\n"
        "cli.main()\n"
    )
    paths = os.pathsep.join((str(Path(__file__).parents[1]), str(tmp_path)))
    command = [sys.executable, "-m", "program"]
    said = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, check=False
    )
    assert (said.returncode, said.stderr) == (128 + number, "")


def test_a_closed_terminal_that_is_ignored_stays_ignored() -> None:
    """As under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with handling(lambda _: None):
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) != signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)
    with handling(lambda _: None):
        assert signal.getsignal(signal.SIGHUP) != before
    assert signal.getsignal(signal.SIGHUP) == before


def test_a_handler_that_was_not_set_from_python_gives_way_to_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    """``signal.signal`` returns None for one that a library or an embedding program set."""
    put, own = signal.signal, signal.getsignal(signal.SIGTERM)

    def tells_nothing(number: int, handler: Any) -> None:
        put(number, handler)

    monkeypatch.setattr(signal, "signal", tells_nothing)
    try:
        with handling(lambda _: None, (signal.SIGTERM,)):
            assert callable(signal.getsignal(signal.SIGTERM))
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        put(signal.SIGTERM, own)
