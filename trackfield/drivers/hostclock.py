"""The clock of a run on each of its hosts: the monotonic clock of the launcher's host.

Emulated time is bound to it. On another host it is the monotonic clock there and an offset, which is measured by
questions and answers (as in NTP, RFC 5905, section 8) and measured again every few seconds, as clocks drift.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

EXCHANGES: Final = 8
"""How often the launcher is asked for each reading."""
AGAIN_S: Final = 10.0
"""How often the offset is measured."""
DRIFT: Final = 1e-4
"""How much two clocks may drift apart, at most: 100 ppm."""
_BYTES: Final = 8


class Exchange(NamedTuple):
    """A question and its answer: left and came back by the clock here, heard and answered by the launcher's (ns)."""

    left_ns: int
    heard_ns: int
    answered_ns: int
    came_ns: int

    @property
    def offset_ns(self) -> int:
        """What is to be added to the clock here, if both ways took as long."""
        return ((self.heard_ns - self.left_ns) + (self.answered_ns - self.came_ns)) // 2

    @property
    def delay_ns(self) -> int:
        """How long both ways took together."""
        return (self.came_ns - self.left_ns) - (self.answered_ns - self.heard_ns)


class Reading(NamedTuple):
    """An offset (ns), which is off by ``uncertainty_ns`` at most, and when it was read by the clock here."""

    offset_ns: int
    uncertainty_ns: int
    read_ns: int

    def uncertain_ns(self, now_ns: int) -> int:
        """By how much it may be off by now."""
        return self.uncertainty_ns + round(DRIFT * (now_ns - self.read_ns))


def reading(exchanges: Iterable[Exchange]) -> Reading:
    """What these say: the fastest of them leaves the least room for error. Raises ``ValueError`` if there are none."""
    best = min(exchanges, key=lambda one: one.delay_ns)
    return Reading(best.offset_ns, max(best.delay_ns, 0) // 2, best.came_ns)


def better(old: Reading, new: Reading) -> Reading:
    """The one of both that is off by less, when the new one was read."""
    return new if new.uncertainty_ns <= old.uncertain_ns(new.read_ns) else old


class HostClock:
    """The run's clock here. Processes of one host share its offset by a ``file``, which one of them writes."""

    def __init__(self, file: Path | str = "") -> None:
        self._offset = _mapped(file) if file else memoryview(bytearray(_BYTES)).cast("q")

    def now_ns(self) -> int:
        """The time now (ns)."""
        return time.monotonic_ns() + self._offset[0]

    @property
    def offset_ns(self) -> int:
        """By how much the launcher's host is ahead of this one (ns)."""
        return self._offset[0]

    def set(self, offset_ns: int) -> None:
        """Correct the clock, for all that share it."""
        self._offset[0] = offset_ns


def host_id() -> str:
    """What processes have in common that have one monotonic clock; empty if this system does not tell."""
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot} {Path('/proc/self/ns/time').readlink()}"
    return ""


def _mapped(file: Path | str) -> memoryview:
    """The offset in this file, which is made if there is none: eight bytes that are read and written as one."""
    import mmap  # late: most processes have no other host's clock

    opened = os.open(file, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        os.ftruncate(opened, _BYTES)
        return memoryview(mmap.mmap(opened, _BYTES)).cast("q")
    finally:
        os.close(opened)
