"""Real runs of the command line, for tests that look at them from outside."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

PATIENCE_S = 150.0
"""After which a test gives up waiting: for what hangs, not for what is slow, as all is on a machine that is busy."""
STARTED: list[subprocess.Popen[bytes]] = []
"""The runs of this module of tests; none of them outlives it (``conftest``)."""
LISTENER = Path(__file__).with_name("listener.py")
METRICS = "metrics.json"
SPEEDS = (5.0, 1.0, 0.3)
"""Of runs as processes, emulated seconds in a second: if the machine cannot keep up with one, the next."""


UNREPORTED = """
from contextlib import nullcontext
from launcher import drawing

def write_here(folder):
    (folder / "report.html").write_text("not drawn")

drawing.write_here = write_here
drawing.written_beside = lambda: nullcontext(write_here)
from launcher.cli import main
main()
"""
"""The command line without the drawing of reports, which takes longer than all else of a short run."""


class Run:
    """``trackfield run`` as a subprocess with its output folder; what it says on stderr goes to the file ``said``.

    Its report is drawn only if it is ``reported``.
    """

    def __init__(self, folder: Path, *arguments: str, said: Path | None = None, reported: bool = False) -> None:
        self.folder = folder
        program = ("-m", "launcher.cli") if reported else ("-c", UNREPORTED)
        command = [sys.executable, *program, "run", *arguments, "--out", str(folder)]
        self._said = said or folder.with_suffix(".stderr")
        with self._said.open("w") as stderr:
            self.process = subprocess.Popen(command, stderr=stderr, env={**os.environ, "COLUMNS": "200"})
        STARTED.append(self.process)

    def finish(self, timeout: float = PATIENCE_S) -> tuple[int, str]:
        """Wait for its end: exit code and what it said on stderr."""
        return self.process.wait(timeout), self.said()

    def said(self) -> str:
        """What it said on stderr so far."""
        return self._said.read_text()

    def metrics(self) -> dict[str, Any]:
        return json.loads((self.folder / METRICS).read_text())  # type: ignore[no-any-return]

    def manifest(self) -> dict[str, Any]:
        return json.loads(until((self.folder / "manifest.json").read_text))  # type: ignore[no-any-return]

    def family(self) -> dict[str, psutil.Process]:
        """All processes of the run by title, without "trackfield"."""
        found = {}
        for child in psutil.Process(self.process.pid).children(recursive=True):
            try:
                title = " ".join(child.cmdline()).strip()
            except psutil.Error:
                continue
            if title.startswith("trackfield "):
                found[title.removeprefix("trackfield ")] = child
        return found

    def started(self) -> None:
        """Wait until emulated time goes on."""
        until(lambda: "\nt = " in self.said())


def kept_up(metrics: Mapping[str, Any]) -> bool:
    """Whether the machine was fast enough for a run as processes, and lost none of its frames."""
    return not (metrics["timing"]["host_late"] or metrics["frames"]["host_lost"] or metrics["recorder"]["dropped"])


def on_time(folder: Path, *arguments: str, speeds: Sequence[float] = SPEEDS) -> tuple[int, str]:
    """How a run as processes ended, at the first of the ``speeds`` at which the machine keeps up with it."""
    for speed in speeds:
        shutil.rmtree(folder, ignore_errors=True)
        run = Run(folder, *arguments, "--speed", str(speed))
        ended = run.finish(PATIENCE_S / min(speed, 1.0))
        if not (folder / METRICS).exists() or kept_up(run.metrics()):
            return ended
    return 1, f"the machine is too slow for speed {speeds[-1]:g}: {run.metrics()['timing']}"


def both_ways(home: Path, *arguments: str, reported: bool = False) -> Path:
    """A folder with the same run twice: as ``processes`` and ``virtual``, the latter with its report if asked for."""
    virtual = Run(home / "virtual", *arguments, "--virtual", reported=reported).finish()
    for code, said in (virtual, on_time(home / "processes", *arguments)):
        assert code == 0, said
    return home


def until(condition: Callable[[], Any], timeout: float = PATIENCE_S) -> Any:
    """The first true answer; errors on the way count as not yet."""
    deadline = time.monotonic() + timeout
    while True:
        try:
            if answer := condition():
                return answer
        except (OSError, ValueError, psutil.Error):
            pass
        if time.monotonic() > deadline:
            raise TimeoutError("not within its time")
        time.sleep(0.05)


@contextmanager
def killed_on_failure(process: subprocess.Popen[str]) -> Iterator[None]:
    """What fails in this block takes the process with it: who waits for its end does not wait for all of its work."""
    try:
        yield
    except BaseException:
        process.kill()
        raise


@contextmanager
def counting(run: Run) -> Iterator[Callable[[], int]]:
    """A plain zenoh listener beside the run; call it to end it and get its count."""
    manifest = run.manifest()
    listener = subprocess.Popen(
        [sys.executable, str(LISTENER), manifest["endpoint"], manifest["run"]],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert listener.stdout is not None
    assert listener.stdout.readline() == "listening\n"
    try:
        yield lambda: int(listener.communicate("\n", timeout=20)[0])
    finally:
        listener.kill()
        listener.wait()


def leftovers(family: Iterable[psutil.Process]) -> list[str]:
    """Which of these processes are still there."""
    return [str(process) for process in family if process.is_running() and process.status() != psutil.STATUS_ZOMBIE]
