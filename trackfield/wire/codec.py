"""Messages to bytes and back: a MessagePack array of integers and bytes, ``[version, kind, field, ...]``."""

from __future__ import annotations

from typing import Any, Final

import msgpack

from trackfield.wire.error import WireError
from trackfield.wire.registry import MAX_BYTES, Bytes, check_size, kind_by_number, kind_of, kinds

__all__ = ["MAX_BYTES", "VERSION", "WireError", "bare_kinds", "decode", "decoded", "encode", "kind_name"]

VERSION: Final = 1


def encode(message: object) -> bytes:
    """The payload of a message, its numbers rounded to their resolution.

    Raises ``WireError`` for an object that is not a message (``kind``), for a field of the wrong type (``type``) or
    out of range (``range``; also NaN and infinity), and for too many numbers (``fields``).
    """
    kind = kind_of(message)
    packed: bytes = msgpack.packb((VERSION, kind.number, *kind.pack(message)))
    return packed


def decode(data: bytes) -> Any:
    """The message in a payload; raises ``WireError`` for anything else, whatever the bytes are.

    A number or the length of bytes may have a longer form than needed: small devices often use fixed widths.
    """
    if not isinstance(data, bytes):
        raise WireError("type", f"payload: {type(data).__name__}")
    if len(data) > MAX_BYTES:
        raise WireError("size", f"{len(data)} bytes, at most {MAX_BYTES}")
    try:
        array = msgpack.unpackb(data)
    except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
        raise WireError("malformed", str(error)) from None
    if type(array) is not list or len(array) < 2:
        raise WireError("malformed", "not an array of version, kind and fields")
    version, number, *values = array
    if type(version) is not int:
        raise WireError("type", f"version: {type(version).__name__}")
    if version != VERSION:
        raise WireError("version", str(version))
    kind = kind_by_number(number)
    check_size(kind.name, len(data))
    return kind.unpack(values)


def decoded(data: bytes) -> Any:
    """The same, but None for what is no message."""
    try:
        return decode(data)
    except WireError:
        return None


def kind_name(message: object) -> str:
    """The name of a message's kind, as in its key; raises ``WireError`` (``kind``)."""
    return kind_of(message).name


def bare_kinds() -> dict[str, int]:
    """By how many bytes the payload of a bare kind (``Kind``) is longer than what travels on a serial line."""
    bare = ((one, field) for one in kinds() if one.bare for field in one.fields if isinstance(field, Bytes))
    return {one.name: len(encode(one.longest())) - field.blob.most for one, field in bare}
