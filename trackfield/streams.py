"""Standard streams that are always there and never break: who reads them may leave, the program goes on."""

from __future__ import annotations

import io
import os
import select
import sys
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from typing_extensions import Buffer

_STREAMS: Final = (("stdin", 0), ("stdout", 1), ("stderr", 2))


class _Lasting(io.FileIO):
    """A stream that notes its first loss (``lost``) where another would raise: a closed pipe, a full disk."""

    lost: OSError | None = None

    def write(self, data: Buffer, /) -> int:
        """Write, or lose it; waits where the other end is slow."""
        try:
            while (written := super().write(data)) is None:
                select.select([], [self], [])
        except OSError as error:
            self.lost = self.lost or error
            return memoryview(data).nbytes
        return written


def keep_open() -> None:
    """Open the standard streams that are closed, on nothing.

    A file or socket that is opened while one is closed would get its number, and all that is printed.
    """
    for _, number in _STREAMS:
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # it gets the lowest free number, which is this


def steady() -> None:
    """Keep the standard streams open, and let none of them raise from now on.

    Streams that are not the interpreter's own, as in a notebook, stay as they are.
    """
    keep_open()
    sys.stdin = sys.stdin or open(os.devnull)  # noqa: SIM115, PTH123  for as long as the program runs
    for name, number in _STREAMS[1:]:
        old = getattr(sys, name)
        if old is getattr(sys, f"__{name}__"):
            encoding = old.encoding if old else "utf-8"
            at_once = number == 2 or os.isatty(number)
            raw = io.BufferedWriter(_Lasting(number, "w", closefd=False))
            new = io.TextIOWrapper(raw, encoding=encoding, errors="backslashreplace", line_buffering=at_once)
            setattr(sys, name, new)


def unheard() -> OSError | None:
    """Why what was printed to stdout did not all get there; None if it did."""
    sys.stdout.flush()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw.lost if isinstance(raw, _Lasting) else None
