"""The sessions of each certificate at a router: one at a time, unless its limits say how many."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from contextlib import suppress
from itertools import islice
from typing import Final

RUN, SESSIONS = "run", "sessions"
"""What the limits of a router tell its process, as metadata, of which Zenoh makes no use."""
GRACE_S: Final = 2.0
"""A router may notice so late (s) that a process has ended whose next one is there."""
REMEMBERED: Final = 1000
"""Of so many that are gone the names are kept: what they did may still be in the log."""


class Sessions:
    """Who is there, by the ids of sessions, and how often a certificate was used a second time meanwhile.

    A process that is started again may come before its router notices that the one before has gone: so a second session
    does not count if the first goes soon after. ``most`` says how many a certificate may have where that is not one
    (None: any number).
    """

    def __init__(self, most: Mapping[str, int | None]) -> None:
        self._counted: Counter[str] = Counter()
        self._most = most
        self._names: dict[str, str] = {}
        self._gone: deque[str] = deque()
        self._there: dict[str, dict[str, float]] = {}

    def certificate_of(self, session: str) -> str:
        """The common name of the certificate of a session that is or was there; empty for an unknown one."""
        return self._names.get(session, "")

    def came(self, session: str, name: str, now_s: float) -> None:
        """A session with the certificate of this ``name``, for the first time or again."""
        with suppress(ValueError):
            self._gone.remove(session)
        self._names[session] = name
        if self._most_of(name) is not None:
            self._there.setdefault(name, {}).setdefault(session, now_s)

    def went(self, session: str, name: str, now_s: float) -> None:
        """It is gone; of one that was there for a moment only, this may be the first word."""
        self._names.setdefault(session, name)
        there = self._there.get(name, {})
        self._gone.append(session)
        if len(self._gone) > REMEMBERED:
            self._names.pop(self._gone.popleft(), None)
        if session not in there:
            return
        most = self._most_of(name) or 0
        if session not in islice(there, most):
            self._counted[name] += 1
        else:  # the first that was one too many is none any more
            self._counted[name] += sum(now_s - since_s > GRACE_S for since_s in islice(there.values(), most, most + 1))
        del there[session]

    def so_far(self) -> Counter[str]:
        """How many of each certificate counted, and how many too many are there."""
        there = {name: len(sessions) - (self._most_of(name) or 0) for name, sessions in self._there.items()}
        return self._counted + Counter({name: n for name, n in there.items() if n > 0})

    def _most_of(self, name: str) -> int | None:
        return self._most.get(name, 1)
