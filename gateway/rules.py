"""What a gateway lets out of a field, and who may have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from trackfield.protocols.interest.interests import Place, id_of
from trackfield.wire.codec import WireError, decode
from trackfield.wire.interests import Arrived
from trackfield.wire.passes import FIXES, FixReport

FIX: Final = "fixes"
MISS: Final = "misses"


class Refused(Exception):  # noqa: N818  no error: it is what rules are for
    """The rules do not allow it; the text says why."""


class Passing(NamedTuple):
    """A message that may leave: of which class, from where (m), and whether it is a position fix."""

    task: int
    place: Place
    fix: bool
    origin: bytes
    message: bytes


@dataclass(frozen=True)
class Rules:
    """The sensors of the field and their ``places``; what passes, of which ``heads``, and to which ``subscribers``.

    ``passes`` has ``fixes`` for events with a fix, ``misses`` for those without. Empty ``heads`` or ``subscribers``:
    all of them.
    """

    places: Mapping[str, Place]
    passes: frozenset[str]
    heads: frozenset[str] = frozenset()
    subscribers: frozenset[str] = frozenset()

    def passing(self, arrived: Arrived) -> Passing:
        """What came out of the field, if it may leave. Raises ``Refused``."""
        try:
            origin, message = id_of(arrived.origin), decode(arrived.message)
        except WireError as error:
            raise Refused(error.reason) from None
        if not isinstance(message, FixReport):
            raise Refused("no fix")
        if origin not in self.places or (self.heads and origin not in self.heads):
            raise Refused("its origin may not")
        fix = bool(message.belief)
        if (FIX if fix else MISS) not in self.passes:
            raise Refused("a fix" if fix else "an event without a fix")
        return Passing(FIXES, self.places[origin], fix, arrived.origin, arrived.message)

    def check(self, subscriber: str, task: int) -> None:
        """Whether this process may have data of this class. Raises ``Refused``."""
        if self.subscribers and subscriber not in self.subscribers:
            raise Refused("not allowed to subscribe")
        if task != FIXES:
            raise Refused("a class that may not leave")
