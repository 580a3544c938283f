"""Those for whom frames are, found by medium and cell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.spec import ProcessSpec
from trackfield.role import NEIGHBOURHOOD


class Hearers:
    """Those for whom frames are among ``processes``, by id; who hears a process's broadcasts is looked up once."""

    def __init__(self, processes: Mapping[str, ProcessSpec]) -> None:
        self._processes = processes
        self._listeners: defaultdict[tuple[str, str], list[ProcessSpec]] = defaultdict(list)
        self._found: dict[tuple[str, str], Sequence[ProcessSpec]] = {}
        for process in processes.values():
            for medium in process.media:
                for cell in process.cells_in(medium):
                    self._listeners[medium, cell].append(process)

    def of(self, frame: Frame) -> Sequence[ProcessSpec]:
        """The processes for which a frame is, in the order of the run's."""
        if not frame.broadcast:
            one = self._processes.get(frame.to)
            return [one] if one is not None and one.hears(frame.medium, frame.to, frame.src, "") else []
        key = frame.src, frame.medium
        if key not in self._found:
            self._found[key] = self._broadcast(*key)
        return self._found[key]

    def _broadcast(self, src: str, medium: str) -> Sequence[ProcessSpec]:
        sender = self._processes.get(src)
        cell = sender.cell_in(medium) if sender else ""
        return [p for p in self._listeners[medium, cell] if p.hears(medium, NEIGHBOURHOOD, src, cell)]
