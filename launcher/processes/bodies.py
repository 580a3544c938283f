"""What forked processes run, besides recorders: a role, the router, the program that serves the viewer."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Mapping
from threading import Event
from typing import Final

from launcher.signals import wait_for
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, open_session
from trackfield.errors import RunFailed
from trackfield.plugins import give
from trackfield.wire import keys

CANNOT_LISTEN: Final = 2
"""The exit code of a router that cannot listen where it should."""


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


def router(settings: str) -> None:
    """The router with these settings, until it is told to end."""
    from launcher.security.guard import guarded

    done = Event()
    signal.signal(signal.SIGTERM, lambda *_: done.set())
    try:
        session = guarded(settings)
    except RunFailed as error:
        print(error, file=sys.stderr, flush=True)
        os._exit(CANNOT_LISTEN)
    wait_for(done)
    session.close()  # type: ignore[no-untyped-call]


def program(command: list[str], environment: Mapping[str, str]) -> None:
    """Another program, in the place of this process."""
    os.execve(command[0], command, environment)
