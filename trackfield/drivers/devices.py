"""The real devices at the ports of a process: opened, waited for, read and written.

Each has a thread of its own, so that none can hold up the process: a device may be missing, be unplugged and come back,
or take no more bytes. What is written meanwhile is lost, counted, and told in the log.
"""

from __future__ import annotations

import logging
import os
import select
import termios
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from errno import EEXIST, EIO
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Final

from trackfield.drivers.engine.frames import EventKey
from trackfield.drivers.ports import PTY, Port
from trackfield.role import Write

log = logging.getLogger(__name__)

AGAIN_S: Final = 0.25
"""How often a device that is not there is looked for."""
MOST: Final = 4096
"""Bytes that are read at a time."""
MOST_WAITING: Final = 65_536
"""Bytes that wait for a device; further ones are lost."""
DRAIN_S: Final = 1.0
"""How long a process that ends waits for a device to take what waits."""
GONE: Final = select.POLLHUP | select.POLLERR | select.POLLNVAL
FAILURES: Final = (OSError, ValueError, termios.error)
"""What a device that cannot be used raises; ``ValueError``: a baud rate that it does not have."""


class Devices:
    """The devices at these ports; ``heard`` is called with a port and bytes, by a thread of the port's own."""

    def __init__(self, ports: Mapping[str, Port], heard: Callable[[str, bytes], None]) -> None:
        self._ports = {name: port for name, port in ports.items() if port.device}
        self._devices = {name: Device(name, port, heard) for name, port in self._ports.items()}
        self._held: list[tuple[int, EventKey, Write]] = []
        self._left: list[tuple[EventKey, Write]] = []
        self._doubtful: list[tuple[EventKey, Write]] = []
        self._opened = False

    @property
    def lost(self) -> int:
        """How often bytes were written that no device got, or not all of them."""
        return sum(device.lost for device in self._devices.values())

    @property
    def there(self) -> bool:
        """Whether all of them are there."""
        return all(device.there for device in self._devices.values())

    def open(self) -> None:
        """From now on there are devices: until a process lives, they are those of the life before it."""
        if not self._opened:
            self._opened = True
            for device in self._devices.values():
                device.start()

    def close(self) -> None:
        """Wait, for a while, until all have taken what waits for them, and close them."""
        until = time.monotonic() + DRAIN_S
        for device in self._devices.values():
            device.finish(until)

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
            self._devices[write.port].give(write.data)
        self._left = [left for left in self._left if left[0][0] >= forgotten_ns]


