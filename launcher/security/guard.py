"""How a secured router sees what it refuses: it reads its own log, and notes who connects."""

from __future__ import annotations

import fcntl
import json
import os
import select
import struct
import sys
import termios
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from threading import Lock, Thread
from typing import Final

import zenoh
from zenoh.handlers import Callback

from launcher.security.attempts import NOBODY, SECOND, pack
from launcher.security.denials import FILTER, Denials
from launcher.security.sessions import RUN, SESSIONS, Sessions
from trackfield.drivers.session import open_session
from trackfield.errors import RunFailed
from trackfield.wire import keys

PIPE: Final = 1 << 20
"""Bytes of the log that may wait: what a router says about more than a thousand frames."""
STDOUT: Final = 1
"""Where the log of Zenoh goes."""
GATHER_S: Final = 0.02
"""How long what comes is let gather: a reader that is woken for each line costs more than all the rest."""


class Guard:
    """Counts attempts in the process of a router of ``run``; to be made before its session is opened.

    ``sessions`` says how many each certificate may have, as in ``Sessions``. It tells the launcher when that asks, and
    names each new kind of attempt on stderr if it is to ``say`` so.
    """

    def __init__(self, run: str, sessions: Mapping[str, int | None], *, say: bool = False) -> None:
        self._key, self._say = f"{run}/{keys.ATTEMPTS}", say
        self._sessions = Sessions(sessions)
        self._denials = Denials(self._sessions.certificate_of)
        self._said: set[tuple[str, str]] = set()
        self._lock = Lock()
        self._log, into = os.pipe()
        with suppress(OSError):  # there is less, and the router may have to wait in a flood
            fcntl.fcntl(into, fcntl.F_SETPIPE_SZ, PIPE)
        os.dup2(into, STDOUT)
        os.close(into)
        os.environ.update(RUST_LOG=FILTER, NO_COLOR="1")
        zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]
        Thread(target=self._read, name="log", daemon=True).start()

    def watch(self, router: zenoh.Session) -> None:
        """Note who comes to this router, and answer, for as long as its session is open."""
        self._held = [
            router.info.declare_link_events_listener(Callback(self._on_link, indirect=False), history=True),
            router.declare_queryable(self._key, Callback(self._on_question, indirect=False)),
        ]

    def attempts(self) -> dict[str, dict[str, int]]:
        """What was refused until now, by certificate and kind."""
        self._drain()
        with self._lock:
            found: dict[str, dict[str, int]] = {}
            for name, kind, n in self._counts():
                found.setdefault(name, {})[kind] = n
            return found

    def _counts(self) -> Iterator[tuple[str, str, int]]:
        yield from ((name, kind, n) for (name, kind), n in self._denials.denied().items())
        yield from ((NOBODY, why, n) for why, n in self._denials.handshakes.items())
        yield from ((name, SECOND, n) for name, n in self._sessions.so_far().items() if n)

    def _read(self) -> None:
        while True:
            select.select([self._log], [], [])
            time.sleep(GATHER_S)
            self._drain()
            if self._say:
                self._tell()

    def _drain(self) -> None:
        """Read what is in the log now."""
        with self._lock:
            left = struct.unpack("i", fcntl.ioctl(self._log, termios.FIONREAD, bytes(4)))[0]
            while left > 0:
                piece = os.read(self._log, left)
                left -= len(piece)
                self._denials.feed(piece)

    def _tell(self) -> None:
        """Name what was not tried before."""
        with self._lock:
            new = [(name, kind) for name, kind, _ in self._counts() if (name, kind) not in self._said]
        for name, kind in new:
            self._said.add((name, kind))
            with suppress(OSError):  # nobody reads it; the log must be read on, or the router waits
                print(f"attempt: {name}: {kind}", file=sys.stderr, flush=True)

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _on_link(self, event: zenoh.LinkEvent) -> None:
        session, name, now_s = str(event.link.zid), event.link.auth_identifier or "", time.monotonic()
        with self._lock:
            if event.kind == zenoh.SampleKind.DELETE:
                self._sessions.went(session, name, now_s)
            else:
                self._sessions.came(session, name, now_s)

    def _on_question(self, query: zenoh.Query) -> None:
        query.reply(self._key, pack(self.attempts()))


def guarded(settings: str, *, say: bool = False) -> zenoh.Session:
    """A router with these settings; with a ``Guard`` if its run is secured, which its limits tell.

    Raises ``RunFailed`` if it cannot listen.
    """
    config = json.loads(settings)
    told = config.get("metadata")
    guard = Guard(told[RUN], told[SESSIONS], say=say) if told else None
    try:
        router = open_session(settings)
    except zenoh.ZError as error:
        why = str(error).partition(" at /")[0].rpartition(": ")[2]
        places = [place for place in config["listen"]["endpoints"] if not place.startswith("unixsock")]
        raise RunFailed(f"cannot listen at {', '.join(places) or 'its socket'}: {why}") from None
    if guard:
        guard.watch(router)
    return router
