"""What befalls a run: drawn from a seed, done at instants of wall time, and written down as it is done."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import Path
from random import Random
from threading import Thread
from typing import Final

import psutil
import zenoh
from zenoh.handlers import Callback

from tests.running import METRICS, Run
from trackfield.drivers.session import open_client
from trackfield.wire import Envelope, WireError, keys

SPEED: Final = 4.0
STARTING_S: Final = 3.0
"""About how long a run takes until emulated time goes on, and at its end until all is written."""
LAUNCHER, DISK = "launcher", "disk"
OTHERS: Final = ("node", "fusion", "router", "recorder", "zygote")
DISK_BYTES: Final = 16_000_000
"""A small disk of its own, so that it can be filled."""
FILLER: Final = "filler"
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Phase(Enum):
    """How far a run was when something befell it."""

    STARTING = "as it starts"
    RUNNING = "as it runs"
    CLOSING = "as it ends"
    OVER = "after it"


@dataclass(frozen=True)
class Deed:
    """``number`` is a signal to ``whom``, ``at_s`` after the command was given; ``for_s`` until it is continued.

    ``whom`` may be the disk, which is full for so long. With ``running`` the time counts from the first frame.
    """

    at_s: float
    whom: str
    number: int
    for_s: float | None = None
    running: bool = False

    def __str__(self) -> str:
        what = "full" if self.whom == DISK else signal.Signals(self.number).name
        at = f"{self.at_s} s after the first frame" if self.running else f"{self.at_s} s"
        return f"{self.whom} {what} at {at}" + ("" if self.for_s is None else f" for {self.for_s} s")


@dataclass(frozen=True)
class Done:
    """A deed that was done: to the process ``name``, at ``t_ns`` of emulated time (None: nothing was sent yet)."""

    deed: Deed
    name: str
    phase: Phase
    t_ns: int | None


@dataclass(frozen=True)
class Case:
    """The run of a seed, and what befalls it."""

    seed: int

    @cached_property
    def deeds(self) -> tuple[Deed, ...]:
        """Two of three at an instant of emulated time and shortly after, the others while the run starts."""
        draw = Random(f"deeds {self.seed}")
        many = draw.choice([1, 1, 1, 2, 3, 5])
        return tuple(self._deed(draw, running=draw.random() < 0.7) for _ in range(many))

    def _deed(self, draw: Random, *, running: bool) -> Deed:
        at_s = round(draw.uniform(0, (self.steps + 1) / SPEED + STARTING_S if running else 2 * STARTING_S), 2)
        kind = draw.choice(["signal", "signal", "kill", "kill", "kill", "stop", "stop", "disk", "end of the launcher"])
        pause_s = draw.choice([0.3, 2.0, 4.0, 6.0])
        match kind:
            case "signal":
                return Deed(at_s, LAUNCHER, draw.choice(SIGNALS), running=running)
            case "kill":
                number = draw.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGSEGV])
                return Deed(at_s, draw.choice(OTHERS), number, running=running)
            case "stop":
                return Deed(at_s, draw.choice([*OTHERS, LAUNCHER]), signal.SIGSTOP, pause_s, running)
            case "disk":
                return Deed(at_s, DISK, 0, pause_s, running)
        return Deed(at_s, LAUNCHER, draw.choice([signal.SIGKILL, signal.SIGQUIT]), running=running)

    @property
    def steps(self) -> int:
        return Random(f"steps {self.seed}").randint(12, 24)

    @property
    def restart(self) -> bool:
        return Random(f"restart {self.seed}").random() < 0.4

    @property
    def settings(self) -> tuple[str, ...]:
        """Keys of the scenario."""
        threshold = Random(f"threshold {self.seed}").choice(["adaptive", "0.5"])
        restart = ("restart=on-death",) if self.restart else ()
        return (
            f"target.steps={self.steps}",
            f"sensor.threshold={threshold}",
            f"seed={self.seed}",
            "clock.offset_ms=20",
            "fusion.trackers=['imm-ukf']",
            *restart,
        )

    @property
    def arguments(self) -> list[str]:
        """What ``trackfield run`` is told."""
        settings = [part for setting in self.settings for part in ("--set", setting)]
        return ["spcpf", "--nodes", "9", *settings, "--speed", str(SPEED)]


# --- doing it -----------------------------------------------------------------------------------------------------


class Clock:
    """Emulated time of a run, from the frames that pass: each says when it was sent, and when it was put.

    ``begun`` is when the first one passed (monotonic, s).
    """

    def __init__(self) -> None:
        self._session: zenoh.Session | None = None
        self._offset: float | None = None
        self.begun: float | None = None

    def look(self, run: Run) -> None:
        """Join the run's router, as soon as that can be."""
        if self._session is not None or not (run.folder / "manifest.json").exists():
            return
        with suppress(zenoh.ZError, OSError, ValueError, KeyError):
            manifest = json.loads((run.folder / "manifest.json").read_bytes())
            self._session = open_client(manifest["endpoint"], manifest["run"], timeout_s=0.2)
            self._held = self._session.declare_subscriber(keys.ALL_DATA, Callback(self._on_frame, indirect=False))

    def _on_frame(self, sample: zenoh.Sample) -> None:
        if self.begun is None:
            self.begun = time.monotonic()
        with suppress(WireError):
            envelope = Envelope.unpack(sample.attachment.to_bytes() if sample.attachment else b"")
            self._offset = envelope.sent_ns - envelope.put_ns * SPEED

    def now_ns(self) -> int | None:
        """Emulated time (None: no frame has passed yet)."""
        return None if self._offset is None else round(time.monotonic_ns() * SPEED + self._offset)

    def close(self) -> None:
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]


