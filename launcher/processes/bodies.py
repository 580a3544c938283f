"""What forked processes run, besides recorders: a role, the router, the program that serves the viewer."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from threading import Event

from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, open_client, open_router


def role(endpoint: str, run: str, name: str, niceness: int) -> None:
    """A process of the field; ``niceness`` is that of its work, not of its session's threads: frames leave at once."""
    os.environ["ZENOH_RUNTIME"] = NODE_RUNTIME
    process = Process(open_client(endpoint, run), name)
    os.nice(niceness)
    process.run()


def router(endpoint: str) -> None:
    """The router, until it is told to end."""
    done = Event()
    signal.signal(signal.SIGTERM, lambda *_: done.set())
    session = open_router(endpoint)
    done.wait()
    session.close()  # type: ignore[no-untyped-call]


def program(command: list[str], environment: Mapping[str, str]) -> None:
    """Another program, in the place of this process."""
    os.execve(command[0], command, environment)
