"""What this machine allows a run over processes: open files, processes, memory, a place for its socket."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import psutil

from launcher.processes.children import FILES_EACH
from launcher.processes.endpoint import SocketFolder
from launcher.records import Plan
from trackfield.errors import RunFailed

FILES: Final = 80
"""Open files of a launcher without children; a router has fewer."""
THREADS: Final = 150
"""Of launcher, router, recorder and fusion centre, and of a live view."""
THREADS_EACH: Final = 3
"""Of a node."""
MEMORY: Final = 3 << 30
"""Address space (bytes) of a recorder; little of it is ever used."""
_ROOT: Final = Path("/sys/fs/cgroup")


def check_machine(plan: Plan, *, router: bool, guests: int = 0) -> None:
    """Raise ``RunFailed`` if this machine does not allow such a run; nothing is started.

    ``router`` says that the run starts its own; of its processes so many ``guests`` start elsewhere.
    """
    check_processes(max(len(plan.processes) - guests, 0), "a run in virtual time (--virtual) needs much less")
    if router:
        SocketFolder().close()


def check_processes(count: int, otherwise: str) -> None:
    """Raise ``RunFailed`` if this machine does not allow so many processes of a run; it also says what to do else."""
    if wrong := list(_exceeded(count)):
        raise RunFailed("\n".join([*wrong, otherwise]))


def _exceeded(processes: int) -> Iterator[str]:
    files, threads = FILES + FILES_EACH * processes, THREADS + THREADS_EACH * processes
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < files:
        yield f"this run needs {files} open files, and {hard} are allowed (ulimit -Hn)"
    for free, limit in _free_processes():
        if free < threads:
            yield f"this run needs {threads} processes and threads, and {max(free, 0)} more are allowed ({limit})"
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft != resource.RLIM_INFINITY and soft < MEMORY:
        yield f"this run needs {MEMORY >> 20} MiB of address space, and {soft >> 20} are allowed (ulimit -v)"


def _free_processes() -> Iterator[tuple[int, str]]:
    """How many more processes and threads there may be, by each limit that there is, and its name."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NPROC)
    if soft != resource.RLIM_INFINITY and os.getuid() != 0:  # the limit does not bind root
        yield soft - _threads_of(os.getuid()), f"ulimit -u: {soft}"
    with suppress(OSError):
        line = next((line for line in Path("/proc/self/cgroup").read_text().splitlines() if line[:3] == "0::"), "0::/")
        group = _ROOT / line[3:].lstrip("/")
        for one in (group, *group.parents):
            with suppress(OSError, ValueError):  # no limit: "max"
                most = int((one / "pids.max").read_text())
                yield most - int((one / "pids.current").read_text()), f"pids.max of {one}: {most}"


def _threads_of(user: int) -> int:
    found = psutil.process_iter(["uids", "num_threads"])
    return sum(one.info["num_threads"] or 0 for one in found if one.info["uids"] and one.info["uids"].real == user)
