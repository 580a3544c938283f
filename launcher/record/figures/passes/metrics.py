"""``passes`` of metrics.json: how often targets passed, and what trackers made of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from launcher.plan.forecast.hearing.events import Event
from launcher.record.figures.frames import MOST
from launcher.record.figures.passes.ended import Ended, ended
from launcher.record.figures.passes.found import Truth
from launcher.record.tables import TrackRow
from launcher.records import Passing, Plan
from trackfield.world.events import ENOUGH

ERRORS: Final = ("location_m", "speed_m_s", "heading_deg")


def passes_metrics(plan: Plan, tracks: Sequence[TrackRow]) -> dict[str, Any]:
    """``passes`` of metrics.json; zeros and nulls where sensors report no passes."""
    truth, base, ends = Truth(plan), base_of(plan), list[Ended]()
    events = list[Event]()
    if plan.info.hears:
        events, ends = list(truth.events), ended(tracks, base)
    enough = sum(len(event.heard) >= ENOUGH for event in events)
    told = [row for row in tracks if row.point.source == base and row.point.origin]
    return {
        "events": len(events),
        "enough": enough,
        "trackers": {
            name: _of_tracker([one for one in ends if one.row.point.tracker == name], told, truth, enough)
            for name in plan.info.trackers
        },
    }


def base_of(plan: Plan) -> str | None:
    """The process that others tell of their fixes, if there is one."""
    return plan.schedule.base if isinstance(plan.schedule, Passing) else None


def _of_tracker(ends: Sequence[Ended], told: Sequence[TrackRow], truth: Truth, enough: int) -> dict[str, Any]:
    fixes = [truth.fix(one, told) for one in ends if not one.refused]
    true = [fix for fix in fixes if fix.target]
    errors = [fix.errors for fix in true if fix.errors is not None]
    return {
        "fixes": len(fixes),
        "false_fixes": len(fixes) - len(true) if truth.known else None,
        "fixes_per_pass": len(true) / enough if enough else None,
        "refused": dict(sorted(Counter(one.refused for one in ends if one.refused).items())),
        "reports_used": float(np.mean([len(fix.ended.sensors) for fix in fixes])) if fixes else None,
        **{key: _spread(getattr(one, key) for one in errors) for key in ERRORS},
        "delay_s": _spread(fix.after_s for fix in true),
        "base_delay_s": _spread(fix.base_s for fix in true),
    }


def _spread(values: Iterable[float | None]) -> dict[str, float | None]:
    """Mean and maximum of those that are known; a fix may be as far off as numbers go."""
    known = np.array([value for value in values if value is not None and value <= MOST], float)
    return {"mean": float(known.mean()), "max": float(known.max())} if len(known) else {"mean": None, "max": None}
