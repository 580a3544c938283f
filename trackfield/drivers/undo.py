"""Events that can be undone, and the outputs to send when they are handled again."""

from __future__ import annotations

from collections import deque
from typing import Final

from trackfield.drivers.frames import Arrival, EventKey, Frame, Identity, Output, Refused, Sent, TakenBack, Told, Undone
from trackfield.drivers.life import Handled

EVENT_BYTES: Final = 2_000
"""About what an event costs without its payloads: its snapshot shares most of what it holds with that before it."""
MAX_BYTES: Final = 64 * 2**20
"""How much of the past is kept."""


class History:
    """The latest events, as they were handled; ``forgotten`` is the key of the latest that is no longer here."""

    def __init__(self, forgotten: EventKey, max_bytes: int = MAX_BYTES) -> None:
        self.forgotten, self.max_bytes = forgotten, max_bytes
        self._handled: deque[Handled] = deque()
        self._bytes = 0

    def add(self, handled: Handled, forget_ns: int, keep: EventKey | None = None) -> None:
        """Remember this one, and forget those as old as ``forget_ns``, and more if they are too many.

        Those from ``keep`` on are needed.
        """
        self._handled.append(handled)
        self._bytes += _weight(handled)
        while (self._handled[0].key[0] <= forget_ns or self._bytes > self.max_bytes) and not (
            keep is not None and self._handled[0].key >= keep
        ):
            oldest = self._handled.popleft()
            self.forgotten = max(self.forgotten, oldest.key)
            self._bytes -= _weight(oldest)
            if not self._handled:
                return

    def since(self, key: EventKey) -> list[Handled]:
        """Remove and return all events handled from this key on, in order."""
        undone: list[Handled] = []
        while self._handled and self._handled[-1].key >= key:
            undone.append(self._handled.pop())
            self._bytes -= _weight(undone[-1])
        return undone[::-1]


def _weight(handled: Handled) -> int:
    frames = [output.frame for output in handled.outputs if isinstance(output, Sent)]
    if isinstance(handled.input, Arrival):
        frames.append(handled.input.frame)
    return EVENT_BYTES + sum(len(frame.payload) for frame in frames)


def difference(old: list[Output], new: list[Output], since: EventKey) -> list[Output]:
    """What to send: frames to take back, frames that are new or changed, and telemetry again if it changed.

    ``old`` are the outputs of the first time, ``new`` those after all events from ``since`` on were handled again.
    """
    left, again = _frames(old), _frames(new)
    out: list[Output] = [TakenBack(frame) for identity, frame in left.items() if identity not in again]
    out += [o for o in new if isinstance(o, Sent) and left.get(o.frame.identity) != o.frame]
    told, retold = ([o for o in side if isinstance(o, Told | Refused)] for side in (old, new))
    if told != retold:
        out += [Undone(since), *retold]
    return out


def _frames(outputs: list[Output]) -> dict[Identity, Frame]:
    return {o.frame.identity: o.frame for o in outputs if isinstance(o, Sent)}
