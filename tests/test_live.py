"""The live view of a run from outside: who is served, and that the run does not depend on it."""

from __future__ import annotations

import os
import re
import signal
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from launcher.plan.prepare import load, planned
from launcher.processes import live
from launcher.records import LIVE, MessageRow
from launcher.timeline import timeline, view
from launcher.timeline.timeline import LINES, PROVISIONAL, Timeline
from tests import fake_run
from tests.command_line import Call, trackfield  # noqa: F401  a fixture
from tests.rrd import read, verify
from tests.running import Run, leftovers, until
from trackfield.role import NS

SMALL = ("spcpf", "--nodes", "9", "--live")


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    """A small run with a live view, under way."""
    run = Run(tmp_path / "run", *SMALL, "--set", "target.steps=20")
    try:
        run.started()
        yield run
    finally:
        run.process.kill()
        run.process.wait()


def address(run: Run) -> str:
    (found,) = re.findall(r"live view: (http://\S+)", run.said())
    return found


def viewers(run: Run) -> dict[str, psutil.Process]:
    """What a run has for its live view: its recorder, and Rerun's server."""
    children = psutil.Process(run.process.pid).children(recursive=True)
    return {LIVE: run.family()[LIVE], "viewer": next(child for child in children if child.name() == "rerun")}


def listening(process: psutil.Process) -> set[tuple[str, int]]:
    return {tuple(s.laddr) for s in process.net_connections() if s.status == psutil.CONN_LISTEN}


def test_it_is_served_to_this_machine_only_and_ends_with_the_run(run: Run) -> None:
    page, port = (int(port) for port in re.findall(r"(?::|%3A)(\d+)", address(run)))
    found = viewers(run)
    assert listening(found["viewer"]) == {("127.0.0.1", page)}
    assert listening(found[LIVE]) == {("127.0.0.1", port)}
    assert {process.nice() for process in found.values()} == {10}
    with urllib.request.urlopen(address(run), timeout=10) as answer:
        assert b"Rerun" in answer.read()
    family = [*run.family().values(), *found.values()]
    code, said = run.finish()
    assert code == 0, said
    assert "the live view" not in said  # nothing became of it
    assert leftovers(family) == []
    assert (run.folder / "logs" / "live.log").read_text() == ""


def test_ctrl_c_leaves_nothing(run: Run) -> None:
    family = [*run.family().values(), *viewers(run).values()]
    run.process.send_signal(signal.SIGINT)
    code, said = run.finish()
    assert code == 128 + signal.SIGINT, said
    assert leftovers(family) == []


def test_nothing_outlives_a_launcher_that_is_killed(run: Run) -> None:
    family = [*run.family().values(), *viewers(run).values()]
    run.process.kill()
    until(lambda: leftovers(family) == [])


@pytest.mark.parametrize(
    ("who", "number"), [(LIVE, signal.SIGKILL), ("viewer", signal.SIGKILL), (LIVE, signal.SIGSTOP)]
)
def test_a_run_does_not_need_its_live_view(run: Run, who: str, number: int) -> None:
    found = viewers(run)
    os.kill(found[who].pid, number)
    code, said = run.finish()
    assert code == 0, said
    assert said.count(f"the live view died ({who}: signal 9") == (number == signal.SIGKILL)
    metrics = run.metrics()
    assert metrics["frames"]["host_lost"] == metrics["recorder"]["dropped"] == 0
    assert metrics["processes"]["died"] == metrics["processes"]["stopped"] == []
    assert leftovers(found.values()) == []


def test_one_that_does_not_come_up_is_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "program", lambda: Path("/bin/false"))
    told: list[str] = []
    (tmp_path / "logs").mkdir()
    plan = planned(load("spcpf", nodes=9))
    with live.LiveView(plan, tmp_path, "unixsock-stream/none", b"", told.append) as none:
        none.wait_ready(set(), lambda: False)
    (note,) = told
    assert note.startswith("the live view died (viewer: exit code 1")
    assert note.endswith("the run goes on without it")


def test_a_run_in_virtual_time_has_none(trackfield: Call) -> None:  # noqa: F811
    said = trackfield("run", "spcpf", "--virtual", "--live")
    assert said.code == 2
    assert said.err.splitlines() == [
        "trackfield: --live: a run in virtual time is over at once; expected it without --virtual, or the timeline "
        "afterwards: trackfield view RUN"
    ]


def test_without_reruns_program_nothing_is_begun(
    trackfield: Call,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    said = trackfield("run", "spcpf", "--live")
    assert said.code == 1
    assert "Rerun's viewer is not installed" in said.err
    assert list(tmp_path.iterdir()) == []


# --- what a live timeline holds ----------------------------------------------------------------------------------


def test_a_live_timeline_sends_all_at_once_and_lists_some_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sinks = {51234: tmp_path / "live.rrd"}
    monkeypatch.setattr(timeline, "_shown", lambda port: timeline.rr.FileSink(sinks[port]))
    monkeypatch.setattr(timeline, "LINGER_S", 0.0)
    info = fake_run.info(side=3, steps=3)
    shown = Timeline(51234, info)
    row = MessageRow("doa", "n000", "fusion", "field", NS, NS + 1, "delivered", 10)
    for number in range(3 * LINES):
        shown.message(replace(row, due_ns=NS + 1 + number))
    shown.flush()
    shown.message(row)
    shown.flush()
    shown.close()
    file = sinks[51234]
    assert verify(file).returncode == 0
    assert len(read(file, "/messages/doa", "TextLog:text")) == LINES + 1
    notes = [text for _, (text,) in read(file, "/notes", "TextLog:text")]
    assert notes == [f"live view: {PROVISIONAL}", f"messages: {2 * LINES} more, not listed while the run goes on"]
    sent_in_bytes = [values for _, values in read(file, "/plots/bytes", "Scalars:scalars")]
    assert max(delivered for _, delivered in sent_in_bytes) == 10 * (3 * LINES + 1)
