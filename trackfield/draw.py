"""Random draws keyed by their purpose: no running stream, so a skipped step or a replay does not shift later draws.

Every draw hashes ``(seed, *key)`` with BLAKE2b; equal keys give equal draws in every process and driver.
Only the standard library: nodes use it.
"""

from __future__ import annotations

from hashlib import blake2b
from statistics import NormalDist

Key = str | int

_STANDARD = NormalDist()


def bits(seed: int, *key: Key) -> int:
    """64 uniformly distributed bits for this key."""
    text = "\x1f".join(map(str, (seed, *key)))
    return int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "little")


def uniform(seed: int, *key: Key) -> float:
    """A draw from the open interval (0, 1)."""
    return ((bits(seed, *key) >> 12) + 0.5) / (1 << 52)


def normal(seed: int, *key: Key) -> float:
    """A draw from N(0, 1)."""
    return _STANDARD.inv_cdf(uniform(seed, *key))
