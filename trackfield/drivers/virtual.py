"""The virtual driver: every process of a run in one heap of due events, as fast as it goes."""

from __future__ import annotations

import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from pathlib import Path
from typing import Any, Final, Protocol

from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import RANK_FRAME, Arrival, EventKey, Frame, Output, Refused, Sent, Told, Undone
from trackfield.drivers.engine.meter import spent
from trackfield.drivers.hearers import Hearers
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, life_name, link_of
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


class _Seat:
    """A life: its ``core``, its ``place`` among all by name, and what of it is ``entered`` in the heap, but frames."""

    __slots__ = ("core", "entered", "place")

    def __init__(self, core: Core, place: int) -> None:
        self.core, self.place = core, place
        self.entered: list[EventKey] = []


Entry = tuple[EventKey, int, Sequence[tuple[Sequence[_Seat], Arrival | None]]]
"""What is due, the place of the first for whom it is, and by their places the lives of all of them with what arrives
there; None for an event of their own.
"""


class Virtual:
    """A run in virtual time.

    Raises ``RunFailed`` for a frame to a process that does not have its sender as a peer, and if a role fails.

    ``cores`` holds the engine of each life by its name; ``run`` feeds ``sink`` and returns when nothing is due before
    ``end_ns``. ``now_ns`` is the time. Frames travel as encoded bytes through the same link as under the process
    driver.
    """

    def __init__(self, run: RunSpec, processes: Sequence[ProcessSpec], sink: Sink) -> None:
        self.sink = sink
        self._link = link_of(run, processes)
        self.cores = {p.name: build_core(run, p, self._link) for p in processes}
        self._processes = {p.id: p for p in processes}
        seats = {name: _Seat(self.cores[name], place) for place, name in enumerate(sorted(self.cores))}
        self._lives: defaultdict[str, list[_Seat]] = defaultdict(list)
        for p in sorted(processes, key=lambda p: p.incarnation):
            self._lives[p.id].append(seats[p.name])
        self._hearers = Hearers(self._processes)
        self._due: list[Entry] = []
        self.end_ns, self.now_ns = run.end_ns, 0

    def run(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Handle every event before the end; ``stop()`` is asked before each and ends the run early."""
        for seats in self._lives.values():
            for seat in seats:
                self._schedule(seat)
        for key, seat, arrival in self._coming():
            if stop():
                self.end_ns = key[0]
                break
            core = seat.core
            if arrival is not None:
                core.offer(arrival)
            elif key in seat.entered:
                seat.entered.remove(key)
            if core.next_key() != key:
                continue  # it is no more
            self.now_ns = key[0]
            if not core.life.started:
                self._inherit(core)
            outputs = self._handle_next(core, key)
            self._schedule(seat)
            self._release(core, outputs)
        for name, core in self.cores.items():
            waits = sum(isinstance(one, Arrival) and one.due_ns < self.end_ns for one in core.waiting())
            got = sum(core.tally.get(outcome, 0) for outcome in HEARD) + waits
            self.sink.final(name, core.record(self.end_ns) | {"heard": got})

    def _coming(self) -> Iterator[tuple[EventKey, _Seat, Arrival | None]]:
        """What is due before the end, in order, and for whom; a frame comes to the life that owns its instant."""
        while self._due and self._due[0][0] < (self.end_ns,):
            key, _, each = heappop(self._due)
            for seats, arrival in each:
                for seat in seats:
                    if arrival is None or seat.core.owns(key[0]):
                        yield key, seat, arrival

    def _handle_next(self, core: Core, key: EventKey) -> list[Output]:
        try:
            return core.handle_next(key)
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
            before = self._lives[core.owner][core.incarnation - 1].core
            core.inherit(before.life.stored, spent(before.record(self.end_ns)))

    def _schedule(self, seat: _Seat) -> None:
        """Enter its next event, unless that is there already, as all frames are."""
        key = seat.core.next_key()
        if key is not None and key[1] != RANK_FRAME and key not in seat.entered:
            seat.entered.append(key)
            heappush(self._due, (key, seat.place, (((seat,), None),)))

    def _release(self, core: Core, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Sent):
                self.sink.sent(output.frame)
                self._transmit(output.frame)
            elif isinstance(output, Told | Refused | Undone):
                self.sink.told(life_name(core.owner, core.incarnation), output)

    def _transmit(self, frame: Frame) -> None:
        """Those whom it reaches at the same instant get it one after the other."""
        reached: defaultdict[int, list[tuple[Sequence[_Seat], Arrival]]] = defaultdict(list)
        for hearer in self._hearers.of(frame):
            if hearer.peers and not frame.broadcast and frame.src not in hearer.peers:
                what = f"{frame.src} sent {frame.kind} to {frame.to}, to which it sends nothing by the plan"
                raise RunFailed(what, process=frame.src)
            fate = frame.fate(self._link, hearer.id)
            if fate.cause is not None:
                continue
            due = frame.sent_ns + fate.delay_ns
            if due <= self.now_ns:
                raise IllegalEvent(f"a link delivered {frame.identity} before it was sent")
            reached[due].append((self._lives[hearer.id], Arrival(due, frame, fate)))
        for due, each in reached.items():
            heappush(self._due, (frame.key(due), 0, each))
