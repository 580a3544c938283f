"""Events that can be undone, and what to send and to take back when they are handled again."""

from __future__ import annotations

from collections import deque
from itertools import islice, takewhile
from typing import Final

from trackfield.drivers.engine.frames import (
    RANK_FAULT,
    Arrival,
    EventKey,
    Frame,
    Identity,
    Output,
    Refused,
    Sent,
    TakenBack,
    Told,
    Undone,
)
from trackfield.drivers.engine.life import Handled

EVENT_BYTES: Final = 2_000
"""About what an event costs without its payloads: its snapshot shares most of what it holds with that before it."""
MAX_BYTES: Final = 64 * 2**20
"""How much of the past is kept."""


class History:
    """The latest events, as they were handled; ``forgotten`` is the key of the latest that is no longer here."""

    __slots__ = ("_bytes", "_handled", "forgotten", "max_bytes")

    def __init__(self, forgotten: EventKey, max_bytes: int = MAX_BYTES) -> None:
        self.forgotten, self.max_bytes = forgotten, max_bytes
        self._handled: deque[Handled] = deque()
        self._bytes = 0

    def add(self, handled: Handled, forget_ns: int, keep: EventKey | None = None) -> None:
        """Remember this one, and forget those as old as ``forget_ns``, and more if they are too many.

        Those from ``keep`` on are needed.
        """
        if not self._handled and handled.key[0] <= forget_ns and keep is None:
            self.forgotten = max(self.forgotten, handled.key)
            return
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

    def from_instant(self, t_ns: int) -> list[Handled]:
        """The events handled at this time (true) or later, in order."""
        return list(takewhile(lambda handled: handled.key[0] >= t_ns, reversed(self._handled)))[::-1]

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


class Former:
    """What undone events had put out, until they are handled again: it holds unless they put out something else."""

    def __init__(self) -> None:
        self._frames: dict[Identity, tuple[int, Frame]] = {}
        self._told: deque[Told | Refused] = deque()

    def __bool__(self) -> bool:
        return bool(self._frames or self._told)

    def add(self, undone: list[Handled]) -> None:
        """These events are undone: they came before those that were undone earlier and not handled again yet."""
        frames = {o.frame.identity: (h.key[0], o.frame) for h in undone for o in h.outputs if isinstance(o, Sent)}
        self._frames = frames | self._frames
        self._told.extendleft(reversed([output for handled in undone for output in told(handled)]))

    def compared(self, outputs: list[Output], history: History) -> list[Output]:
        """Of the outputs of an event, those that are news; it is in the history already."""
        out: list[Output] = [o for o in outputs if isinstance(o, Sent) and self._is_news(o.frame)]
        telling = [o for o in outputs if isinstance(o, Told | Refused)]
        if not self._told:
            return out + telling
        if telling == list(islice(self._told, len(telling))):
            for _ in telling:
                self._told.popleft()
            return out
        return out + self._retold(telling[0].key[0], history)

    def passed(self, next_ns: int | None, history: History) -> list[Output]:
        """What is no longer true, as nothing happens before ``next_ns`` (None: at all) that is not in the history."""
        gone = list(takewhile(lambda one: next_ns is None or one[0] < next_ns, self._frames.values()))
        out: list[Output] = [TakenBack(frame) for _, frame in gone]
        for _, frame in gone:
            del self._frames[frame.identity]
        if self._told and (next_ns is None or self._told[0].key[0] < next_ns):
            out += self._retold(self._told[0].key[0], history)
        return out

    def _is_news(self, frame: Frame) -> bool:
        return self._frames.pop(frame.identity, (0, None))[1] != frame

    def _retold(self, since_ns: int, history: History) -> list[Output]:
        """Telemetry anew from this instant on: keys at one instant are in no order."""
        self._told.clear()
        again = [output for handled in history.from_instant(since_ns) for output in told(handled)]
        return [Undone((since_ns, RANK_FAULT, "")), *again]


def told(handled: Handled) -> list[Told | Refused]:
    """The telemetry of an event."""
    return [output for output in handled.outputs if isinstance(output, Told | Refused)]
