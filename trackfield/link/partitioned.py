"""A link while some cannot be reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from trackfield.link.fate import Fate, Link


class Partitioned:
    """``link``, but a frame between one of the ids of a partition and anybody else is lost while it lasts."""

    def __init__(self, link: Link, partitions: Sequence[tuple[int, int, Sequence[str]]]) -> None:
        self.link = link
        self._partitions = [(begin, until, frozenset(ids)) for begin, until, ids in partitions]

    def fate(self, src: str, dst: str, kind: str, sent_ns: int, copy: int, size: int, broadcast: bool = False) -> Fate:
        """See ``Link.fate``."""
        fate = self.link.fate(src, dst, kind, sent_ns, copy, size, broadcast)
        for begin, until, ids in self._partitions:
            if begin <= sent_ns < until and (src in ids) != (dst in ids):
                return replace(fate, cause="partition", delay_ns=0, ack_bytes=0, ack_air_ns=0)
        return fate

    def reception(self, src: str, dst: str, size: int) -> float:
        """See ``Link.reception``."""
        return self.link.reception(src, dst, size)
