"""The operating-system processes of a run: forked from one zygote, watched, and ended with the run."""

from __future__ import annotations

import multiprocessing
import os
import resource
import select
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from multiprocessing import forkserver
from multiprocessing.context import ForkServerProcess
from types import ModuleType
from typing import Any, Final

import psutil

from launcher.processes import zygote
from launcher.processes.zygote import Child

FILES_EACH: Final = 4
"""Open files that a child costs its launcher."""
FILES: Final = 1024
"""Open files of a launcher without children."""
KILL_TIMEOUT_S: Final = 5.0
POLL_S: Final = 0.02
STAT_BYTES: Final = 128
"""Enough of /proc/<pid>/stat for the pid, the name (at most 64 bytes) and the state."""
_FORKING: Final = threading.Lock()
"""Held while forking: runs may begin in several threads, and forking changes state of the whole program."""


class Children:
    """Child processes by name. A name may be forked again once its process is gone.

    ``preload`` are modules that most of the ``expected`` children need, imported once for all of them.
    """

    def __init__(self, expected: int, preload: Iterable[str] = ()) -> None:
        _allow_many_files(FILES_EACH * expected + FILES)
        self._context = multiprocessing.get_context("forkserver")
        # The zygote comes last: all that was imported before it is shared by the processes that it forks.
        self._context.set_forkserver_preload(["launcher.processes.bodies", *preload, zygote.__name__])
        self._children: dict[str, ForkServerProcess] = {}
        self._stats: dict[str, int] = {}
        self._exits = select.epoll()
        self._by_sentinel: dict[int, str] = {}

    def fork(self, name: str, body: Child, *arguments: Any) -> None:
        """Start a process that runs ``body``."""
        with _FORKING, _no_main_module(), _zygote_environment():
            _start_zygote(os.getpid())
            child = self._context.Process(target=zygote.become, name=name, args=(body, *arguments))
            child.start()
        # Each start polls all children that multiprocessing knows of; these are watched here instead.
        multiprocessing.process._children.discard(child)  # type: ignore[attr-defined]
        self._children[name] = child
        self._by_sentinel[child.sentinel] = name
        self._exits.register(child.sentinel, select.EPOLLIN | select.EPOLLHUP)
        with suppress(OSError):  # it has ended already, which its sentinel reports
            self._stats[name] = os.open(f"/proc/{child.pid}/stat", os.O_RDONLY)

    def names(self) -> list[str]:
        """The names of all that were ever forked."""
        return list(self._children)

    def gone(self) -> list[tuple[str, str]]:
        """(name, how) of each that ended since the last call."""
        ended = [self._by_sentinel.pop(sentinel) for sentinel, _ in self._exits.poll(0, len(self._by_sentinel) or 1)]
        for name in ended:
            self._exits.unregister(self._children[name].sentinel)
            self._close_stat(name)
        return [(name, self._why(name)) for name in ended]

    def _why(self, name: str) -> str:
        self._children[name].join(1)
        code = self._children[name].exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def stopped(self, name: str) -> bool:
        """Whether it is stopped, by SIGSTOP or under a debugger."""
        file = self._stats.get(name)
        try:
            stat = b"" if file is None else os.pread(file, STAT_BYTES, 0)
        except ProcessLookupError:
            return False
        return stat.rpartition(b")")[2][1:2] in (b"T", b"t")

    def alive(self, name: str) -> bool:
        """Whether it was forked and has not ended."""
        return name in self._children and self._children[name].is_alive()

    def pid(self, name: str) -> int | None:
        """Its process id."""
        return self._children[name].pid

    def cpu_s(self, name: str) -> float:
        """The processor time of a living child so far."""
        times = psutil.Process(self._children[name].pid).cpu_times()
        return float(times.user + times.system)

    def kill(self, name: str) -> None:
        """End it, whatever its state."""
        self._children[name].kill()

    def terminate(self, name: str) -> None:
        """Ask it to end."""
        self._children[name].terminate()

    def close(self) -> None:
        """Kill those that are left, and wait for them."""
        left = [name for name in self._children if self.alive(name)]
        for name in left:
            self.kill(name)
        self.wait(left, KILL_TIMEOUT_S)
        for name in list(self._stats):
            self._close_stat(name)
        self._exits.close()

    def wait(self, names: Iterable[str], timeout_s: float) -> None:
        """Wait until these are gone, or for so long."""
        deadline = time.monotonic() + timeout_s
        while any(self.alive(name) for name in names) and time.monotonic() < deadline:
            time.sleep(POLL_S)

    def _close_stat(self, name: str) -> None:
        if (file := self._stats.pop(name, None)) is not None:
            os.close(file)


def _allow_many_files(wanted: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < limit:
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


@contextmanager
def _no_main_module() -> Iterator[None]:
    """Keep children from importing the caller's main program."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@cache
def _start_zygote(_launcher: int) -> None:
    """Once in each program, from a thread that stays: the kernel ends the zygote with the thread that started it."""
    started = threading.Event()

    def start() -> None:
        try:
            forkserver.ensure_running()
        finally:
            started.set()
        threading.Event().wait()

    threading.Thread(target=start, name="zygote", daemon=True).start()
    started.wait()


@contextmanager
def _zygote_environment() -> Iterator[None]:
    os.environ["TRACKFIELD_ZYGOTE"] = str(os.getpid())
    try:
        yield
    finally:
        del os.environ["TRACKFIELD_ZYGOTE"]
