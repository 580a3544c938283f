"""TOML that users wrote, in files and on the command line: read as plain values of a sensible size."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.files import MIB, read_text
from trackfield.words import quoted

MOST_BYTES: Final = 4 * MIB
"""The largest scenario file."""
DEEPEST: Final = 16
"""No value of a scenario is as many tables and lists deep."""

_BITS: Final = 127
"""A whole number of more is none that anybody meant; which numbers a key allows, its type says."""


def read_toml(file: Path) -> tuple[dict[str, Any], str]:
    """The contents of a TOML file, and its text. Raises ``ScenarioError``."""
    try:
        text = read_text(file, MOST_BYTES)
        return parsed(text), text
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", file=str(file)) from None
    except ValueError as error:  # bytes that are not text, or text that is not TOML
        raise ScenarioError(f"not a TOML file ({error})", file=str(file)) from None


def parsed(text: str) -> dict[str, Any]:
    """The contents of a TOML text. Raises ``ValueError`` if it is none."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"values more than {DEEPEST} deep") from None


def check_values(values: Mapping[str, Any], file: str = "") -> None:
    """Raise ``ScenarioError`` for what no TOML file holds: numbers without end, keys that are no text.

    Also for values too deep in tables and lists, which may hold themselves if they are not from a file.
    """
    left: list[tuple[str, Any, int]] = [("", values, 0)]
    while left:
        key, value, depth = left.pop()
        if depth > DEEPEST:
            expected = f"no value more than {DEEPEST} deep in tables and lists"
            raise ScenarioError("is too deep", file=file, key=key, expected=expected)
        if isinstance(value, int) and value.bit_length() > _BITS:
            raise ScenarioError(f"is {quoted(value)}", file=file, key=key, expected="a number of at most 38 digits")
        if isinstance(value, Mapping):
            left += ((_within(key, name, file), one, depth + 1) for name, one in value.items())
        elif isinstance(value, list | tuple):
            left += ((key, one, depth + 1) for one in _large(value))


def _within(key: str, name: object, file: str) -> str:
    """The key of a value in a table."""
    if not isinstance(name, str):
        raise ScenarioError(f"has the key {quoted(name)}", file=file, key=key, expected="keys that are text")
    return f"{key}.{name}" if key else name


def _large(values: Iterable[Any]) -> Iterable[Any]:
    """What may be wrong in a list."""
    return (value for value in values if isinstance(value, int | list | tuple | Mapping))
