"""Payloads on a serial line (docs/wire.md): each with a check sum, stuffed so that it has no 0, and a 0 at its end.

The stuffing is COBS (Cheshire & Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking 7(2),
1999), the check sum CRC-16/CCITT, begun with 0xFFFF and sent high byte first. Whatever comes between two ends is one
line: after noise the next end begins anew.
"""

from __future__ import annotations

from binascii import crc_hqx
from typing import Final

from trackfield.wire.error import WireError
from trackfield.wire.registry import MAX_BYTES

END: Final = b"\0"
SUM_BYTES: Final = 2
BLOCK: Final = 254
"""The most bytes that one code byte stands before."""
_WHOLE: Final = 255
"""The code of a block of so many bytes; no 0 follows it."""


def most_bytes(size: int) -> int:
    """The longest line, without its end, of a payload of ``size`` bytes."""
    checked = size + SUM_BYTES
    return checked + checked // BLOCK + 1


MOST_BYTES: Final = most_bytes(MAX_BYTES)
"""The longest line of any payload, without its end."""


def framed(payload: bytes) -> bytes:
    """The line that carries this payload, with its end."""
    return stuffed(payload + _sum(payload)) + END


def unframed(line: bytes) -> bytes:
    """The payload of a line, without its end; raises ``WireError`` (``line``) for one that was damaged."""
    if len(line) > MOST_BYTES:
        raise WireError("line", f"more than {MOST_BYTES} bytes")
    checked = unstuffed(line)
    payload, found = checked[:-SUM_BYTES], checked[-SUM_BYTES:]
    if found != _sum(payload):
        raise WireError("line", "its check sum is wrong")
    return payload


def split(begun: bytes, data: bytes) -> tuple[bytes, list[bytes]]:
    """What of a line has come after ``data`` did, and the lines that ended with it, given what had ``begun`` before.

    Lines without a byte are left out: a sender may begin a line with an end, so that noise before it does no harm. A
    line that is too long is cut behind its first byte too many.
    """
    *whole, begun = (begun + data).split(END)
    return begun[: MOST_BYTES + 1], [line[: MOST_BYTES + 1] for line in whole if line]


def stuffed(data: bytes) -> bytes:
    """The same without a 0: before each run of other bytes a code, 1 more than their number."""
    out = bytearray()
    for run in data.split(b"\0"):
        whole = len(run) - len(run) % BLOCK
        for at in range(0, whole, BLOCK):
            out += bytes([_WHOLE]) + run[at : at + BLOCK]
        out += bytes([len(run) - whole + 1]) + run[whole:]
    return bytes(out)


def unstuffed(data: bytes) -> bytes:
    """The inverse of ``stuffed``; raises ``WireError`` (``line``) for what that cannot have made."""
    out, at = bytearray(), 0
    while at < len(data):
        code, run = data[at], data[at + 1 : at + data[at]]
        if len(run) != code - 1 or 0 in run:
            raise WireError("line", "its codes do not fit its bytes")
        at += code
        out += run
        if code < _WHOLE and at < len(data):
            out.append(0)
    return bytes(out)


def _sum(payload: bytes) -> bytes:
    return crc_hqx(payload, 0xFFFF).to_bytes(SUM_BYTES)
