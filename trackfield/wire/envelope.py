"""The envelope of a data frame: what identifies and times it, carried as the Zenoh attachment."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from trackfield.wire.error import WireError

_FINAL = struct.Struct("<qHHIq")
_VERSIONED = struct.Struct("<qHHIqI")


@dataclass(frozen=True, slots=True)
class Envelope:
    """When a frame left, which of the frames of that instant it is, and in which version.

    ``sent_ns`` is the logical send time in true emulated time (ns since the start of the run);
    ``incarnation`` counts the sender's lives; ``copy`` counts frames of one kind to one address on one medium
    sent at the same instant; ``seq`` counts the sender's puts and only serves to find gaps. ``put_ns`` is the host's
    monotonic clock at the put, 0 if unknown: it only serves to measure the host.

    ``version`` counts the puts of one frame, from 0: the highest holds, and one without a payload says that the frame
    was taken back. A frame without a version (None) is final.
    """

    sent_ns: int
    incarnation: int = 0
    copy: int = 0
    seq: int = 0
    put_ns: int = 0
    version: int | None = None

    def pack(self) -> bytes:
        """24 bytes, little-endian, 28 with a version; raises ``WireError`` (``range``) for what does not fit."""
        self._check()
        fields = (self.sent_ns, self.incarnation, self.copy, self.seq, self.put_ns)
        try:
            return _FINAL.pack(*fields) if self.version is None else _VERSIONED.pack(*fields, self.version)
        except struct.error as error:
            raise WireError("range", str(error)) from None

    @classmethod
    def unpack(cls, data: bytes) -> Envelope:
        """The envelope in an attachment; raises ``WireError`` (``envelope``, ``range``) otherwise."""
        if not isinstance(data, bytes) or len(data) not in (_FINAL.size, _VERSIONED.size):
            raise WireError("envelope", f"expected {_FINAL.size} or {_VERSIONED.size} bytes")
        envelope = cls(*(_FINAL if len(data) == _FINAL.size else _VERSIONED).unpack(data))
        envelope._check()
        return envelope

    def _check(self) -> None:
        if self.sent_ns < 0 or self.put_ns < 0:
            raise WireError("range", "a time before the start")
