"""The live view of a run: the processes that show it to browsers while it goes on.

If it does not start, or dies, the run goes on without it.
"""

from __future__ import annotations

import os
import socket
import sys
import time
import webbrowser
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Final, Self

from launcher.processes.children import Children
from launcher.processes.zygote import Child
from launcher.records import LIVE, Plan
from launcher.timeline.program import environment
from launcher.timeline.view import free_port, page_address, source, web_server

VIEWER: Final = "viewer"
"""The process that serves Rerun's viewer to browsers."""
NICENESS: Final = 10
"""The run itself comes first."""
READY_S: Final = 60.0
END_S: Final = 5.0
"""How long the live view may take to show the last of a run."""
POLL_S: Final = 0.05
PROVISIONAL: Final = "provisional: what it shows may be taken back"


class LiveView:
    """A run's live view, as a context manager that leaves no process behind; it ends with the run.

    ``tell`` is called with its address, and with why it failed. It is shown by a viewer of its own, or, if ``at``
    (``HOST:PORT``) is given, by the one there.
    """

    def __init__(
        self, plan: Plan, folder: Path, settings: str, token: bytes, tell: Callable[[str], None], at: str = ""
    ) -> None:
        self._plan, self._settings, self._token, self._tell = plan, settings, token, tell
        self._log = folder / "logs" / f"{LIVE}.log"
        self._at, self._port, self._page = at, free_port(), free_port()
        self._alive = True

    def __enter__(self) -> Self:
        self._children = Children(2)
        recorder = Child("launcher.record.live:show", LIVE, str(self._log), NICENESS)
        to = source(self._at) if self._at else self._port
        self._children.fork(LIVE, recorder, self._settings, self._plan, to, self._token)
        if self._at:
            return self
        server = Child("launcher.processes.bodies:program", VIEWER, str(self._log), NICENESS)
        self._children.fork(VIEWER, server, web_server(self._page, self._port), environment())
        return self

    def __exit__(self, failed: object, *_: object) -> None:
        if not failed and self._children.alive(LIVE):
            self._children.terminate(LIVE)
            self._children.wait([LIVE], END_S)
        self._children.close()

    def wait_ready(self, live: Collection[str], give_up: Callable[[], bool]) -> None:
        """Wait until a browser can connect; ``live`` are the names of the live processes, as Zenoh sees them."""
        deadline = time.monotonic() + READY_S
        while self._alive and not give_up():
            if LIVE in live and self._at:
                self._tell(f"live view: at the viewer at {self._at} ({PROVISIONAL})")
                return
            if LIVE in live and _answers(self._page):
                address = page_address(self._page, self._port)
                self._tell(f"live view: {address} ({PROVISIONAL})")
                _open_browser(address)
                return
            if time.monotonic() > deadline:
                self._end(f"did not start within {READY_S:.0f} s")
            time.sleep(POLL_S)
            self.look()

    def look(self) -> None:
        """Check that it is still alive."""
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
    """Open a browser if there is a screen and a terminal; the address was printed in any case."""
    screen = sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if screen and sys.stderr.isatty():
        webbrowser.open(address)
