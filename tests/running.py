"""Real runs of the command line, for tests that look at them from outside."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

LISTENER = Path(__file__).with_name("listener.py")


class Run:
    """``trackfield run`` as a subprocess with its output folder."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "launcher.cli", "run", *arguments, "--out", str(folder)]
        self._said = folder.with_suffix(".stderr")
        with self._said.open("w") as stderr:
            self.process = subprocess.Popen(command, stderr=stderr, env={**os.environ, "COLUMNS": "200"})

    def finish(self, timeout: float = 150) -> tuple[int, str]:
        """Wait for its end: exit code and what it said on stderr."""
        return self.process.wait(timeout), self.said()

    def said(self) -> str:
        """What it said on stderr so far."""
        return self._said.read_text()

    def metrics(self) -> dict[str, Any]:
        return json.loads((self.folder / "metrics.json").read_text())  # type: ignore[no-any-return]

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
        until(lambda: "t = " in self.said(), timeout=60)


def on_time(folder: Path, *arguments: str, speeds: Sequence[float] = (3.0, 1.0, 0.3)) -> tuple[int, str]:
    """How a run as processes ended, at the first of these speeds at which the machine keeps up with it."""
    for speed in speeds:
        shutil.rmtree(folder, ignore_errors=True)
        run = Run(folder, *arguments, "--speed", str(speed))
        ended = run.finish()
        if ended[0] or run.metrics()["timing"]["host_late"] == 0:
            return ended
    return 1, f"the machine is too slow for speed {speeds[-1]:g}: {run.metrics()['timing']}"


def until(condition: Callable[[], Any], timeout: float = 30) -> Any:
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
