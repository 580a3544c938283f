"""What the processes of a run are forked from, and how each of them begins.

A node is forked with all its imports done and shares their memory with all others. What a child is to become
comes as ``module:attribute``, imported after the fork unless the zygote was told to preload it. Nothing here may import
what a node must not carry (numpy, rerun, pydantic): roles that need such are forked from a second, heavy zygote.

A node's memory is what it writes to, or the zygote after its fork; and Python writes to every object that it uses. Each
function that only children call costs each of them about 10 kB. So what can be done before the first fork is done here,
and between two forks the zygote does next to nothing.
"""

from __future__ import annotations

import ctypes
import gc
import logging
import os
import pickle
import signal
import sys
from collections.abc import Iterable
from contextlib import suppress
from importlib import import_module
from struct import Struct
from typing import Final, NamedTuple, NoReturn

from setproctitle import setproctitle

from launcher.processes.garbage import look_seldom
from trackfield.plugins import load
from trackfield.streams import steady

ORDER: Final = Struct("=qq")
"""An order: to fork what so many bytes after it say, or (no bytes) to wait for the end of the process with this id."""
ANSWER: Final = Struct("=q")
"""To the one the process id, or a negative errno; to the other its status, as of ``os.waitpid``."""

_PRCTL: Final = ctypes.CDLL(None).prctl
_PR_SET_PDEATHSIG: Final = 1
_PR_SET_TIMERSLACK: Final = 29
_STDOUT, _STDERR = 1, 2
_ONE_THREAD: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Child(NamedTuple):
    """What a child runs: ``place`` (``module:attribute``) is called with its arguments, and the child ends with it.

    ``title`` is what ``ps`` shows, ``log`` where its output goes. One that is ``graceful`` is terminated, not killed,
    when the launcher dies; one that is ``heavy`` is forked from the zygote with the heavy modules, if there is one.
    """

    place: str
    title: str
    log: str
    niceness: int = 0
    graceful: bool = False
    heavy: bool = False


def serve(orders: int, preload: Iterable[str], title: str) -> None:
    """Run the zygote of this title: follow the orders on the socket ``orders``, until the launcher closes it.

    ``preload`` are modules, and functions as ``module:attribute`` that are called once.
    """
    _prepare(preload, title)
    while order := os.read(orders, ORDER.size):
        size, pid = ORDER.unpack(order)
        answer = _fork(orders, _read(orders, size)) if size else os.waitpid(pid, 0)[1]
        os.write(orders, ANSWER.pack(answer))
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _prepare(preload: Iterable[str], title: str) -> None:
    """Do once what all children would do."""
    steady()
    os.setsid()  # the terminal's Ctrl-C is for the launcher alone
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _PRCTL(_PR_SET_PDEATHSIG, signal.SIGKILL)
    _PRCTL(_PR_SET_TIMERSLACK, 1000)
    setproctitle(f"trackfield {title}")
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr, force=True)
    for place in preload:
        with suppress(Exception):  # the child that needs it will say so in its log
            load(place)() if ":" in place else import_module(place)
    look_seldom()
    gc.collect()
    gc.freeze()


def _read(orders: int, size: int) -> bytes:
    whole = b""
    while len(whole) < size:
        part = os.read(orders, size - len(whole))
        if not part:
            raise EOFError("the launcher ended in the middle of an order")
        whole += part
    return whole


def _fork(orders: int, order: bytes) -> int:
    try:
        pid = os.fork()
    except OSError as error:
        return -(error.errno or 1)
    if pid == 0:
        os.close(orders)
        _live(order)
    return pid


def _live(order: bytes) -> NoReturn:
    """Run this child from its start to its end."""
    code = 1
    try:
        child, *arguments = pickle.loads(order)
        _enter(child)
        load(child.place)(*arguments)
        code = 0
    except BaseException:  # noqa: BLE001  whatever it is, its log has it
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        os._exit(code)


def _enter(child: Child) -> None:
    """Set title, log file and priority, and end with the launcher."""
    setproctitle(f"trackfield {child.title}")
    _PRCTL(_PR_SET_PDEATHSIG, signal.SIGTERM if child.graceful else signal.SIGKILL)
    log = os.open(child.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    os.dup2(log, _STDOUT)
    os.dup2(log, _STDERR)
    os.close(log)
    if child.niceness:
        os.nice(child.niceness)
