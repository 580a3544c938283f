"""The report of a run in virtual time, drawn by a process that loads what drawing needs while the run still goes on.

Loading and drawing take longer than the run of a small field. A run over processes lasts longer than both and needs its
cores for itself: its report is drawn afterwards, by ``write_report`` alone.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import psutil
from setproctitle import setproctitle

_NEEDED: Final = ("launcher.report.page", "jinja2", "scipy.spatial")
"""What writing a report loads."""
_PR_SET_PDEATHSIG: Final = 1
_TITLE: Final = "trackfield report"


def write_here(folder: Path) -> None:
    """Write the report of a finished run, in this process. Raises as ``write_report`` does."""
    from launcher.report import write_report  # matplotlib takes a while to load

    write_report(folder)


@contextmanager
def written_beside() -> Iterator[Callable[[Path], None]]:
    """A function that does what ``write_here`` does, but sooner: another process loads what it needs from now on.

    It forks, so it is for the command line alone, which has no threads yet. With a single core, or on a system other
    than Linux, it is ``write_here``.
    """
    if sys.platform != "linux" or len(os.sched_getaffinity(0)) == 1:
        yield write_here
        return
    with _forked() as drawer:
        drawer.submit(_load)

        def write(folder: Path) -> None:
            try:
                drawer.submit(_write, folder).result()
            except KeyboardInterrupt:
                _give_up()
                raise

        yield write


def _give_up() -> None:
    """End the processes that draw, so that nothing more is written."""
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            if " ".join(child.cmdline()).startswith(_TITLE):
                child.kill()
                child.wait()


def _forked() -> ProcessPoolExecutor:
    """One process, forked from this one when it is first given something to do."""
    return ProcessPoolExecutor(1, get_context("fork"), _begin)


def _begin() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    for number in (signal.SIGINT, signal.SIGHUP):  # from the terminal: they end the run early; its report is drawn
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    setproctitle(_TITLE)


def _load() -> None:
    for module in _NEEDED:
        import_module(module)


def _write(folder: Path) -> None:
    """Half of the figures here, half in another process, then the page."""
    from launcher.report.figures import FIGURES, draw
    from launcher.report.folder import read_run
    from launcher.report.page import write_page

    names = list(FIGURES)
    with _forked() as other:  # before anything here has threads
        others = other.submit(_draw, folder, names[1::2])
        run = read_run(folder)
        pictures = draw(run, names[::2]) | others.result()
    write_page(run, pictures)


def _draw(folder: Path, names: list[str]) -> dict[str, Path]:
    from launcher.report.figures import draw
    from launcher.report.folder import read_run

    return draw(read_run(folder), names)
