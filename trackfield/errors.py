"""The errors a user or a script can meet, one family."""

from __future__ import annotations


class TrackfieldError(Exception):
    """Base of every error that Trackfield raises on purpose."""


class ScenarioError(TrackfieldError):
    """Bad input: a scenario, a target file, a command-line value (exit code 2).

    ``file`` and ``key`` say where (either may be empty), ``expected`` what would be right.
    """

    def __init__(self, what: str, *, file: str = "", key: str = "", expected: str = "") -> None:
        self.what, self.file, self.key, self.expected = what, file, key, expected
        where = ": ".join(part for part in (file, key) if part)
        super().__init__(f"{where}: {what}" if where else what)

    def __str__(self) -> str:
        text = super().__str__()
        return f"{text}; expected {self.expected}" if self.expected else text


class RunFailed(TrackfieldError):  # noqa: N818  a name that users read
    """A run failed or a process died unplanned (exit code 1)."""

    def __init__(self, what: str, *, process: str = "", log: str = "") -> None:
        self.what, self.process, self.log = what, process, log
        super().__init__(what)
