"""What the base of a field knew, and how old that was: for comparing fields whatever their processes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from launcher.record.figures.periods import PRESENT, spans_of
from launcher.record.tables import TrackRow
from launcher.record.views import seen
from launcher.records import BASE, Plan, View
from trackfield.role import NS

_GRID: Final = 100
"""Points between two publications at which an age is looked at, for its quantiles."""


def base_view(plan: Plan) -> View:
    """The view of the base; the headline, where an architecture has none of that name."""
    return next((view for view in plan.views if view.name == BASE), plan.views[0])


def base_rows(plan: Plan, tracks: Iterable[TrackRow]) -> list[TrackRow]:
    """The live points of the first tracker at the base."""
    first = plan.info.trackers[0] if plan.info.trackers else ""
    return [row for row in seen(tracks, base_view(plan)) if row.point.tracker == first and not row.point.lag]


def base_age(plan: Plan, rows: Sequence[TrackRow], end_ns: int) -> dict[str, Any]:
    """The age (s) of what the base knew of the target, over the time in which one was there: mean and 95 %.

    At each instant: how long ago the last step was up to which reports are in any point that it had published. The
    time before its first track does not count.
    """
    told = sorted((row.told_ns, _known_ns(plan, row)) for row in rows if row.has_track)
    ages: list[tuple[float, float]] = []
    for span in spans_of(plan, end_ns):
        if span.period == PRESENT:
            ages += _ages(told, span.begin_ns, span.end_ns)
    if not ages:
        return dict.fromkeys(("base_mean", "base_p95"))
    begin, lasted = np.array(ages).T
    grid = (np.arange(_GRID) + 0.5) / _GRID
    points, weights = (begin[:, None] + lasted[:, None] * grid).ravel(), np.repeat(lasted / _GRID, _GRID)
    order = np.argsort(points)
    reached = np.cumsum(weights[order]) / weights.sum()
    p95 = points[order][min(int(np.searchsorted(reached, 0.95)), len(order) - 1)]
    return {"base_mean": float(np.average(begin + lasted / 2, weights=lasted)), "base_p95": float(p95)}


def _ages(told: Sequence[tuple[int, int]], begin_ns: int, end_ns: int) -> list[tuple[float, float]]:
    """(age at its beginning, duration) of each stretch without news in this time, s."""
    found, known_ns = [], None
    for place, (told_ns, now_ns) in enumerate(told):
        known_ns = now_ns if known_ns is None else max(known_ns, now_ns)
        next_ns = told[place + 1][0] if place + 1 < len(told) else end_ns
        a, b = max(told_ns, begin_ns), min(next_ns, end_ns)
        if a < b:
            found.append(((a - known_ns) / NS, (b - a) / NS))
    return found


def _known_ns(plan: Plan, row: TrackRow) -> int:
    """The instant of the last step of whose reports a point knows."""
    known = row.point.known_step
    return row.t_ns if known is None else plan.origin_ns + known * plan.step_ns
