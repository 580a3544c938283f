"""Views: the processes whose tracks are scored together, with one point for each instant."""

from __future__ import annotations

from collections.abc import Iterable

from launcher.record.tables import TrackRow
from launcher.records import Plan, View


def seen(rows: Iterable[TrackRow], view: View) -> list[TrackRow]:
    """A view's rows: of each (tracker, target, instant) the one of the highest term, of equal ones the first told."""
    held: dict[tuple[str, str, int], TrackRow] = {}
    for row in rows:
        if row.point.source in view.sources:
            key = (row.point.tracker, row.point.target, row.t_ns)
            before = held.get(key)
            if before is None or (-row.point.term, row.told_ns) < (-before.point.term, before.told_ns):
                held[key] = row
    return [held[key] for key in sorted(held)]


def headline(plan: Plan, rows: Iterable[TrackRow]) -> list[TrackRow]:
    """The rows of the plan's first view."""
    return seen(rows, plan.views[0])
