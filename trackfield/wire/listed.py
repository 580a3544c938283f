"""Sensors in a message: their numbers in a list that both ends know, two little-endian bytes each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def packed(numbers: Iterable[int]) -> bytes:
    """The bytes of these numbers, each below 65536."""
    return b"".join(number.to_bytes(2, "little") for number in numbers)


def unpacked(data: bytes, ids: Sequence[str]) -> tuple[str, ...] | None:
    """The ids with these numbers; None if the list has no such numbers, or one is there twice."""
    found = [int.from_bytes(data[at : at + 2], "little") for at in range(0, len(data), 2)]
    if len(data) % 2 or len(set(found)) < len(found) or any(number >= len(ids) for number in found):
        return None
    return tuple(ids[number] for number in found)
