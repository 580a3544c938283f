"""Many jobs over all cores or a cluster, with their progress on a terminal."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from multiprocessing import resource_tracker
from typing import Any, Final, TypeVar

from launcher.plan.brought import Registered, register, registered
from launcher.show import PLAIN_EVERY_S
from launcher.signals import handling
from trackfield.errors import RunFailed

Job = TypeVar("Job")
Answer = TypeVar("Answer")

WORKERS_START_S: Final = 3.0
"""The time that worker processes take to start and to import; less work than that is done in this process."""

_WARNINGS: Final = "PYTHONWARNINGS"
"""The variable by which Python is told of which warnings it is to say nothing."""
FIRST: Final = 5
"""The first jobs that are not used to estimate the remaining time."""


def unordered(
    function: Callable[[Job], Answer],
    jobs: Sequence[Job],
    n_jobs: int = -1,
    title: str = "",
    *,
    lines: bool = False,
    unit: str = "runs",
) -> Iterator[tuple[int, Answer]]:
    """(place in ``jobs``, answer) of each, as they come; with a progress bar on stderr where that is a terminal.

    ``n_jobs`` and ``joblib.parallel_config`` say where they are computed, as for ``joblib.Parallel``; the first is
    computed in this process, and so are all others if that takes less time than to start workers. With ``lines``,
    progress is printed in plain lines where there is no terminal, and jobs are called by their ``unit``. Raises
    ``RunFailed`` if a process that computes dies.
    """
    from joblib import Parallel, delayed

    with _progress(title, len(jobs), unit, lines=lines) as advance:
        begun = time.monotonic()
        for place, job in enumerate(jobs[:1]):
            yield place, function(job)
            advance()
        rest = list(enumerate(jobs))[1:]
        if (time.monotonic() - begun) * len(rest) < WORKERS_START_S:
            n_jobs = 1
        calls = (delayed(_placed)(registered(), function, place, job) for place, job in rest)
        with nullcontext() if n_jobs == 1 else _starting():
            answers = Parallel(n_jobs=n_jobs, return_as="generator_unordered")(calls)
        try:
            for answer in answers:
                yield answer
                advance()
        except BrokenProcessPool:
            raise RunFailed("a worker process was killed, by somebody or for want of memory; try fewer jobs") from None


def computed(dask: str | None) -> AbstractContextManager[None]:
    """Inside, jobs are computed by the workers of the Dask scheduler at this address; on this machine if it is None.

    Raises what ``cluster.cluster`` raises.
    """
    if dask is None:
        return nullcontext()
    from launcher.study.cluster import cluster  # loads distributed, which not everybody has

    return cluster(dask)


@contextmanager
def _starting() -> Iterator[None]:
    """While workers and those that track their resources are started."""
    with _silent_trackers(), _deaf_children():
        yield


@contextmanager
def _silent_trackers() -> Iterator[None]:
    """Processes that are started inside do not warn of resources that a process which was killed has left behind.

    Those that track them remove these, and may find them gone: it is nothing to a user, who is told who was killed.
    """
    before = os.environ.get(_WARNINGS)
    os.environ[_WARNINGS] = ",".join(filter(None, [before, "ignore:resource_tracker"]))
    try:
        yield
    finally:
        if before is None:
            del os.environ[_WARNINGS]
        else:
            os.environ[_WARNINGS] = before


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes that are started inside ignore the terminal, Ctrl-C and its end; this process handles it afterwards.

    It has threads that do not block the signals, and Python would handle what they receive.
    """
    came: list[int] = []
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    resource_tracker.ensure_running()  # its first start would unblock SIGINT
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    with handling(came.append):
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    if came:
        signal.raise_signal(came[0])


def _placed(brought: Registered, function: Callable[[Job], Answer], place: int, job: Job) -> tuple[int, Answer]:
    register(brought)  # users registered theirs in the calling process
    return place, function(job)


@contextmanager
def _progress(title: str, total: int, unit: str, *, lines: bool) -> Iterator[Callable[[], Any]]:
    """Call what it yields after each job."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        yield _plain(console.print, total, unit) if lines else lambda: None
        return
    columns = (
        *(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()),
        *(TimeElapsedColumn(), TextColumn("remaining:"), TimeRemainingColumn()),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=total)
        yield lambda: progress.advance(task)


def _plain(say: Callable[[str], Any], total: int, unit: str) -> Callable[[], None]:
    """A line every few seconds."""
    done, said, begun = 0, time.monotonic(), 0.0

    def advance() -> None:
        nonlocal done, said, begun
        done, now = done + 1, time.monotonic()
        begun = now if done == FIRST else begun  # the first of each process take longer
        if now - said >= PLAIN_EVERY_S and done < total:
            said = now
            left = (now - begun) / (done - FIRST) * (total - done) if done > 2 * FIRST else 0.0
            say(f"{done} of {total} {unit}{f', about {left:.0f} s remaining' if left else ''}")

    return advance
