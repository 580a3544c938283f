"""Events that can be undone, and the outputs to send when they are handled again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from trackfield.drivers.frames import EventKey, Frame, Output, Refused, Sent, Told, Undone
from trackfield.drivers.life import Handled

Identity = tuple[Any, ...]


class History:
    """The latest events, as they were handled; ``forgotten`` is the key of the latest that is no longer here."""

    def __init__(self, forgotten: EventKey) -> None:
        self.forgotten = forgotten
        self._handled: deque[Handled] = deque()

    def add(self, handled: Handled, forget_ns: int) -> None:
        """Remember this one, and forget those as old as ``forget_ns``."""
        self._handled.append(handled)
        while self._handled and self._handled[0].key[0] <= forget_ns:
            self.forgotten = self._handled.popleft().key

    def since(self, key: EventKey) -> list[Handled]:
        """Remove and return all events handled from this key on, in order."""
        undone: list[Handled] = []
        while self._handled and self._handled[-1].key > key:
            undone.append(self._handled.pop())
        return undone[::-1]


def difference(
    old: list[Output], new: list[Output], since: EventKey, ghosts: set[Identity], recall: Callable[[Frame], bool]
) -> tuple[list[Output], bool]:
    """The outputs to send: new frames, and telemetry again if it changed; and whether anything left by mistake.

    ``old`` are the outputs of the first time, ``new`` those after all events from ``since`` on were handled again.
    ``recall`` withdraws a frame that should not have left, if it still can. A frame that cannot be withdrawn joins the
    ``ghosts``: an equal frame is not sent again.
    """
    left, again = _frames(old), _frames(new)
    vanished = [frame for frame in left if frame not in again]
    lost = {frame.identity for frame in vanished if not recall(frame)}
    ghosts |= lost
    known = {frame.identity for frame in left if frame in again} | ghosts
    out: list[Output] = [o for o in new if isinstance(o, Sent) and o.frame.identity not in known]
    told, retold = ([o for o in side if isinstance(o, Told | Refused)] for side in (old, new))
    if told != retold:
        out += [Undone(since), *retold]
    return out, bool(lost)


def _frames(outputs: Iterable[Output]) -> list[Frame]:
    return [o.frame for o in outputs if isinstance(o, Sent)]
