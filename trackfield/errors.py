"""The errors a user or a script can meet, one family."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final, TypeVar

from trackfield.words import plain

MOST_TOLD: Final = 20
"""Of so many errors together, the text of each is in the message; of more, their number."""

T = TypeVar("T")


class TrackfieldError(Exception):
    """Base of every error that Trackfield raises on purpose."""


class ScenarioError(TrackfieldError):
    """Bad input: a scenario, a target file, a command-line value (exit code 2).

    ``file`` and ``key`` say where (either may be empty), ``expected`` what is valid there. ``parts`` are the errors
    that it combines, or only itself. As text, it is one line for each part, of which very many are counted only;
    characters that a terminal would obey are escaped.
    """

    parts: tuple[ScenarioError, ...]

    def __init__(self, what: str, *, file: str = "", key: str = "", expected: str = "") -> None:
        self.what, self.file, self.key, self.expected = what, file, key, expected
        self.parts = (self,)
        super().__init__(what)

    def __str__(self) -> str:
        if len(self.parts) > 1:
            more = [f"... and {len(self.parts) - MOST_TOLD} more errors"] if len(self.parts) > MOST_TOLD else []
            return "\n".join([*map(str, self.parts[:MOST_TOLD]), *more])
        text = ": ".join(plain(part) for part in (self.file, self.key, self.what) if part)
        return f"{text}; expected {plain(self.expected)}" if self.expected else text


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
    whole = ScenarioError(f"{len(parts)} errors")
    whole.parts = parts
    return whole


def told_of(case: str, error: ScenarioError) -> ScenarioError:
    """The same errors, each of which says in which ``case`` it is one."""
    return combined([ScenarioError(f"{case}: {part}") for part in error.parts])


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
