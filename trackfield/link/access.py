"""How a radio comes to the channel before it sends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Draw = Callable[[str, int], float]
"""A draw from (0, 1), by what it is for and its number."""


class Access(Protocol):
    """An access method. ``busy`` is the share of the time in which the channel is found busy, below 1."""

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> tuple[int, bool]:
        """Of transmission number ``attempt`` (from 0): how long until its first bit, and True.

        If it is given up: how long until then, and False.
        """
        ...

    def granted(self, busy: float) -> float:
        """The probability that it is not given up."""
        ...


class Aloha:
    """Sends at once, whoever else does."""

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> tuple[int, bool]:
        """See ``Access.wait_ns``."""
        return 0, True

    def granted(self, busy: float) -> float:
        """See ``Access.granted``."""
        return 1.0
