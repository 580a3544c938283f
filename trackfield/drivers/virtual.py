"""The virtual driver: every process of a run in one heap of due events, as fast as it goes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from heapq import heapify, heappop, heappush
from typing import Protocol

from trackfield.drivers.core import Core
from trackfield.drivers.frames import Arrival, EventKey, Frame, Output, Refused, Sent, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, places_of
from trackfield.link.models import make_link
from trackfield.role import IllegalEvent


class Sink(Protocol):
    """Who listens to all of a run: the ledger."""

    def sent(self, frame: Frame) -> None:
        """A frame left."""

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        """A process told something."""


class Virtual:
    """A run in virtual time.

    ``cores`` holds the engine of each process by id; ``run`` feeds ``sink`` and returns when nothing is due before
    the end. Frames travel as encoded bytes through the same link as under the process driver.
    """

    def __init__(self, run: RunSpec, processes: Sequence[ProcessSpec], sink: Sink) -> None:
        self.spec, self.sink = run, sink
        self.cores = {p.id: build_core(run, p) for p in processes}
        self._processes = {p.id: p for p in processes}
        self._listeners = [p for p in processes if p.cells]
        self._link = make_link(run.link, run.seed, places_of(processes))
        self._due: list[tuple[EventKey, str]] = []
        self.now_ns = 0

    def run(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Handle every event before the end; ``stop()`` is asked before each and ends the run early."""
        self._due = [(key, id) for id, core in self.cores.items() if (key := core.next_key()) is not None]
        heapify(self._due)
        end = (self.spec.end_ns,)
        while self._due and self._due[0][0] < end and not stop():
            key, id = heappop(self._due)
            self.now_ns = key[0]
            core = self.cores[id]
            if core.next_key() != key:
                continue  # something earlier came in between; that has an entry of its own
            outputs = core.handle_next()
            self._schedule(id, core)
            self._release(id, outputs)

    def _schedule(self, id: str, core: Core) -> None:
        if (key := core.next_key()) is not None:
            heappush(self._due, (key, id))

    def _release(self, id: str, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Sent):
                self.sink.sent(output.frame)
                self._transmit(output.frame)
            elif isinstance(output, Told | Refused | Undone):
                self.sink.told(id, output)

    def _transmit(self, frame: Frame) -> None:
        to, cell = frame.addresses, self._processes[frame.src].cell
        hearers = self._listeners if to is None else [self._processes[id] for id in to if id in self._processes]
        for hearer in hearers:
            if hearer.hears(frame.medium, to, frame.src, cell):
                self._deliver(hearer.id, frame)

    def _deliver(self, hearer: str, frame: Frame) -> None:
        fate = frame.fate(self._link, hearer)
        if fate.cause is None:
            core = self.cores[hearer]
            core.offer(Arrival(frame.sent_ns + fate.delay_ns, frame))
            if core.behind:
                raise IllegalEvent(f"a link delivered {frame.identity} before it was sent")
            self._schedule(hearer, core)
