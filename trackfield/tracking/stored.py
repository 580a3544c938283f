"""What a fusion centre stores for its next life: MessagePack ``[version, step, threshold, {tracker: belief}]``.

``threshold`` is in dB or nil. A belief over (x, y, vx, vy) is nil while there is no track, else 14 little-endian
float64: the mean, and the covariance's upper triangle row by row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Final

import msgpack
import numpy as np

from trackfield.filters.types import Gaussian
from trackfield.role import TrackPoint

VERSION: Final = 1
_UPPER: Final = np.triu_indices(4)


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """The last step fused, the threshold set, and each tracker's belief."""

    step: int
    threshold_db: float | None
    beliefs: Mapping[str, Gaussian | None]


def pack(step: int, threshold_db: float | None, points: Mapping[str, TrackPoint]) -> bytes:
    """The bytes for a step's published points, by tracker."""
    beliefs = {name: _pack(point) if point.mean else None for name, point in points.items()}
    packed: bytes = msgpack.packb((VERSION, step, threshold_db, beliefs))
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
        raise ValueError(f"version {version}")
    if type(step) is not int or step < 0:
        raise ValueError(f"step {step}")
    if threshold_db is not None and not (type(threshold_db) is float and isfinite(threshold_db)):
        raise ValueError(f"threshold {threshold_db}")
    if type(beliefs) is not dict:
        raise ValueError("no beliefs")
    return Stored(step, threshold_db, {name: _unpack(belief) for name, belief in beliefs.items()})


def _pack(point: TrackPoint) -> bytes:
    covariance = np.reshape(point.covariance, (4, 4))
    return np.concatenate((point.mean, covariance[_UPPER])).astype("<f8").tobytes()


def _unpack(belief: object) -> Gaussian | None:
    if belief is None:
        return None
    if type(belief) is not bytes or len(belief) != 14 * 8:
        raise ValueError("a belief that is not 14 numbers")
    numbers = np.frombuffer(belief, "<f8").astype(float)
    if not np.isfinite(numbers).all():
        raise ValueError("a belief that is not finite")
    covariance = np.zeros((4, 4))
    covariance[_UPPER] = numbers[4:]
    covariance = covariance + np.triu(covariance, 1).T
    variances = np.linalg.eigvalsh(covariance)
    if variances[0] < -1e-6 * abs(variances[-1]):
        raise ValueError("a belief with a negative variance")
    return Gaussian(numbers[:4], covariance)
