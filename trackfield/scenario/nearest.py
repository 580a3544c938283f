"""Suggestions for misspelt names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Final

LONGEST: Final = 100
"""No known name is longer."""


def suggestion(name: str, known: Iterable[str]) -> str:
    """``"; did you mean X?"``, or nothing if no known name is similar."""
    if len(name) > LONGEST:
        return ""
    near = get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""
