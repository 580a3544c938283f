"""The raw reports of a fix, as bytes: eight of each, little-endian (docs/wire.md)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Final, NamedTuple

from trackfield.wire.passes import MOST_RAW

_ROW: Final = struct.Struct("<HHhH")
_EARLY_S: Final = 0.0001
_DB: Final = 0.01
_WIDTH_S: Final = 0.025
_MOST: Final = 65535


class Raw(NamedTuple):
    """The sensor with this ``number`` in the field's list heard the target pass ``early_s`` before the fix's step."""

    number: int
    early_s: float
    strength_db: float
    width_s: float


def pack(rows: Iterable[Raw]) -> bytes:
    """The last ``MOST_RAW`` of them, without those that are too old to be told."""
    kept = [row for row in rows if 0 <= round(row.early_s / _EARLY_S) <= _MOST]
    return b"".join(_ROW.pack(row.number, *_steps(row)) for row in kept[-MOST_RAW:])


def _steps(row: Raw) -> tuple[int, int, int]:
    """Its numbers but the first, in steps of their resolutions."""
    return round(row.early_s / _EARLY_S), round(row.strength_db / _DB), round(row.width_s / _WIDTH_S)


def unpack(data: bytes) -> tuple[Raw, ...]:
    """The inverse. Raises ``ValueError`` for bytes that end within a report."""
    if len(data) % _ROW.size:
        raise ValueError(f"{len(data)} bytes of raw reports, each of {_ROW.size}")
    rows = _ROW.iter_unpack(data)
    return tuple(Raw(number, early * _EARLY_S, db * _DB, width * _WIDTH_S) for number, early, db, width in rows)