@dataclass
class Doer:
    """Does the deeds of a case to a run, in a thread of its own; ``done`` lists those that met somebody."""

    case: Case
    run: Run
    done: list[Done] = field(default_factory=list)
    clock: Clock = field(default_factory=Clock)
    _begun: float = field(default_factory=time.monotonic)

    def start(self) -> Thread:
        thread = Thread(target=self._do, daemon=True)
        thread.start()
        return thread

    def _do(self) -> None:
        todo = list(self.case.deeds)
        again: list[tuple[float, Deed, list[psutil.Process]]] = []
        while todo or again:
            self.clock.look(self.run)
            for deed in [deed for deed in todo if self._due(deed)]:
                todo.remove(deed)
                if (met := self._begin(deed)) is not None and deed.for_s is not None:
                    again.append((self.now_s + deed.for_s, deed, met))
            over = self.phase() is Phase.OVER
            todo = [] if over else todo
            for entry in [entry for entry in again if over or entry[0] <= self.now_s]:
                again.remove(entry)
                self._undo(*entry[1:])
            time.sleep(0.02)
        self.clock.close()

    def _due(self, deed: Deed) -> bool:
        begun = self.clock.begun if deed.running else self._begun
        return begun is not None and time.monotonic() >= begun + deed.at_s

    @property
    def now_s(self) -> float:
        return time.monotonic() - self._begun

    def phase(self) -> Phase:
        """How far the run is."""
        if self.run.process.poll() is not None:
            return Phase.OVER
        said = self.run.said()
        if "run folder" in said or (self.run.folder / METRICS).exists():
            return Phase.CLOSING
        return Phase.RUNNING if "\nt = " in said else Phase.STARTING

    def _begin(self, deed: Deed) -> list[psutil.Process] | None:
        phase = self.phase()
        if deed.whom == DISK:
            self._fill()
            self.done.append(Done(deed, DISK, phase, self.clock.now_ns()))
            return []
        target = self._target(deed)
        if target is None:
            return None
        name, process = target
        self.done.append(Done(deed, name, phase, self.clock.now_ns()))
        with suppress(psutil.Error):
            process.send_signal(deed.number)
        return [process]

    def _undo(self, deed: Deed, met: list[psutil.Process]) -> None:
        if deed.whom == DISK:
            (self.run.folder.with_name(FILLER)).unlink(missing_ok=True)
        for process in met:
            with suppress(psutil.Error):
                process.send_signal(signal.SIGCONT)

    def _target(self, deed: Deed) -> tuple[str, psutil.Process] | None:
        """Who it is for, if there is one: of the nodes, one that the seed and the instant choose."""
        try:
            if deed.whom == LAUNCHER:
                return None if self.run.process.poll() is not None else (LAUNCHER, psutil.Process(self.run.process.pid))
            family = self.run.family()
        except psutil.Error:
            return None
        titles = sorted(title for title in family if title.split()[0] == deed.whom)
        if not titles:
            return None
        title = Random(f"{self.case.seed} {deed.at_s}").choice(titles)
        return title.rpartition(" ")[2], family[title]

    def _fill(self) -> None:
        with (self.run.folder.with_name(FILLER)).open("wb", buffering=0) as file, suppress(OSError):
            while True:
                file.write(bytes(65536))


@contextmanager
def small_disk(folder: Path) -> Iterator[bool]:
    """A disk of its own at this folder, where that is allowed (as root); says whether it is there."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", str(folder)]
    there = os.geteuid() == 0 and subprocess.run(mount, capture_output=True, check=False).returncode == 0
    try:
        yield there
    finally:
        if there:
            subprocess.run(["umount", "--lazy", str(folder)], check=False)


def case_of(seed: int, *deeds: Deed) -> Case:
    """The run of this seed, and these deeds in place of its own."""
    case = Case(seed)
    case.__dict__["deeds"] = deeds
    return case
