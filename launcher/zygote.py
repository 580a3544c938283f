"""What every process of a run is forked from, and where each of them begins.

Preloaded by a fork server: a node is forked with all its imports done and shares their memory with its thousand
siblings. Nothing here may import what a node must not carry (numpy, rerun, pydantic).
"""

from __future__ import annotations

import ctypes
import gc
import logging
import os
import signal
import sys
from collections.abc import Mapping
from pathlib import Path
from threading import Event
from typing import Any, Final

from setproctitle import setproctitle

import node.role  # noqa: F401  what a node needs is there before it is forked
from launcher.garbage import look_seldom
from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, open_client, open_router

_PR_SET_PDEATHSIG: Final = 1
_PR_SET_TIMERSLACK: Final = 29
VIEW_NICENESS: Final = 10
"""Of what a run can do without."""
_ONE_THREAD: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def run_role(endpoint: str, run: str, id: str, title: str, log: Path, niceness: int) -> None:
    """A process of the field, from its birth to its last word."""
    _enter(title, log)
    os.environ["ZENOH_RUNTIME"] = NODE_RUNTIME
    process = Process(open_client(endpoint, run), id)
    os.nice(niceness)
    process.run()


def run_router(endpoint: str, log: Path) -> None:
    """The router, until it is told to end."""
    _enter("router", log)
    done = Event()
    signal.signal(signal.SIGTERM, lambda *_: done.set())
    router = open_router(endpoint)
    done.wait()
    router.close()  # type: ignore[no-untyped-call]


def run_recorder(endpoint: str, log: Path, arguments: Any) -> None:
    """The recorder; on SIGTERM, also that of its parent's death, it closes its files first."""
    _enter("recorder", log, death=signal.SIGTERM)
    from launcher.recorder import record

    record(endpoint, *arguments)


def run_live(endpoint: str, log: Path, arguments: Any) -> None:
    """What shows a run as it goes on; whatever the run needs itself comes first."""
    _enter("live", log)
    os.nice(VIEW_NICENESS)
    from launcher.live import show

    show(endpoint, *arguments)


def run_viewer(log: Path, command: list[str], environment: Mapping[str, str]) -> None:
    """The program that serves the viewer to browsers, in the place of this process."""
    _enter("viewer", log)
    os.nice(VIEW_NICENESS)
    os.execve(command[0], command, environment)


def _enter(title: str, log: Path, death: int = signal.SIGKILL) -> None:
    """Be a process of its own: title, log file, and no life beyond that of the launcher."""
    setproctitle(f"trackfield {title}")
    _prctl(_PR_SET_PDEATHSIG, death)
    _prctl(_PR_SET_TIMERSLACK, 1000)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for name in _ONE_THREAD:
        os.environ[name] = "1"
    with log.open("ab", buffering=0) as file:
        os.dup2(file.fileno(), sys.stdout.fileno())
        os.dup2(file.fileno(), sys.stderr.fileno())
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr, force=True)


def _prctl(option: int, value: int) -> None:
    ctypes.CDLL(None).prctl(option, value)


if os.environ.get("TRACKFIELD_ZYGOTE") == str(os.getppid()):
    os.setsid()  # the terminal's Ctrl-C is for the launcher alone
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    setproctitle("trackfield zygote")
    look_seldom()
    gc.freeze()
