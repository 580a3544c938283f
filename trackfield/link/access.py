"""How a radio comes to the channel before it sends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Draw = Callable[[str, int], float]
"""A draw from (0, 1), by what it is for and its number."""


class Access(Protocol):
    """An access method. ``busy`` is the share of the time in which the channel is found busy, below 1."""

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> int | None:
        """How long until the first bit of transmission number ``attempt`` (from 0); None if it is given up."""
        ...

    def granted(self, busy: float) -> float:
        """The probability that it is not given up."""
        ...


class Aloha:
    """Sends at once, whoever else does."""

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> int | None:
        """See ``Access.wait_ns``."""
        return 0

    def granted(self, busy: float) -> float:
        """See ``Access.granted``."""
        return 1.0
