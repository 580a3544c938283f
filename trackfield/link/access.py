"""Channel access of a radio before it sends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

Draw = Callable[[str, int], float]
"""A draw from (0, 1), by its purpose and number."""


class Access(Protocol):
    """An access method. ``busy`` is the share of the time in which the channel is found busy, below 1."""

    @property
    def blind_ns(self) -> int | None:
        """It notices signals that began at least so long before it sends; None: it notices none."""
        ...

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> tuple[int, bool]:
        """For transmission number ``attempt`` (from 0): the time until its first bit, and True.

        If it is given up: the time until then, and False.
        """
        ...

    def granted(self, busy: float) -> float:
        """The probability that it is not given up."""
        ...


class Aloha:
    """Sends at once, without regard to other senders."""

    blind_ns: Final = None

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> tuple[int, bool]:
        """See ``Access.wait_ns``."""
        return 0, True

    def granted(self, busy: float) -> float:
        """See ``Access.granted``."""
        return 1.0
