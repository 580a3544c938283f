"""What a run's router refused, told to its launcher: asked for now and then, and before the run is ended.

A router has no seal. By its own rules nobody else may ask there, and nobody else may answer.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from threading import Lock
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.exchange.intake import read, unpacked
from trackfield.wire import keys
from trackfield.wire.error import WireError

ASK_S: Final = 1.0
"""How often it is asked. What a router counted since is lost with it if it is killed."""
ANSWER_S: Final = 5.0
LIMIT: Final = 1 << 20
NOBODY: Final = "no certificate"
"""In place of a certificate, of connections that were refused."""
SECOND: Final = "second session"

Attempts = Mapping[str, Mapping[str, int]]
"""How often the holder of each certificate tried what was refused, by kind."""


def totals(attempts: Attempts) -> dict[str, int]:
    """The keys of ``interference`` to which they count."""
    counts = {"denied": 0, "handshakes": 0, "sessions": 0}
    for name, kinds in attempts.items():
        for kind, n in kinds.items():
            counts["handshakes" if name == NOBODY else "sessions" if kind == SECOND else "denied"] += n
    return counts


class Asking:
    """Asks the router of a run; ``attempts`` are those that it told of, or that routers before it had told of."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._told: dict[str, Attempts] = {}
        self._lock = Lock()
        self._ask_at = 0.0

    @property
    def attempts(self) -> dict[str, dict[str, int]]:
        """Of all routers that the run has had."""
        found: dict[str, Counter[str]] = {}
        with self._lock:
            for told in self._told.values():
                for name, kinds in told.items():
                    found.setdefault(name, Counter()).update(kinds)
        return {name: dict(sorted(found[name].items())) for name in sorted(found)}

    def look(self) -> None:
        """To be called often."""
        if time.monotonic() > self._ask_at:
            self._ask_at = time.monotonic() + ASK_S
            self._session.get(keys.ATTEMPTS, Callback(self._take, indirect=False), timeout=ANSWER_S)

    def finish(self) -> None:
        """Ask once more, and wait for the answer."""
        for reply in self._session.get(keys.ATTEMPTS, timeout=ANSWER_S):
            self._take(reply)

    def _take(self, reply: zenoh.Reply) -> None:
        with suppress(WireError):
            if reply.ok is not None and reply.replier_id is not None:
                told = read(lambda data: dict(_told(unpacked(data, LIMIT))), reply.ok.payload.to_bytes())
                with self._lock:
                    self._told[str(reply.replier_id.zid)] = told


def pack(attempts: Attempts) -> bytes:
    """The answer of a router."""
    packed: bytes = msgpack.packb(attempts)
    return packed


def _told(answer: Any) -> Iterator[tuple[str, dict[str, int]]]:
    for name, kinds in answer.items():
        yield str(name), {str(kind): int(n) for kind, n in kinds.items()}
