"""Versions of frames: a frame that should not have left is taken back, or replaced, by a later version of it.

A sample is an identity, a version, and a payload or nothing. Whatever the order in which samples arrive, the highest
version holds; so what a receiver knows in the end does not depend on the order (Jefferson 1985: an antimessage
annihilates its message whichever comes first).
"""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import blake2b
from typing import Final, NamedTuple

from trackfield.drivers.engine.frames import Frame, Identity
from trackfield.wire.error import WireError

SEEN: Final = 10_000
"""So many frames are remembered, however old they are."""
_MODULUS: Final = 1 << 63


class Taken(NamedTuple):
    """The latest version of a frame (None: it has none and is final), and when it came; a frame without a payload was
    taken back.
    """

    version: int | None
    frame: Frame
    came_ns: int


class Versions:
    """The latest version of each frame that came within ``keep_ns``, and of the latest ``SEEN`` frames."""

    def __init__(self, keep_ns: int) -> None:
        self.keep_ns = keep_ns
        self._known: dict[Identity, Taken] = {}

    def take(self, frame: Frame, version: int | None, now_ns: int) -> tuple[bool, Taken | None]:
        """Whether this sample is news, and what it replaces, unless that was taken back, or repeats.

        Raises ``WireError`` (``conflict``) for another payload of a version that came before, and for another version
        of a frame that is final: one of the two is forged.
        """
        identity = frame.identity
        before = self._known.get(identity)
        if before is not None:
            if (before.version is None) != (version is None):
                raise WireError("conflict", "another version of a frame that is final")
            if before.version == version and before.frame.payload != frame.payload:
                raise WireError("conflict", "the same frame came with another payload")
            if (version or 0) <= (before.version or 0):
                return False, before if before.version == version else None
        if version is None and not frame.payload:
            raise WireError("malformed", "a frame without a version cannot be taken back")
        if before is not None:
            del self._known[identity]
        self._known[identity] = Taken(version, frame, now_ns)
        self._forget(now_ns - self.keep_ns)
        return True, before if before is not None and before.frame.payload else None

    def _forget(self, until_ns: int) -> None:
        while len(self._known) > SEEN:
            oldest = next(iter(self._known))
            if self._known[oldest].came_ns > until_ns:
                return
            del self._known[oldest]


class Digest(NamedTuple):
    """How many frames, and the sum of their hashes: equal for equal sets, whatever the order in which they came."""

    size: int = 0
    total: int = 0

    def plus(self, frame: Frame, version: int | None) -> Digest:
        """With this version of a frame."""
        return Digest(self.size + 1, (self.total + hash_of(frame, version)) % _MODULUS)

    def minus(self, frame: Frame, version: int | None) -> Digest:
        """Without it."""
        return Digest(self.size - 1, (self.total - hash_of(frame, version)) % _MODULUS)


def hash_of(frame: Frame, version: int | None) -> int:
    """63 bits that stand for this version of a frame."""
    src, incarnation, kind, sent_ns, copy, to, medium = frame.identity
    text = f"{src}\0{incarnation}\0{kind}\0{sent_ns}\0{copy}\0{to}\0{medium}\0{version}"
    return int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "little") >> 1


class Sum:
    """A digest that grows."""

    __slots__ = ("_count", "_total")

    def __init__(self) -> None:
        self._count = self._total = 0

    def add(self, hashed: int) -> None:
        """Another frame, by its hash."""
        self._count += 1
        self._total += hashed

    @property
    def digest(self) -> Digest:
        """Of all that were added."""
        return Digest(self._count, self._total % _MODULUS)


def digest(frames: Iterable[tuple[Frame, int | None]]) -> Digest:
    """Of all of these."""
    total = Digest()
    for frame, version in frames:
        total = total.plus(frame, version)
    return total
