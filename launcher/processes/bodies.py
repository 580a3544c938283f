"""What forked processes run, besides recorders: a role, the router, the program that serves the viewer."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from threading import Event

from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, open_router, open_session
from trackfield.plugins import give
from trackfield.wire import keys


def role(settings: str, name: str, niceness: int, factory: str, places: Mapping[str, str], token: bytes) -> None:
    """A process of the field, with these settings of its session; ``factory`` makes its role.

    ``places`` are those of users' classes (``trackfield.plugins.give``), ``token`` is the run's secret. ``niceness`` is
    that of its work, not of its session's threads: frames leave at once.
    """
    os.putenv("ZENOH_RUNTIME", NODE_RUNTIME)
    give(places, installed=False)
    process = Process(open_session(settings), name, factory, Seal(token), keys.orders_to(name))
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
