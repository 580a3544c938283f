"""Fields that are started in slices, here all on this machine: as other processes, which join the run's own router."""

from __future__ import annotations

import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import psutil

from tests.running import PATIENCE_S, SPEEDS, STARTED, Run, kept_up


def free_endpoint(protocol: str = "tcp") -> str:
    """Where nobody listens yet."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"{protocol}/127.0.0.1:{probe.getsockname()[1]}"


def descendants(pid: int) -> list[psutil.Process]:
    """The living children of this process, and theirs."""
    return psutil.Process(pid).children(recursive=True)


class SliceProcess:
    """``trackfield field`` as a subprocess, with logs in a folder of its own; ``before`` is put before its command."""

    def __init__(
        self, home: Path, which: str, endpoint: str, *options: str, name: str = "", before: Sequence[str] = ()
    ) -> None:
        self.folder = home / (name or f"slice-{which.replace('/', '-of-')}")
        self._said = self.folder.with_suffix(".said")
        command = [*before, sys.executable, "-m", "launcher", "field", "--slice", which, "--connect", endpoint]
        with self._said.open("w") as said:
            self.process = subprocess.Popen([*command, "--out", str(self.folder), *options], stderr=said)
        STARTED.append(self.process)

    def finish(self, timeout: float = PATIENCE_S) -> tuple[int, str]:
        """Wait for its end: exit code and what it said."""
        return self.process.wait(timeout), self.said()

    def said(self) -> str:
        return self._said.read_text()

    def joined(self) -> str:
        """Which slice it has, like ``slice 1/3``; empty before it has said so."""
        return next((line.partition(" of ")[0] for line in self.said().splitlines() if line.startswith("slice ")), "")

    def kill(self, number: signal.Signals = signal.SIGKILL) -> None:
        self.process.send_signal(number)


class Sliced:
    """A run whose field is in so many slices, of which some may not be ``started``."""

    def __init__(
        self, home: Path, of: int, *arguments: str, started: Sequence[int] | None = None, protocol: str = "tcp"
    ) -> None:
        home.mkdir(exist_ok=True)
        self.home, self.endpoint, self.of = home, free_endpoint(protocol), of
        outside = ("--field", "external", "--listen", self.endpoint)
        self.run = Run(home / "run", *arguments, *outside)
        wanted = range(1, of + 1) if started is None else started
        self.slices = {number: self.start(f"{number}/{of}") for number in wanted}

    def start(self, which: str, *options: str, name: str = "", before: Sequence[str] = ()) -> SliceProcess:
        """One more slice, that waits for the run."""
        return SliceProcess(self.home, which, self.endpoint, "--wait", *options, name=name, before=before)

    def finish(self) -> tuple[int, str]:
        """How the run ended, and its slices after it."""
        ended = self.run.finish()
        for one in self.slices.values():
            one.finish()
        return ended


def on_time(home: Path, of: int, *arguments: str, speeds: Sequence[float] = SPEEDS) -> Sliced:
    """Such a run, which has ended, at the first of these speeds at which the machine keeps up with it."""
    for speed in speeds:
        shutil.rmtree(home, ignore_errors=True)
        sliced = Sliced(home, of, *arguments, "--speed", str(speed))
        sliced.finish()
        if not (sliced.run.folder / "metrics.json").exists() or kept_up(sliced.run.metrics()):
            break
    return sliced
