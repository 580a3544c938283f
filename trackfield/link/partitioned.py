"""A link cut for a while: some processes cannot be reached by the others, nor reach them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from trackfield.link.fate import FIELD, Fate, Link, Transmission, lost

Cut = tuple[int, int, Sequence[str], str | None]
"""From when until when (ns) these ids are on a side of their own, and on which medium (None: on every one)."""


@dataclass(frozen=True)
class Partitioned:
    """``link``, but for frames sent from ``from`` <= t < ``until`` whose ends are on different sides of a partition of
    their medium.

    Among those inside, and among those outside, it stays as it is. Several partitions may overlap.
    """

    link: Link
    partitions: Sequence[Cut]
    _cuts: tuple[tuple[int, int, frozenset[str], str | None], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        cuts = tuple((begin, end, frozenset(ids), medium) for begin, end, ids, medium in self.partitions)
        object.__setattr__(self, "_cuts", cuts)

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``; the sender spends the same energy for a lost frame."""
        fate = self.link.fate(frame)
        return lost(fate, "partition") if self._cut(frame.src, frame.dst, frame.sent_ns, frame.medium) else fate

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``: that of the link while it is not cut."""
        return self.link.reception(src, dst, size, kind, at_ns, medium)

    def _cut(self, src: str, dst: str, at_ns: int, medium: str) -> bool:
        return any(
            begin <= at_ns < end and (src in ids) != (dst in ids) and on in (medium, None)
            for begin, end, ids, on in self._cuts
        )
