#!/usr/bin/env python3
"""Bring about the planned faults of containers in the run that comes next: `faults.py RUNS`, for `containers/field`.

RUNS is the folder of run folders. In its folder a run tells which container has which place and when emulated time
began (places.json), by the monotonic clock that all containers of this machine share. What was done, and when, is
written into containers.log beside it. Containers that stand still or are cut off are let go at the end, also if that
comes early.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from threading import Event, Lock
from typing import Any

LOOK_S = 0.1
PATIENCE_S = 60
AT_A_TIME = 16
BEGIN = {"container-kill": "kill", "container-restart": "kill", "container-pause": "pause"}
END = {"container-restart": "start", "container-pause": "unpause"}
LABEL = "com.docker.compose.network"
Command = tuple[str, ...]


def engine(*command: str) -> str:
    """What the engine says to this command. Raises ``RuntimeError`` with its message."""
    try:
        done = subprocess.run(
            ["docker", *command],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
            start_new_session=True,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RuntimeError(str(error)) from None
    if done.returncode:
        raise RuntimeError(" ".join(done.stderr.split()) or f"exit code {done.returncode}")
    return done.stdout


def networks_of(container: str, wanted: str) -> dict[str, list[str]]:
    """The networks of a container, each with its aliases there: all, or the one of this name in compose.yaml."""
    [about] = json.loads(engine("inspect", container))
    aliases = {name: one.get("Aliases") or [] for name, one in about["NetworkSettings"]["Networks"].items()}
    if not wanted:
        return aliases
    labels = {name: json.loads(engine("network", "inspect", name))[0].get("Labels") or {} for name in aliases}
    return {name: aliases[name] for name in aliases if labels[name].get(LABEL, name) == wanted}


def ways_of(kind: str, network: str, container: str) -> list[tuple[Command, Command]]:
    """The commands that bring about a fault, each with what undoes it (empty: nothing does)."""
    if kind in BEGIN:
        return [((BEGIN[kind], container), (END[kind], container) if kind in END else ())]
    return [
        (("network", "disconnect", name, container), ("network", "connect", *named(aliases), name, container))
        for name, aliases in networks_of(container, network).items()
    ]


def named(aliases: list[str]) -> list[str]:
    """Aliases as options of the engine."""
    return [part for alias in aliases for part in ("--alias", alias)]


class Run:
    """A run with faults of containers, by its file of places."""

    def __init__(self, file: Path) -> None:
        self.file, self.log = file, file.with_name("containers.log")
        self.told: dict[str, Any] = json.loads(file.read_text())
        self.ended = Event()
        self._away: dict[int, list[Command]] = {}  # by the fault, how to undo what was done
        self._lock = Lock()

    def look(self) -> bool:
        """Read again where everybody is; whether the run is over."""
        try:
            self.told = json.loads(self.file.read_text())
        except FileNotFoundError:
            return True
        return bool(self.told["over"])

    def due_s(self, t_s: float) -> float:
        """The monotonic time at which emulated time is so long after the first step."""
        return float(self.told["begun_ns"] / 1e9 + (self.told["first_step_s"] + t_s) / self.told["speed"])

    def now_s(self) -> float:
        """Emulated time since the first step."""
        passed_s = time.monotonic() - self.told["begun_ns"] / 1e9
        return float(passed_s * self.told["speed"] - self.told["first_step_s"])

    def events(self) -> list[tuple[float, int, bool]]:
        """(when, which fault, whether it begins), in the order of time; of one instant, ends come first."""
        faults = list(enumerate(self.told["faults"]))
        begins = [(fault["at_s"], n, True) for n, fault in faults]
        ends = [(fault["until_s"], n, False) for n, fault in faults if fault["until_s"] is not None]
        return sorted(begins + ends, key=lambda one: (one[0], one[2], one[1]))

    def change(self, number: int, begins: bool) -> None:
        """Begin a fault or end it, and say so."""
        fault, since_s = self.told["faults"][number], self.now_s()
        about = f"{fault['kind']} of {fault['id']} at {fault['at_s']:g} s" + ("" if begins else " ends")
        try:
            done = self._begin(number, fault) if begins else self._end(number)
        except RuntimeError as error:
            self.say(f"{about}: failed: {error}")
        else:
            self.say(f"{about}: {done}, from {since_s:.3f} s to {self.now_s():.3f} s")

    def end_after(self, begun: Future[None], number: int) -> None:
        """End a fault, once it has begun."""
        begun.result()
        self.change(number, False)

    def _begin(self, number: int, fault: dict[str, Any]) -> str:
        """Do it, and keep what ends it."""
        container = self.told["places"].get(fault["id"])
        if container is None:
            raise RuntimeError(f"nobody has the place of {fault['id']}")
        ways = ways_of(fault["kind"], fault["network"], container)
        if not ways:
            raise RuntimeError(f"{container} is in no network {fault['network']}")
        for do, undo in ways:
            engine(*do)
            with self._lock:
                self._away.setdefault(number, []).append(undo)
        return told([do for do, _ in ways])

    def _end(self, number: int) -> str:
        """Undo what was done; what cannot be undone now is tried again at the end."""
        with self._lock:
            left = self._away.get(number, [])
        undone = []
        while left and left[-1]:
            engine(*left[-1])
            undone.append(left.pop())
        if not undone:
            raise RuntimeError("it did not begin")
        return told(undone)

    def let_go(self) -> None:
        """End what stands still or is cut off."""
        for number, left in self._away.items():
            if left and left[-1] and left[-1][0] != "start":
                self.change(number, False)

    def say(self, line: str) -> None:
        """Write a line into the log."""
        with self._lock, self.log.open("a") as log:
            log.write(f"{line}\n")

    def follow(self) -> None:
        """Bring about all faults at their times, until the run is over."""
        begun: dict[int, Future[None]] = {}
        with ThreadPoolExecutor(AT_A_TIME) as pool:
            for t_s, number, begins in self.events():
                while (wait_s := self.due_s(t_s) - time.monotonic()) > 0:
                    if self.ended.wait(min(wait_s, LOOK_S)) or self.look():
                        return
                if begins:
                    begun[number] = pool.submit(self.change, number, True)
                else:
                    pool.submit(self.end_after, begun[number], number)
            while not self.look() and not self.ended.wait(LOOK_S):
                pass


def told(commands: list[Command]) -> str:
    """Commands of the engine in words."""
    return ", ".join(" ".join(("docker", *command)) for command in commands)


def the_next(runs: Path, ended: Event) -> Path | None:
    """The file of the first run that begins from now on; None if there is none until the end."""
    begun = time.monotonic_ns()
    while not ended.wait(LOOK_S):
        for file in runs.glob("*/places.json"):
            try:
                if json.loads(file.read_text())["begun_ns"] > begun:
                    return file
            except (OSError, ValueError, KeyError):
                continue
    return None


def main() -> None:
    """Follow the next run to its end."""
    ended = Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())
    file = the_next(Path(sys.argv[1]), ended)
    if file is None:
        return
    run = Run(file)
    run.ended = ended
    try:
        run.follow()
    finally:
        run.let_go()


if __name__ == "__main__":
    main()
