"""The operating-system processes of a run: forked from zygotes, watched, and ended with the run."""

from __future__ import annotations

import os
import pickle
import resource
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import psutil

from launcher.processes.zygote import ANSWER, ORDER, Child
from trackfield.errors import RunFailed
from trackfield.streams import keep_open

FILES_EACH: Final = 2
"""Open files that a child costs its launcher."""
FILES: Final = 1024
"""Open files of a launcher without children."""
KILL_TIMEOUT_S: Final = 5.0
POLL_S: Final = 0.02
ASK_S: Final = 3.0
"""How long the zygote may take to answer before it is continued, in case that somebody stopped it."""
FORK_S: Final = 60.0
"""How long it may take to fork: it does so for the first time when all is imported."""
WAIT_S: Final = 15.0
"""How long it may take to say how a process ended."""
ZYGOTE: Final = "zygote"
HEAVY_ZYGOTE: Final = "heavy zygote"
ZYGOTES: Final = (ZYGOTE, HEAVY_ZYGOTE)
WITH_ZYGOTE: Final = "ended with its zygote"
STAT_BYTES: Final = 128
"""Enough of /proc/<pid>/stat for the pid, the name (at most 64 bytes) and the state."""
_ZYGOTE: Final = """
import sys
sys.path[:] = {path!r}
from launcher.processes.zygote import serve
serve({orders}, {preload!r}, {title!r})
"""


@dataclass(frozen=True, slots=True)
class _Alive:
    """A process that is not known to have ended: the file ``end`` is readable once it has, ``stat`` has its state.

    ``zygote`` is the one that it was forked from, or its own name.
    """

    pid: int
    end: int
    stat: int
    zygote: str


class Children:
    """Child processes by name, the zygotes among them. A name may be forked again once its process is gone.

    All of them end with any zygote. ``preload`` are modules that most of the ``expected`` children need, imported once
    for all of them, and functions as ``module:attribute``, called once before the first is forked; ``heavy`` are those
    of children that are heavy. Raises ``RunFailed`` if there can be no zygote.
    """

    def __init__(self, expected: int, preload: Iterable[str] = (), heavy: Iterable[str] = ()) -> None:
        keep_open()
        _allow_many_files(FILES_EACH * expected + FILES)
        self._zygotes = {ZYGOTE: _Zygote(ZYGOTE, preload)}
        if heavy := tuple(heavy):
            self._zygotes[HEAVY_ZYGOTE] = _Zygote(HEAVY_ZYGOTE, heavy)
        self._fallen = False
        self._pids: dict[str, int] = {}
        self._alive: dict[str, _Alive] = {}
        self._exits = select.epoll()
        self._by_end: dict[int, str] = {}
        for name, zygote in self._zygotes.items():
            self._add(name, zygote.pid, name)

    def fork(self, name: str, body: Child, *arguments: Any) -> None:
        """Start a process that runs ``body``. Raises ``RunFailed`` if that cannot be."""
        zygote = HEAVY_ZYGOTE if body.heavy and HEAVY_ZYGOTE in self._zygotes else ZYGOTE
        self._add(name, self._zygotes[zygote].fork(body, *arguments), zygote)

    def _add(self, name: str, pid: int, zygote: str) -> None:
        # Even if it has ended already, its id is not given to another until the zygote is asked how it ended.
        self._pids[name] = pid
        try:
            child = _Alive(pid, os.pidfd_open(pid), os.open(f"/proc/{pid}/stat", os.O_RDONLY), zygote)
        except OSError as error:
            raise RunFailed(f"{name} could not be watched: {error.strerror}") from None
        self._alive[name], self._by_end[child.end] = child, name
        self._exits.register(child.end, select.EPOLLIN)

    def names(self) -> list[str]:
        """The names of all that there ever were."""
        return list(self._pids)

    def gone(self) -> list[tuple[str, str]]:
        """(name, how) of each that ended since the last call; none while a zygote, which knows how, stands still."""
        if any(self.stopped(zygote) for zygote in self._zygotes):
            return []
        ended = [self._by_end[end] for end, _ in self._exits.poll(0, len(self._by_end) or 1)]
        return [(name, self._bury(name)) for name in ended]

    def _bury(self, name: str) -> str:
        child = self._forget(name)
        code = self._last_word(name) if name in self._zygotes else self._zygotes[child.zygote].wait(child.pid)
        if code is None:
            return WITH_ZYGOTE
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def _last_word(self, name: str) -> int | None:
        """The exit code of a zygote, with which the other ends; None if that one was the first to end."""
        code = None if self._fallen else self._zygotes[name].ended()
        self._fallen = True
        for zygote in self._zygotes.values():
            zygote.close()
        return code

    def stopped(self, name: str) -> bool:
        """Whether it is stopped, by SIGSTOP or under a debugger."""
        child = self._alive.get(name)
        try:
            stat = b"" if child is None else os.pread(child.stat, STAT_BYTES, 0)
        except ProcessLookupError:
            return False
        return stat.rpartition(b")")[2][1:2] in (b"T", b"t")

    def alive(self, name: str) -> bool:
        """Whether it was forked and has not ended."""
        child = self._alive.get(name)
        return child is not None and not _readable(child.end)

    def pid(self, name: str) -> int | None:
        """Its process id."""
        return self._pids[name]

    def cpu_s(self, name: str) -> float:
        """The processor time of a living child so far."""
        times = psutil.Process(self._pids[name]).cpu_times()
        return float(times.user + times.system)

    def kill(self, name: str) -> None:
        """End it, whatever its state."""
        self._signal(name, signal.SIGKILL)

    def terminate(self, name: str) -> None:
        """Ask it to end."""
        self._signal(name, signal.SIGTERM)

    def resume(self, name: str) -> None:
        """Continue it, if it was stopped."""
        self._signal(name, signal.SIGCONT)

    def _signal(self, name: str, number: signal.Signals) -> None:
        if child := self._alive.get(name):
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(child.end, number)

    def close(self) -> None:
        """Kill those that are left, and wait for them."""
        left = [name for name in self._alive if name not in self._zygotes]
        for name in left:
            self.kill(name)
        self.wait(left, KILL_TIMEOUT_S)
        for zygote in self._zygotes.values():
            zygote.close()
        for name in list(self._alive):
            self._forget(name)
        self._exits.close()

    def wait(self, names: Iterable[str], timeout_s: float) -> None:
        """Wait until these are gone, or for so long."""
        deadline = time.monotonic() + timeout_s
        while any(self.alive(name) for name in names) and time.monotonic() < deadline:
            time.sleep(POLL_S)

    def _forget(self, name: str) -> _Alive:
        child = self._alive.pop(name)
        del self._by_end[child.end]
        self._exits.unregister(child.end)
        os.close(child.end)
        os.close(child.stat)
        return child


