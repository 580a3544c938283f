"""The processes that are started together, and their logs."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Self

import zenoh

from launcher.processes.children import Children
from trackfield.errors import RunFailed

LOG_TAIL: Final = 12
"""Lines that are quoted of the log of a process that failed."""


class Logged:
    """What writes a log for each process into ``folder``."""

    folder: Path

    def log(self, name: str) -> Path:
        """A process's log."""
        return self.folder / "logs" / f"{name}.log"

    def log_tail(self, name: str) -> str:
        """The last lines of a process's log."""
        log = self.log(name)
        return "\n".join(log.read_text(errors="replace").splitlines()[-LOG_TAIL:]) if log.exists() else ""

    def failure(self, what: str, name: str) -> RunFailed:
        """The error that this process failed, with the end of its log."""
        tail, log = self.log_tail(name), self.log(name)
        return RunFailed(f"{what}; its log, {log}, ends:\n{tail}" if tail else what, process=name, log=tail)


class Together(Logged):
    """Processes and a session, as a context manager that leaves none of them behind."""

    _children: Children
    session: zenoh.Session

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if hasattr(self, "_children"):
            self._children.close()
        if hasattr(self, "session"):
            self.session.close()  # type: ignore[no-untyped-call]
        self._clear()

    def _start(self) -> None:
        raise NotImplementedError

    def _clear(self) -> None:
        """Remove what is left when all have ended."""
        raise NotImplementedError
