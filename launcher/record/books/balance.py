"""What the ledger found, beside what each life counted and said in its final record.

Frames are compared by count and hash, so that sets of equal size that are not the same are found, too.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from trackfield.drivers.exchange.versions import Digest, Sum

Finals = Mapping[str, Mapping[str, Any]]
"""Final records by life."""


class Missed(NamedTuple):
    """Frames that a life should have and has not: ``lost`` on the way, or ``late``, when nothing could be undone.

    ``more`` are those that it has and should not have, unless they were taken back too late for it. ``uncounted`` are
    such late ones of both sorts that the life itself did not count: they came after its final record.
    """

    lost: int = 0
    late: int = 0
    more: int = 0
    uncounted: int = 0


class Balance:
    """What was seen of each life, and by which lives it should have been heard.

    ``puts``, of frames that are settled; ``live``, what is left of them; ``due``, what each life should have got;
    ``late``, puts that came when their frame was settled; ``tardy``, puts for a life that came after its final record;
    ``told``, pieces of telemetry.
    """

    def __init__(self) -> None:
        self.puts: Counter[str] = Counter()
        self.late: Counter[str] = Counter()
        self.tardy: Counter[str] = Counter()
        self.told: Counter[str] = Counter()
        self.live: defaultdict[str, Sum] = defaultdict(Sum)
        self.due: defaultdict[str, Sum] = defaultdict(Sum)

    def strange_frames(self, finals: Finals) -> int:
        """Puts that were seen and that no life says it made, at least."""
        return sum(max(-gap, self._other(name, record, gap)) for name, record, gap in self._gaps(finals))

    def dropped(self, finals: Finals) -> int:
        """Puts that left a life and never reached the recorder, at least."""
        return sum(max(gap, self._other(name, record, gap)) for name, record, gap in self._gaps(finals))

    def strange_telemetry(self, finals: Finals) -> int:
        """Pieces of telemetry that were seen and that no life says it sent."""
        return sum(max(self.told[name] - record["told"], 0) for name, record in finals.items() if "told" in record)

    def untold(self, finals: Finals) -> int:
        """Pieces of telemetry that never reached the recorder."""
        return sum(max(record["told"] - self.told[name], 0) for name, record in finals.items() if "told" in record)

    def unseen(self, finals: Finals) -> int:
        """Frames that left a life, were not taken back, and never reached the recorder."""
        return sum(max(r.get("sent", 0) - _of(self.live, name).size, 0) for name, r in finals.items())

    def missed(self, finals: Finals) -> Missed:
        """All lives together."""
        found = [self._missed(name, record) for name, record in finals.items() if "heard" in record]
        return Missed(*map(sum, zip(*found, strict=True))) if found else Missed()

    def _gaps(self, finals: Finals) -> Iterator[tuple[str, Mapping[str, Any], int]]:
        """How many puts of each life were not seen; below 0: of how many more than it made."""
        for name, record in finals.items():
            if "puts" in record:
                yield name, record, record["puts"] - self.puts[name] - self.late[name]

    def _other(self, name: str, record: Mapping[str, Any], gap: int) -> bool:
        """Whether as many puts were seen as were made, and others."""
        if gap or self.late[name]:
            return False
        live = _of(self.live, name)
        return live != (record["sent"], record.get("sent_hash", live.total))

    def _missed(self, name: str, record: Mapping[str, Any]) -> Missed:
        """If count and hash differ, at least as many are missing, or too many, as the counts differ by, and one."""
        due = _of(self.due, name)
        if due == (record["heard"], record.get("heard_hash", due.total)):
            return Missed()
        short, over = max(due.size - record["heard"], 0), max(record["heard"] - due.size, 0)
        short += not short and not over
        counted, late = record.get("host_late", 0), record.get("host_late", 0) + self.tardy[name]
        short_late = min(short, late)
        over_late = min(over, late - short_late)
        uncounted = max(short_late + over_late - counted, 0)
        return Missed(short - short_late, short_late, over - over_late, uncounted)


def _of(sums: Mapping[str, Sum], name: str) -> Digest:
    return sums[name].digest if name in sums else Digest()