class _Zygote:
    """The other end of ``launcher.processes.zygote.serve``. Raises ``RunFailed`` if it cannot be started."""

    def __init__(self, title: str, preload: Iterable[str]) -> None:
        self._socket, theirs = socket.socketpair()
        self._socket.settimeout(ASK_S)
        modules = ["launcher.processes.bodies", *preload]
        command = _ZYGOTE.format(path=sys.path, orders=theirs.fileno(), preload=modules, title=title)
        started = threading.Event()
        self._failure: OSError | None = None

        def live() -> None:
            """Start it from a thread that stays, for the kernel ends it with the thread that started it."""
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", command], stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()]
                )
            except OSError as error:
                self._failure = error
            finally:
                theirs.close()
                started.set()
            if not self._failure:
                self._process.wait()

        self._thread = threading.Thread(target=live, name=ZYGOTE, daemon=True)
        try:
            self._thread.start()
        except RuntimeError as error:
            raise RunFailed(f"no process could be started: {error}") from None
        started.wait()
        if self._failure:
            raise RunFailed(f"no process could be started: {self._failure.strerror}")
        self.pid = self._process.pid

    def fork(self, *order: Any) -> int:
        """The id of a new process. Raises ``RunFailed`` if there is none."""
        content = pickle.dumps(order)
        pid = self._ask(ORDER.pack(len(content), 0) + content, FORK_S)
        if pid is None or pid < 0:
            why = "the zygote has ended or does not answer" if pid is None else os.strerror(-pid)
            raise RunFailed(f"a process could not be forked: {why}")
        return pid

    def wait(self, pid: int) -> int | None:
        """The exit code of a process that has ended; None if the zygote has ended, too."""
        status = self._ask(ORDER.pack(0, pid), WAIT_S)
        return None if status is None else os.waitstatus_to_exitcode(status)

    def ended(self) -> int:
        """The exit code of the zygote itself, which has ended."""
        return self._process.wait()

    def close(self) -> None:
        """End it, even if a process that was forked from this one has the socket, too, or if it stands still."""
        self._hang_up()
        self._socket.close()
        self._process.send_signal(signal.SIGCONT)
        self._thread.join(KILL_TIMEOUT_S)
        self._process.kill()
        self._thread.join(KILL_TIMEOUT_S)

    def _ask(self, order: bytes, timeout_s: float) -> int | None:
        """The answer to an order; None if it has ended or does not answer, and then it is not asked again."""
        deadline = time.monotonic() + timeout_s
        left, answer = memoryview(order), b""
        while len(answer) < ANSWER.size:
            try:
                if left:
                    left = left[self._socket.send(left) :]
                elif part := self._socket.recv(ANSWER.size - len(answer)):
                    answer += part
                else:
                    return None
            except TimeoutError:
                self._process.send_signal(signal.SIGCONT)
                if time.monotonic() > deadline:
                    self._hang_up()
            except OSError:  # it has ended
                return None
        return int(ANSWER.unpack(answer)[0])

    def _hang_up(self) -> None:
        with suppress(OSError):  # it has ended
            self._socket.shutdown(socket.SHUT_RDWR)


def _readable(file: int) -> bool:
    poll = select.poll()
    poll.register(file, select.POLLIN)
    return bool(poll.poll(0))


def _allow_many_files(wanted: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < limit:
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
