"""Tickets: how a launcher knows the liveliness token of a process that joined, without keeping a list of who asked."""

from __future__ import annotations

from hmac import compare_digest
from secrets import token_bytes
from typing import Final

from trackfield.drivers.exchange.seal import Seal
from trackfield.wire.error import WireError

SECRET_BYTES: Final = 16
LENGTH: Final = 48
"""Characters: 16 hexadecimal digits say when it was given, the others are the seal."""


class Tickets:
    """Gives tickets to processes that join, and tells them from others by a seal of its own."""

    def __init__(self) -> None:
        self._seal = Seal(token_bytes(SECRET_BYTES))

    def give(self, name: str, now_ns: int) -> str:
        """A ticket for the life of this name, given at this time (any clock)."""
        given = f"{now_ns:016x}"
        return given + self._seal.mark(f"{name}/{given}")

    def given_ns(self, name: str, ticket: str) -> int:
        """When this ticket was given to the life of this name. Raises ``WireError`` (``seal``) if it was not."""
        given = ticket[:16]
        if not compare_digest(ticket.encode(), (given + self._seal.mark(f"{name}/{given}")).encode()):
            raise WireError("seal", "no ticket of this run")
        return int(given, 16)
