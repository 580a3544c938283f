"""The errors a user or a script can meet, one family."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

T = TypeVar("T")


class TrackfieldError(Exception):
    """Base of every error that Trackfield raises on purpose."""


class ScenarioError(TrackfieldError):
    """Bad input: a scenario, a target file, a command-line value (exit code 2).

    ``file`` and ``key`` say where (either may be empty), ``expected`` what is valid there. ``parts`` are the errors
    that it combines, or only itself.
    """

    parts: tuple[ScenarioError, ...]

    def __init__(self, what: str, *, file: str = "", key: str = "", expected: str = "") -> None:
        self.what, self.file, self.key, self.expected = what, file, key, expected
        self.parts = (self,)
        where = ": ".join(part for part in (file, key) if part)
        super().__init__(f"{where}: {what}" if where else what)

    def __str__(self) -> str:
        text = super().__str__()
        return f"{text}; expected {self.expected}" if self.expected else text


class RunFailed(TrackfieldError):  # noqa: N818  users read this name
    """A run failed or a process died unplanned (exit code 1)."""

    def __init__(self, what: str, *, process: str = "", log: str = "") -> None:
        self.what, self.process, self.log = what, process, log
        super().__init__(what)


def combined(errors: Sequence[ScenarioError]) -> ScenarioError:
    """One error with all of these, one per line, without duplicates."""
    parts = tuple({str(part): part for error in errors for part in error.parts}.values())
    if len(parts) == 1:
        return parts[0]
    whole = ScenarioError("\n".join(map(str, parts)))
    whole.parts = parts
    return whole


def together(calls: Iterable[Callable[[], T]]) -> list[T]:
    """The results of all calls. Raises one ``ScenarioError`` with the errors of all of them."""
    found, errors = [], []
    for call in calls:
        try:
            found.append(call())
        except ScenarioError as error:
            errors.append(error)
    if errors:
        raise combined(errors)
    return found
