"""What a process that tracks stores for its next life: MessagePack ``[version, step, threshold, {tracker: belief}]``.

``threshold`` is in dB or nil. A belief is ``[form, n, bytes]`` (``trackfield/filters/belief.py``). It is nil while
there is no track, and for a track so far off that float32 cannot hold it: the next life then starts from reports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final

import msgpack

from trackfield.filters import belief
from trackfield.filters.belief import Belief

VERSION: Final = 2


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """The last step fused, the threshold set, and each tracker's belief."""

    step: int
    threshold_db: float | None
    beliefs: Mapping[str, Belief | None]


def pack(step: int, threshold_db: float | None, beliefs: Mapping[str, Belief | None]) -> bytes:
    """The bytes for the beliefs after a step, by tracker."""
    packed: bytes = msgpack.packb((VERSION, step, threshold_db, {name: _pack(one) for name, one in beliefs.items()}))
    return packed


def unpack(data: bytes) -> Stored:
    """The inverse of ``pack``; raises ``ValueError`` with a reason for any other bytes."""
    try:
        fields = msgpack.unpackb(data)
    except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
        raise ValueError(f"not MessagePack: {error}") from None
    if type(fields) is not list or len(fields) != 4:
        raise ValueError("not an array of version, step, threshold and beliefs")
    version, step, threshold_db, beliefs = fields
    if version != VERSION:
        raise ValueError(f"version {version}; expected {VERSION}")
    if type(step) is not int or step < 0:
        raise ValueError(f"step {step}")
    if threshold_db is not None and not (type(threshold_db) is float and isfinite(threshold_db)):
        raise ValueError(f"threshold {threshold_db}")
    if type(beliefs) is not dict:
        raise ValueError("no beliefs")
    return Stored(step, threshold_db, {name: _unpack(one) for name, one in beliefs.items()})


def _pack(one: Belief | None) -> tuple[int, int, bytes] | None:
    if one is None:
        return None
    try:
        return belief.form_of(one), belief.dimension(one), belief.pack(one)
    except ValueError:
        return None


def _unpack(fields: Any) -> Belief | None:
    if fields is None:
        return None
    if type(fields) is not list or [type(field) for field in fields] != [int, int, bytes]:
        raise ValueError("a belief that is not an array of form, dimension and bytes")
    return belief.unpack(*fields)
