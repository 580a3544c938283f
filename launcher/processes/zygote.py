"""What every process of a run is forked from, and how each of them begins.

Preloaded by a fork server: a node is forked with all its imports done and shares their memory with all others. What a
child is to become comes as ``module:attribute``, imported after the fork unless ``Children`` was told
to preload it. Nothing here may import what a node must not carry (numpy, rerun, pydantic).

A node's memory is what it writes to after the fork, and Python writes to every object that it uses: each function that
only children call costs each of them about 10 kB. So what can be done before the fork is done here.
"""

from __future__ import annotations

import ctypes
import gc
import logging
import os
import signal
import sys
from dataclasses import dataclass
from typing import Any, Final

from setproctitle import setproctitle

from launcher.processes.garbage import look_seldom
from trackfield.plugins import load

_LIBC: Final = ctypes.CDLL(None)
_PR_SET_PDEATHSIG: Final = 1
_PR_SET_TIMERSLACK: Final = 29
_STDOUT, _STDERR = 1, 2
_ONE_THREAD: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Child:
    """What a child runs: ``place`` (``module:attribute``) is called with its arguments, and the child ends with it.

    ``title`` is what ``ps`` shows, ``log`` where its output goes. One that is ``graceful`` is terminated, not killed,
    when the launcher dies.
    """

    place: str
    title: str
    log: str
    niceness: int = 0
    graceful: bool = False


def become(child: Child, *arguments: Any) -> None:
    """Run this child from its start to its end."""
    _enter(child)
    load(child.place)(*arguments)


def _enter(child: Child) -> None:
    """Set title, log file and priority, and end with the launcher."""
    setproctitle(f"trackfield {child.title}")
    _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM if child.graceful else signal.SIGKILL)
    _prctl(_PR_SET_TIMERSLACK, 1000)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    log = os.open(child.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    os.dup2(log, _STDOUT)
    os.dup2(log, _STDERR)
    os.close(log)
    if child.niceness:
        os.nice(child.niceness)


def _prctl(option: int, value: int) -> None:
    _LIBC.prctl(option, value)


if os.environ.get("TRACKFIELD_ZYGOTE") == str(os.getppid()):
    os.setsid()  # the terminal's Ctrl-C is for the launcher alone
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    setproctitle("trackfield zygote")
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr, force=True)
    look_seldom()
    gc.freeze()
