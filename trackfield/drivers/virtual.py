"""The virtual driver: every process of a run in one heap of due events, as fast as it goes."""

from __future__ import annotations

import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from heapq import heapify, heappop, heappush
from pathlib import Path
from typing import Any, Final, Protocol

from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, EventKey, Frame, Output, Refused, Sent, Told, Undone
from trackfield.drivers.engine.meter import spent
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, link_of, places_of
from trackfield.errors import RunFailed
from trackfield.role import NS, IllegalEvent

HEARD: Final = ("delivered", "asleep", "frozen")
"""What becomes of frames that come to a process."""


class Sink(Protocol):
    """The receiver of everything that happens in a run: the ledger."""

    def sent(self, frame: Frame) -> None:
        """A frame left."""

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        """A process sent telemetry."""

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        """A process's final record."""


class Virtual:
    """A run in virtual time.

    Raises ``RunFailed`` for a frame to a process that does not have its sender as a peer, and if a role fails.

    ``cores`` holds the engine of each life by its name; ``run`` feeds ``sink`` and returns when nothing is due before
    ``end_ns``. ``now_ns`` is the time. Frames travel as encoded bytes through the same link as under the process
    driver.
    """

    def __init__(self, run: RunSpec, processes: Sequence[ProcessSpec], sink: Sink) -> None:
        self.sink = sink
        self._link = link_of(run, places_of(processes))
        self.cores = {p.name: build_core(run, p, self._link) for p in processes}
        self._processes = {p.id: p for p in processes}
        self._lives: defaultdict[str, list[str]] = defaultdict(list)
        for p in sorted(processes, key=lambda p: p.incarnation):
            self._lives[p.id].append(p.name)
        self._listeners = [p for p in self._processes.values() if p.cells]
        self._due: list[tuple[EventKey, str]] = []
        self.end_ns, self.now_ns = run.end_ns, 0

    def run(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Handle every event before the end; ``stop()`` is asked before each and ends the run early."""
        self._due = [(key, name) for name, core in self.cores.items() if (key := core.next_key()) is not None]
        heapify(self._due)
        while self._due and self._due[0][0] < (self.end_ns,):
            key, name = heappop(self._due)
            if stop():
                self.end_ns = key[0]
                break
            self.now_ns = key[0]
            core = self.cores[name]
            if core.next_key() != key:
                continue  # an earlier event was added meanwhile, with an entry of its own
            if not core.life.started:
                self._inherit(core)
            outputs = self._handle_next(core)
            self._schedule(name, core)
            self._release(name, outputs)
        for name, core in self.cores.items():
            waits = sum(isinstance(one, Arrival) and one.due_ns < self.end_ns for one in core.waiting())
            got = sum(core.tally.get(outcome, 0) for outcome in HEARD) + waits
            self.sink.final(name, core.record(self.end_ns) | {"heard": got})

    def _handle_next(self, core: Core) -> list[Output]:
        try:
            return core.handle_next()
        except RunFailed:
            raise
        except Exception as error:  # a user's role may raise anything
            at = traceback.extract_tb(error.__traceback__)[-1]
            process = self._processes[core.owner]
            what = f"{core.owner} (role {process.role}) failed {self.now_ns / NS:.3f} s after the start of the run"
            where = "; ".join((f"{Path(at.filename).name}, line {at.lineno}", *getattr(error, "__notes__", ())))
            raise RunFailed(f"{what}: {type(error).__name__}: {error} ({where})", process=core.owner) from error

    def _inherit(self, core: Core) -> None:
        """Give a life what the one before it stored last."""
        if core.incarnation:
            before = self.cores[self._lives[core.owner][core.incarnation - 1]]
            core.inherit(before.life.stored, spent(before.record(self.end_ns)))

    def _schedule(self, name: str, core: Core) -> None:
        if (key := core.next_key()) is not None:
            heappush(self._due, (key, name))

    def _release(self, name: str, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Sent):
                self.sink.sent(output.frame)
                self._transmit(output.frame)
            elif isinstance(output, Told | Refused | Undone):
                self.sink.told(name, output)

    def _transmit(self, frame: Frame) -> None:
        cell = self._processes[frame.src].cell
        for hearer in self._listeners if frame.broadcast else [self._processes.get(frame.to)]:
            if hearer is not None and hearer.hears(frame.medium, frame.to, frame.src, cell):
                if hearer.peers and not frame.broadcast and frame.src not in hearer.peers:
                    what = f"{frame.src} sent {frame.kind} to {frame.to}, to which it sends nothing by the plan"
                    raise RunFailed(what, process=frame.src)
                self._deliver(hearer.id, frame)

    def _deliver(self, hearer: str, frame: Frame) -> None:
        fate = frame.fate(self._link, hearer)
        if fate.cause is not None:
            return
        due = frame.sent_ns + fate.delay_ns
        if due <= self.now_ns:
            raise IllegalEvent(f"a link delivered {frame.identity} before it was sent")
        for name in self._lives[hearer]:
            core = self.cores[name]
            if core.owns(due):
                core.offer(Arrival(due, frame, fate))
                self._schedule(name, core)
