"""The live view of a run: a recorder of its own that serves the timeline to browsers while the run goes on.

It is no part of the field. A browser that stands still holds up this recorder, never the one that writes the run down,
and if the live view does not come up, or dies, the run goes on without it.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
import webbrowser
from collections.abc import Callable, Collection
from pathlib import Path
from threading import Event
from typing import Final, Self

import zenoh

from launcher import zygote
from launcher.children import Children
from launcher.listener import FLUSH_S, Listener
from launcher.records import LIVE, Plan
from launcher.result import Telling
from launcher.timeline import Timeline
from launcher.view import environment, free_port, page_address, web_server
from trackfield.drivers.session import open_client
from trackfield.wire import keys

VIEWER: Final = "viewer"
"""What serves Rerun's viewer to browsers."""
READY_S: Final = 60.0
END_S: Final = 5.0
"""How long the live view may take to show the last of a run."""
POLL_S: Final = 0.05


class LiveRecorder(Listener):
    """Shows what it hears, at a port of this machine, until it is told to end."""

    def __init__(self, session: zenoh.Session, plan: Plan, port: int) -> None:
        super().__init__(session, plan)
        self.telling = Telling(plan, self.ledger, Timeline(port, plan.info))
        self.end = Event()
        self.listen(LIVE, keys.telemetry_of_all("event"))

    def run(self) -> None:
        """Show all up to the end, and that too."""
        while not self.end.wait(FLUSH_S):
            self.pulse(self.telling)
        self.drain()
        self.telling.end()
        self.telling.timeline.close()


def show(endpoint: str, plan: Plan, port: int) -> None:
    """The life of the process that shows a run."""
    session = open_client(endpoint, plan.run.run)
    recorder = LiveRecorder(session, plan, port)
    signal.signal(signal.SIGTERM, lambda *_: recorder.end.set())
    recorder.run()
    session.close()  # type: ignore[no-untyped-call]


class LiveView:
    """A run's live view, as a context manager that leaves no process behind; it ends with the run.

    ``tell`` is told its address, and what becomes of it.
    """

    def __init__(self, plan: Plan, folder: Path, endpoint: str, tell: Callable[[str], None]) -> None:
        self._plan, self._endpoint, self._tell = plan, endpoint, tell
        self._log = folder / "logs" / f"{LIVE}.log"
        self._port, self._page = free_port(), free_port()
        self._alive = True

    def __enter__(self) -> Self:
        self._children = Children(2)
        self._children.fork(LIVE, zygote.run_live, self._endpoint, self._log, (self._plan, self._port))
        command = web_server(self._page, self._port)
        self._children.fork(VIEWER, zygote.run_viewer, self._log, command, environment())
        return self

    def __exit__(self, failed: object, *_: object) -> None:
        if not failed and self._children.alive(LIVE):
            self._children.terminate(LIVE)
            self._children.wait([LIVE], END_S)
        self._children.close()

    def wait_ready(self, live: Collection[str], give_up: Callable[[], bool]) -> None:
        """Wait until a browser can come; ``live`` are the names of those that hear the run, as Zenoh sees them."""
        deadline = time.monotonic() + READY_S
        while self._alive and not give_up():
            if LIVE in live and _answers(self._page):
                address = page_address(self._page, self._port)
                self._tell(f"live view: {address}")
                _open_browser(address)
                return
            if time.monotonic() > deadline:
                self._end(f"did not come up within {READY_S:.0f} s")
            time.sleep(POLL_S)
            self.look()

    def look(self) -> None:
        """See whether it is still there."""
        for name, why in self._children.gone():
            if self._alive:
                self._end(f"died ({name}: {why}; its log: {self._log})")

    def _end(self, why: str) -> None:
        self._alive = False
        self._tell(f"the live view {why}; the run goes on without it")


def _answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


def _open_browser(address: str) -> None:
    """Open it where somebody looks at a screen; the address was told in any case."""
    screen = sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if screen and sys.stderr.isatty():
        webbrowser.open(address)
