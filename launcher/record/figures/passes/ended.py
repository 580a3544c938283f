"""How trackers ended the events of a run: by a fix, or why there is none."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import NamedTuple

from launcher.record.tables import TrackRow


class Ended(NamedTuple):
    """The point in which a tracker says how an event ended, and whose reports (ids) it had since the one before."""

    row: TrackRow
    sensors: tuple[str, ...]

    @property
    def event_ns(self) -> int:
        """When the target was nearest to the middle of the sensors or, without a fix, the mean time of the reports."""
        assert self.row.point.event_ns is not None
        return self.row.point.event_ns

    @property
    def refused(self) -> str:
        """Why there is no fix; empty: there is one."""
        return self.row.point.refused


def ended(rows: Iterable[TrackRow], base: str | None = None) -> list[Ended]:
    """The events in the order of their ends. A ``base`` is only told of them, by those that solve."""
    by_track = defaultdict[tuple[str, str], list[TrackRow]](list)
    for row in rows:
        if not row.point.origin and row.point.source != base and not row.point.lag:
            by_track[row.point.source, row.point.tracker].append(row)
    found = [one for own in by_track.values() for one in _of_track(sorted(own, key=lambda row: row.t_ns))]
    return sorted(found, key=lambda one: (one.row.t_ns, one.row.point.source, one.row.point.tracker))


def _of_track(rows: Iterable[TrackRow]) -> Iterable[Ended]:
    heard: dict[str, None] = {}
    for row in rows:
        heard.update(dict.fromkeys(row.point.sensors))
        if row.point.event_ns is not None:
            yield Ended(row, tuple(heard))
            heard = {}
