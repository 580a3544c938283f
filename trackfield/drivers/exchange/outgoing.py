"""The frames of a process on their way out: put when they leave, and taken back if they should not have left."""

from __future__ import annotations

from bisect import insort
from collections import Counter
from collections.abc import Callable
from operator import itemgetter

from trackfield.drivers.engine.frames import Frame, Identity
from trackfield.drivers.exchange.versions import Digest
from trackfield.link.fate import FIELD

Put = Callable[[Frame, int], None]
"""Puts this version of a frame; without a payload it is taken back."""


class Outgoing:
    """Frames that wait for their radio, and the latest version of those that left.

    ``live`` are the frames that left and hold, ``seq`` counts puts, ``puts`` them by the id that they are for (of
    broadcasts ``NEIGHBOURHOOD``, followed by the medium unless it is the field), ``retractions`` those that took a
    frame back or replaced it.
    """

    def __init__(self, put: Put) -> None:
        self._put = put
        self.live = Digest()
        self.puts: Counter[str] = Counter()
        self.seq = self.retractions = 0
        self._queue: list[tuple[int, Frame]] = []
        self._left: dict[Identity, tuple[int, Frame]] = {}

    def send(self, frame: Frame, leaves_ns: int, now_ns: int) -> None:
        """Put a frame at ``leaves_ns`` (wall time): one that waits for the radio is not there yet."""
        self._recall(frame)
        if leaves_ns > now_ns:
            insort(self._queue, (leaves_ns, frame), key=itemgetter(0))
        else:
            self._leave(frame)

    def take_back(self, frame: Frame) -> None:
        """Take back a frame that was sent; nobody knows of one that has not left."""
        if not self._recall(frame) and frame.identity in self._left:
            self._leave(frame.taken_back)

    def release(self, now_ns: int) -> bool:
        """Put the next frame that leaves by now; whether there was one."""
        if not self._queue or self._queue[0][0] > now_ns:
            return False
        self._leave(self._queue.pop(0)[1])
        return True

    def next_ns(self, never: int) -> int:
        """When (wall time) the next frame leaves."""
        return self._queue[0][0] if self._queue else never

    def flush(self) -> None:
        """Put all that waits: the process ends."""
        while self._queue:
            self._leave(self._queue.pop(0)[1])

    def forget(self, until_ns: int) -> None:
        """Forget frames that were sent before this true time, which cannot be taken back any more."""
        while self._left:
            oldest = next(iter(self._left))
            if self._left[oldest][1].sent_ns >= until_ns:
                return
            del self._left[oldest]

    def _recall(self, frame: Frame) -> bool:
        """Withdraw a frame that still waits."""
        kept = [entry for entry in self._queue if entry[1].identity != frame.identity]
        found, self._queue = len(kept) < len(self._queue), kept
        return found

    def _leave(self, frame: Frame) -> None:
        version, before = self._left.pop(frame.identity, (-1, frame))
        if version >= 0:
            self.retractions += 1
            if before.payload:
                self.live = self.live.minus(before, version)
        version += 1
        if frame.payload:
            self.live = self.live.plus(frame, version)
        self._left[frame.identity] = version, frame
        self.puts[_address(frame)] += 1
        self._put(frame, version)
        self.seq += 1


def _address(frame: Frame) -> str:
    return f"{frame.to}{frame.medium}" if frame.broadcast and frame.medium != FIELD else frame.to
