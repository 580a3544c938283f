"""A plan as processes, once and without mercy for a slow machine, beside the same plan in virtual time."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from random import Random
from threading import Event, Thread
from typing import Any, Final

import psutil

from launcher.records import Plan
from launcher.run import run_processes, run_virtual
from launcher.show import Quiet
from launcher.study.compare import differences
from tests.running import kept_up
from tests.test_drivers_agree import SHARED

STALL_S: Final = 0.05


@dataclass(frozen=True)
class Compared:
    """The metrics of a run as processes, and all that tells it from the run in virtual time."""

    metrics: dict[str, Any]
    found: tuple[str, ...]

    @property
    def host_late(self) -> int:
        return int(self.metrics["timing"]["host_late"])

    @property
    def host_lost(self) -> int:
        return int(self.metrics["frames"]["host_lost"])

    @property
    def retractions(self) -> int:
        return int(self.metrics["timing"]["retractions"])

    @property
    def lag_ms(self) -> float:
        """The largest, 0 if nothing was handled again."""
        return float(self.metrics["timing"]["lag_ms"]["max"] or 0)


def compared(plan: Plan, *speeds: float) -> list[Compared]:
    """The plan as processes at each of these speeds, one run after the other, against one run in virtual time."""
    with tempfile.TemporaryDirectory(prefix="pr-") as scratch:
        expected = _folder(Path(scratch) / "virtual")
        virtual = run_virtual(plan, expected, write=lambda folder: None).metrics
        results = []
        for i, speed in enumerate(speeds):
            folder = _folder(Path(scratch) / f"processes-{i}")
            real = run_processes(replace(plan, run=replace(plan.run, speed=speed)), folder, Quiet())
            found = [*real.complaints, *differences(folder, expected, 0.0)]
            found += [
                f"metrics.json: {part}.{name} is {value}, in virtual time {virtual[part].get(name)}"[:200]
                for part in ("frames", *SHARED)
                for name, value in real.metrics[part].items()
                if value != virtual[part].get(name)
            ]
            results.append(Compared(real.metrics, tuple(found)))
        return results


def in_time(plan: Plan, *speeds: float) -> Compared:
    """The plan as processes at the first of these speeds at which the machine keeps up, or else at the last."""
    for speed in speeds:
        (one,) = compared(plan, speed)
        if kept_up(one.metrics):
            break
    return one


def _folder(path: Path) -> Path:
    (path / "logs").mkdir(parents=True)
    return path


# --- a machine with other things to do --------------------------------------------------------------------------------


def _spin() -> None:
    while True:
        pass


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes that compute for nothing."""
    spinners = [get_context("spawn").Process(target=_spin, daemon=True) for _ in range(loops)]
    for spinner in spinners:
        spinner.start()
    try:
        yield
    finally:
        for spinner in spinners:
            spinner.kill()
            spinner.join()


class Stalls:
    """Stops a process of this program's runs for 50 ms, now and then, drawn from those with these names."""

    def __init__(self, names: set[str], seed: int) -> None:
        self._names, self._draw = names, Random(seed)
        self._done = Event()
        self.count = 0

    def __enter__(self) -> Stalls:
        self._thread = Thread(target=self._stall)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def _stall(self) -> None:
        while not self._done.wait(self._draw.uniform(0.2, 0.6)):
            if family := self._family():
                with suppress(psutil.Error):
                    self._stop(self._draw.choice(family))

    def _stop(self, process: psutil.Process) -> None:
        process.suspend()
        try:
            time.sleep(STALL_S)
        finally:
            process.resume()
        self.count += 1

    def _family(self) -> list[psutil.Process]:
        found = []
        for process in psutil.Process().children(recursive=True):
            with suppress(psutil.Error):
                title = (process.cmdline() or [""])[0].split()  # "trackfield", its role, its name
                if title[:1] == ["trackfield"] and title[-1] in self._names:
                    found.append(process)
        return found
