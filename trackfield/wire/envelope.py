"""The envelope of a data frame: what identifies and times it, carried as the Zenoh attachment."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from trackfield.wire.error import WireError

_LAYOUT = struct.Struct("<qHHIq")


@dataclass(frozen=True, slots=True)
class Envelope:
    """When a frame left, and which of the frames of that instant it is.

    ``sent_ns`` is the logical send time in true emulated time (ns since the start of the run);
    ``incarnation`` counts the sender's lives; ``copy`` counts frames of one kind to one address on one medium
    sent at the same instant; ``seq`` counts the sender's frames and only serves to find gaps. ``put_ns`` is the host's
    monotonic clock at the put, 0 if unknown: it only serves to measure the host.
    """

    sent_ns: int
    incarnation: int = 0
    copy: int = 0
    seq: int = 0
    put_ns: int = 0

    def pack(self) -> bytes:
        """24 bytes, little-endian; raises ``WireError`` (``range``) for a value that does not fit."""
        self._check()
        try:
            return _LAYOUT.pack(self.sent_ns, self.incarnation, self.copy, self.seq, self.put_ns)
        except struct.error as error:
            raise WireError("range", str(error)) from None

    @classmethod
    def unpack(cls, data: bytes) -> Envelope:
        """The envelope in an attachment; raises ``WireError`` (``envelope``, ``range``) otherwise."""
        if not isinstance(data, bytes) or len(data) != _LAYOUT.size:
            raise WireError("envelope", f"expected {_LAYOUT.size} bytes")
        envelope = cls(*_LAYOUT.unpack(data))
        envelope._check()
        return envelope

    def _check(self) -> None:
        if self.sent_ns < 0 or self.put_ns < 0:
            raise WireError("range", "a time before the start")
