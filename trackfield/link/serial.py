"""A serial line: bytes at a baud rate, one after the other; nothing is lost on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from trackfield.link.fate import FIELD, MIN_DELAY_NS, Fate, Transmission, check_positive

BITS: Final = 10
"""Of a byte: a start bit, eight of data, a stop bit."""
SUM_BYTES: Final = 2
"""Of the check sum of a frame."""
BLOCK: Final = 254
"""Of so many bytes each, a frame has one more: the code of its stuffing (Cheshire & Baker 1999)."""


@dataclass(frozen=True, slots=True)
class Serial:
    """``baud`` bits a second. A frame has arrived with its last bit, until which its sender is occupied.

    The kinds of message in ``bare`` are the protocol of a device: of their payloads all but so many bytes are sent, and
    nothing is added.
    """

    seed: int
    baud: int = 115_200
    bare: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_positive("baud", self.baud)

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``."""
        checked = frame.size + SUM_BYTES
        size = checked + checked // BLOCK + 1 + 1  # the codes at most, and the end
        if frame.kind in self.bare:
            size = frame.size - self.bare[frame.kind]
        takes_ns = -(-size * BITS * 1_000_000_000 // self.baud)
        return Fate(None, max(takes_ns, MIN_DELAY_NS), bytes_on_air=size, busy_ns=takes_ns, air_ns=takes_ns)

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return 1.0
