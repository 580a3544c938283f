"""Device ports of a process: what comes in there, and the devices that may be there.

What is known beforehand, such as the record of a device, is input under both drivers, at its instants. A real device
takes part in runs as processes at speed 1; what it sends is stamped as it arrives, so such runs are not repeatable.
"""

from __future__ import annotations

import logging
import os
import time
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from operator import itemgetter
from threading import Thread
from typing import Any, Final, Self

from trackfield.drivers.engine.frames import EventKey, PortInput
from trackfield.role import Write

log = logging.getLogger(__name__)

HOLD_NS: Final = 100_000_000
"""By how much bytes reach a device later than they are written, unless its port says otherwise."""
AGAIN_S: Final = 1.0
"""How often a device that is not there is looked for."""
MOST: Final = 4096
"""Bytes that are read at a time."""


@dataclass(frozen=True, slots=True)
class Port:
    """A port: the ``reads`` are bytes that come in, and when (true time, ns).

    ``device`` is the path of a real one, such as a serial line. What is written to it leaves ``hold_ns`` (wall time)
    after its instant: until then it can still be taken back.
    """

    reads: tuple[tuple[int, bytes], ...] = ()
    device: str = ""
    hold_ns: int = HOLD_NS

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """From a mapping of its fields."""
        return cls(tuple((at_ns, data) for at_ns, data in plain["reads"]), plain["device"], plain["hold_ns"])


def inputs(ports: Mapping[str, Port]) -> Iterator[PortInput]:
    """What comes in at these ports, by their names, in order: at one instant by name, then as given."""
    read = ((at_ns, name, data) for name, port in ports.items() for at_ns, data in port.reads)
    reads = sorted(read, key=itemgetter(0, 1))
    return (PortInput(at_ns, number, name, data) for number, (at_ns, name, data) in enumerate(reads))


class Devices:
    """The devices at these ports; ``heard`` is called with a port and bytes, by a thread of the port's own."""

    def __init__(self, ports: Mapping[str, Port], heard: Callable[[str, bytes], None]) -> None:
        self._ports = {name: port for name, port in ports.items() if port.device}
        self._heard = heard
        self._files: dict[str, int] = {}
        self._held: list[tuple[int, EventKey, Write]] = []
        self._left: list[tuple[EventKey, Write]] = []
        self._doubtful: list[tuple[EventKey, Write]] = []
        self._opened = False

    def open(self) -> None:
        """From now on there are devices: until a process lives, they are those of the life before it."""
        if not self._opened:
            self._opened = True
            for name in self._ports:
                Thread(target=self._read, args=(name,), name=name, daemon=True).start()

    def write(self, key: EventKey, write: Write, wall_ns: int) -> None:
        """Hold bytes that an event wrote, whose instant is ``wall_ns``; if they have left already, they stay."""
        if write.port not in self._ports:
            return
        if (key, write) in self._doubtful:
            self._doubtful.remove((key, write))
            self._left.append((key, write))
        else:
            self._held.append((wall_ns + self._ports[write.port].hold_ns, key, write))

    def undo(self, since: EventKey) -> None:
        """Take back what events from this one on wrote; what has left is in doubt until it is written again."""
        self._held = [held for held in self._held if held[1] < since]
        self._doubtful += [left for left in self._left if left[0] >= since]
        self._left = [left for left in self._left if left[0] < since]

    def mistaken(self, until_ns: int) -> int:
        """How often something has left that events before this time (true) did not write after all."""
        doubtful = [left for left in self._doubtful if left[0][0] >= until_ns]
        count, self._doubtful = len(self._doubtful) - len(doubtful), doubtful
        return count

    def next_ns(self, never: int) -> int:
        """When (wall time) the next bytes leave."""
        return min((held[0] for held in self._held), default=never)

    def release(self, now_ns: int, forgotten_ns: int) -> None:
        """Give devices what leaves by now; forget what was written before ``forgotten_ns`` (true)."""
        leaving = [held for held in self._held if held[0] <= now_ns]
        if not leaving:
            return
        self._held = [held for held in self._held if held[0] > now_ns]
        for _, key, write in leaving:
            self._left.append((key, write))
            self._give(write)
        self._left = [left for left in self._left if left[0][0] >= forgotten_ns]

    def _give(self, write: Write) -> None:
        try:
            data = write.data
            while data:
                data = data[os.write(self._files[write.port], data) :]
        except (OSError, LookupError):
            log.warning("port %s lost %d bytes: its device is not there", write.port, len(write.data))

    def _read(self, name: str) -> None:
        """Hand on what a device sends, and wait for it whenever it is not there."""
        while True:
            with suppress(OSError):
                file = os.open(self._ports[name].device, os.O_RDWR | os.O_NOCTTY)
                try:
                    if os.isatty(file):
                        tty.setraw(file)
                    self._files[name] = file
                    while data := os.read(file, MOST):
                        self._heard(name, data)
                finally:
                    self._files.pop(name, None)
                    os.close(file)
            time.sleep(AGAIN_S)