class Device:
    """The device at one port. ``lost`` counts what it was given in vain, ``there`` says whether it is there."""

    def __init__(self, name: str, port: Port, heard: Callable[[str, bytes], None]) -> None:
        self._name, self._port, self._heard = name, port, heard
        self._link = Path(port.device.removeprefix(PTY)) if port.device.startswith(PTY) else None
        self._pty: tuple[int, str] | None = None
        self._waiting: deque[bytes] = deque()
        self._lock, self._over = Lock(), Event()
        self._thread = Thread(target=self._serve, name=name, daemon=True)
        self._said = ""
        self._woken, self._wake = os.pipe()
        os.set_blocking(self._wake, False)
        self._losing = False
        self.there, self.lost = False, 0

    def start(self) -> None:
        """Look for it from now on."""
        self._thread.start()

    def give(self, data: bytes) -> None:
        """Write these bytes as soon as it takes them; if it is not there, or too much waits already, they are lost."""
        with self._lock:
            if not self.there or len(data) + sum(map(len, self._waiting)) > MOST_WAITING:
                self._lose(data)
                return
            self._waiting.append(data)
            self._losing = False
        self._rouse()

    def finish(self, until: float) -> None:
        """Wait until it has taken what waits, not beyond this time (monotonic, s), and leave it to others."""
        while self._waiting and time.monotonic() < until:
            time.sleep(0.01)
        self._over.set()
        self._rouse()
        if self._thread.is_alive():
            self._thread.join(DRAIN_S)
        while self._waiting:
            self._lose(self._waiting.popleft())
        if self.lost:
            log.warning("port %s: its device missed %d of what was written", self._name, self.lost)
        if self._link is not None and self._pty is not None:
            with suppress(OSError):
                if self._link.readlink() == Path(self._pty[1]):  # and not that of the next life
                    self._link.unlink()

    def _rouse(self) -> None:
        with suppress(BlockingIOError):  # then it is awake
            os.write(self._wake, b".")

    def _lose(self, data: bytes) -> None:
        self.lost += 1
        if not self._losing:  # of many in a row, the log has the first
            self._losing = True
            why = "takes no more" if self.there else "is not there"
            log.warning("port %s lost %d bytes, and what follows: its device %s", self._name, len(data), why)

    def _serve(self) -> None:
        """Talk with the device whenever it is there."""
        while not self._over.is_set():
            why = "it was closed"
            try:
                with self._open() as file:
                    self._tell(there=True, said="is there")
                    self._talk(file)
            except FAILURES as error:
                why = getattr(error, "strerror", None) or str(error)
            if not self._over.is_set():
                self._tell(there=False, said=f"is not there, and waited for ({why})")
                self._over.wait(AGAIN_S)

    @contextmanager
    def _open(self) -> Iterator[int]:
        """The file of the device. Raises one of ``FAILURES`` if it is not there."""
        if self._link is None:
            with _opened(self._port) as file:
                yield file
            return
        if self._pty is None:
            self._pty = _made_pty(self._link)
        if not _in_use(self._pty[0]):
            raise OSError(EIO, "nobody has it open")
        yield self._pty[0]

    def _tell(self, *, there: bool, said: str) -> None:
        """Whether it is there from now on; what waited for it is lost."""
        with self._lock:
            while self._waiting:
                self._lose(self._waiting.popleft())
            self.there = there
        if said != self._said and not self._port.terminal:  # people come and go
            self._said = said
            log.warning("port %s: %s %s", self._name, self._port.device, said)

    def _talk(self, file: int) -> None:
        """Hand on what comes, and write what waits; raises ``OSError`` when the device is gone."""
        poll = select.poll()
        poll.register(self._woken, select.POLLIN)
        while not self._over.is_set():
            poll.register(file, select.POLLIN | (select.POLLOUT if self._waiting else 0))
            found = dict(poll.poll())
            if self._woken in found:
                os.read(self._woken, MOST)
            events = found.get(file, 0)
            if events & select.POLLIN:
                if not (data := os.read(file, MOST)):
                    return
                self._heard(self._name, data)
            elif events & GONE:
                raise OSError(EIO, "unplugged")
            if events & select.POLLOUT:
                self._push(file)

    def _push(self, file: int) -> None:
        """Write as much of what waits as it takes now."""
        with self._lock, suppress(BlockingIOError):
            written = os.write(file, self._waiting[0])
            if rest := self._waiting.popleft()[written:]:
                self._waiting.appendleft(rest)


@contextmanager
def _opened(port: Port) -> Iterator[int]:
    """The file of a device: a terminal raw, with its baud rate, and for this process alone; any other as it is."""
    file = os.open(port.device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        if os.isatty(file):
            from serial import Serial  # here alone: few processes have a device

            with Serial(port.device, port.baud, timeout=0, exclusive=True) as line:
                yield line.fileno()
        else:
            yield file
    finally:
        os.close(file)


def _made_pty(link: Path) -> tuple[int, str]:
    """A pseudo-terminal: the file of this end, and the path of the other, to which ``link`` leads from now on.

    Raises ``OSError`` if it cannot lead there, as something else has that name.
    """
    file, other = os.openpty()
    try:
        tty.setraw(other)
        path = os.ttyname(other)
        os.set_blocking(file, False)
        if link.exists() and not link.is_symlink():
            raise FileExistsError(EEXIST, os.strerror(EEXIST), str(link))
        new = link.with_name(f".{link.name}.{os.getpid()}")
        new.symlink_to(path)
        new.replace(link)
    except OSError:
        os.close(file)
        raise
    finally:
        os.close(other)
    return file, path


def _in_use(file: int) -> bool:
    """Whether somebody has the other end of this pseudo-terminal open."""
    poll = select.poll()
    poll.register(file, select.POLLIN)
    return not any(events & GONE for _, events in poll.poll(0))
