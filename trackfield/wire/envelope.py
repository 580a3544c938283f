"""The envelope of a data frame: what identifies and times it, carried as the Zenoh attachment."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from trackfield.wire.error import WireError

_FINAL = struct.Struct("<qHHIq")
_VERSIONED = struct.Struct("<qHHIqI")
_LONG = struct.Struct("<qHHIqIq")
LONGEST: Final = _LONG.size
"""Bytes of the longest envelope."""
_BY_SIZE = {form.size: form for form in (_FINAL, _VERSIONED, _LONG)}


@dataclass(frozen=True, slots=True)
class Envelope:
    """When a frame left, which of the frames of that instant it is, and in which version.

    ``sent_ns`` is the logical send time in true emulated time (ns since the start of the run);
    ``incarnation`` counts the sender's lives; ``copy`` counts frames of one kind to one address on one medium
    sent at the same instant; ``seq`` counts the sender's puts and only serves to find gaps. ``put_ns`` is the run's
    clock (the launcher's monotonic one) at the put, 0 if unknown: it only serves to measure the hosts.

    ``version`` counts the puts of one frame, from 0: the highest holds, and one without a payload says that the frame
    was taken back. A frame without a version (None) is final.

    The frame's preamble is ``preamble_ns`` longer than usual; only a frame with a version has a longer one.
    """

    sent_ns: int
    incarnation: int = 0
    copy: int = 0
    seq: int = 0
    put_ns: int = 0
    version: int | None = None
    preamble_ns: int = 0

    def pack(self) -> bytes:
        """24 bytes, little-endian, 28 with a version, 36 with a longer preamble.

        Raises ``WireError`` (``range``) for what does not fit.
        """
        self._check()
        fields = (self.sent_ns, self.incarnation, self.copy, self.seq, self.put_ns)
        try:
            if self.version is None:
                return _FINAL.pack(*fields)
            if not self.preamble_ns:
                return _VERSIONED.pack(*fields, self.version)
            return _LONG.pack(*fields, self.version, self.preamble_ns)
        except struct.error as error:
            raise WireError("range", str(error)) from None

    @classmethod
    def unpack(cls, data: bytes) -> Envelope:
        """The envelope in an attachment; raises ``WireError`` (``envelope``, ``range``) otherwise."""
        form = _BY_SIZE.get(len(data)) if isinstance(data, bytes) else None
        if form is None:
            raise WireError("envelope", f"expected {', '.join(map(str, _BY_SIZE))} bytes")
        envelope = cls(*form.unpack(data))
        envelope._check()
        if form is _LONG and not envelope.preamble_ns:
            raise WireError("range", "a longer preamble that is no longer")
        return envelope

    def _check(self) -> None:
        if self.sent_ns < 0 or self.put_ns < 0:
            raise WireError("range", "a time before the start")
        if self.preamble_ns < 0 or (self.preamble_ns and self.version is None):
            raise WireError("range", "a preamble that no frame has")
