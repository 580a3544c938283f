"""Talking by lines of text with a process that has a terminal, in a run that goes on."""

from __future__ import annotations

import os
import select
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import ENOENT
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from secrets import token_hex
from typing import Final

from trackfield.errors import RunFailed

AGAIN_S: Final = 0.1
"""How often it is looked whether a terminal is there, and free."""
MOST: Final = 4096
"""Bytes that are read at a time."""


class Terminal:
    """The other end of a process's terminal, which nobody else uses meanwhile."""

    def __init__(self, file: int, until: float) -> None:
        self._file, self._until, self._begun = file, until, b""

    def ask(self, line: str) -> Iterator[str]:
        """The lines of the answer, as they come. Raises ``RunFailed`` if the process goes away, or is slow."""
        tag = f"#{token_hex(4)}"
        self._write(f"\n{tag} {line}\n".encode())
        while True:
            said, _, text = self._line().partition(" ")
            if said == tag:  # all else are answers to others, who waited no longer
                yield text

    def _line(self) -> str:
        while b"\n" not in self._begun:
            self._wait(select.POLLIN)
            data = b""
            with suppress(OSError):
                data = os.read(self._file, MOST)
            if not data:
                raise RunFailed("system control went away before it had answered: the run is over, or it is restarted")
            self._begun += data
        line, _, self._begun = self._begun.partition(b"\n")
        return line.decode("ascii", "replace").strip()

    def _write(self, data: bytes) -> None:
        while data:
            self._wait(select.POLLOUT)
            try:
                data = data[os.write(self._file, data) :]
            except OSError as error:
                raise RunFailed(f"system control cannot be told anything ({error.strerror})") from None

    def _wait(self, event: int) -> None:
        poll = select.poll()
        poll.register(self._file, event)
        if not poll.poll(max(self._until - time.monotonic(), 0) * 1000):
            raise RunFailed("system control did not answer in time")


@contextmanager
def at_terminal(link: Path, timeout_s: float, check: Callable[[], None]) -> Iterator[Terminal]:
    """The terminal to which ``link`` leads, as soon as it is there and free; ``check`` raises if it never will be.

    Raises ``RunFailed`` if that takes too long.
    """
    until = time.monotonic() + timeout_s
    while (file := _opened(link)) is None or not _free(file):
        why = (
            "is not there (its process has not begun, or is on another machine)"
            if file is None
            else "is in use by somebody else"
        )
        if file is not None:
            os.close(file)
        check()
        if time.monotonic() >= until:
            raise RunFailed(f"the terminal of system control, {link}, {why}: waited {timeout_s:g} s")
        time.sleep(AGAIN_S)
    try:
        tty.setraw(file)
        termios.tcflush(file, termios.TCIFLUSH)
        yield Terminal(file, until)
    finally:
        os.close(file)


def _opened(link: Path) -> int | None:
    """The file to which ``link`` leads; None if there is no such terminal (any more)."""
    try:
        file = os.open(link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == ENOENT:
            return None
        raise RunFailed(f"the terminal of system control, {link}, cannot be opened ({error.strerror})") from None
    if not os.isatty(file):
        os.close(file)
        raise RunFailed(f"{link} is not a terminal")
    return file


def _free(file: int) -> bool:
    """Whether nobody else has this terminal; from now on it is ours."""
    try:
        flock(file, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        return False
    return True
