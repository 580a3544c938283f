"""Packets on a line: where one ends and the next begins."""

from __future__ import annotations

from typing import Final, NamedTuple

from trackfield.wire.visca.units import END, LEAST_BYTES, MOST_BYTES

_HEAD: Final = 0x80
"""The bit that the first byte of every packet has."""


def is_packet(data: bytes) -> bool:
    """Whether these bytes can be one packet: begun as one, ended as one, and not too long."""
    length = len(data)
    return LEAST_BYTES <= length <= MOST_BYTES and data[0] >= _HEAD and data.find(END) == length - 1


class Heard(NamedTuple):
    """What came by a line: the ``packets``, what has ``begun`` and not ended yet, and the pieces of ``noise``."""

    begun: bytes
    packets: list[bytes]
    noise: int


def split(begun: bytes, data: bytes) -> Heard:
    """What has come after ``data`` did, given what had ``begun`` before.

    Each FFh ends a piece. One that is no packet is noise: noise before a packet spoils that one, and none after it.
    Of what has not ended no more is kept than is needed to see that it is too long.
    """
    *ended, rest = (begun + data).split(bytes([END]))
    pieces = [piece[:MOST_BYTES] + bytes([END]) for piece in ended]
    packets = [piece for piece in pieces if is_packet(piece)]
    return Heard(rest[:MOST_BYTES], packets, len(pieces) - len(packets))
