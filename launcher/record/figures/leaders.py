"""Who led, how often that changed, with how many reports, and how old what the base knew was."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from head.peers.choice import OUT_OF_REACH
from launcher.record.diary import Diary
from launcher.record.figures import terms
from launcher.record.figures.elections import election_metrics, elections
from launcher.record.figures.passes.reigns import reigns
from launcher.record.tables import TrackRow
from launcher.record.views import headline
from launcher.records import MessageRow, Passing, Plan
from trackfield.role import NS, Note
from trackfield.wire.clusters import Merge, Wake
from trackfield.wire.peers import Poll

SENSOR_BYTES: Final = 2
"""Of a sensor's number in a list of them."""


def leaders_metrics(
    plan: Plan, frames: Iterable[MessageRow], tracks: Sequence[TrackRow], diaries: Iterable[Diary] = ()
) -> dict[str, Any]:
    """``leaders`` of metrics.json; zeros and nulls where nobody takes turns at tracking."""
    frames = list(frames)
    own = [row for row in tracks if row.point.source in plan.views[0].sources and not row.point.origin]
    if isinstance(plan.schedule, Passing):
        return _of_passes(plan.schedule, frames, own, _sources(plan, own))
    points = [terms.Point(row.point.source, row.incarnation, row.point.term, row.told_ns) for row in own]
    if not any(point.term for point in points):
        points, frames = [], [row for row in frames if row.kind in terms.KINDS]
    seen = terms.seen(frames, points)
    turns = terms.turns(seen)
    per_step = _sources(plan, own) if turns else {}
    counts = [len(sources) for sources in per_step.values()]
    used, asked = _reports(plan, frames, tracks) if turns else ({}, {})
    return {
        "per_step_mean": _mean(counts),
        "per_step_max": max(counts, default=None),
        "two_leader_steps": sum(count > 1 for count in counts),
        "handovers": sum(turn.how == terms.HAND_OVER for turn in turns),
        "lost_handovers": len(terms.lost_hand_overs(seen)),
        "take_overs": sum(turn.how == terms.TAKE_OVER for turn in turns),
        "false_take_overs": sum(turn.how == terms.TAKE_OVER and turn.false for turn in turns),
        "dissolved": len(seen.over),
        **election_metrics(elections(seen, plan.step_ns)),
        "reports_used": _mean(list(used.values())),
        "reports_asked": _mean(list(asked.values())),
        "out_of_reach_steps": len(out_of_reach(plan, diaries)),
    }


def _of_passes(
    schedule: Passing, frames: Iterable[MessageRow], own: Iterable[TrackRow], per_step: Mapping[int, set[str]]
) -> dict[str, Any]:
    """``leaders`` where clusters hear passes: a term there is a fix, and no reign that could be handed over; reports do
    not come every step.

    With fixed clusters, two lead in a step if they are of one cluster.
    """
    points = [terms.Point(row.point.source, row.incarnation, row.point.term, row.told_ns) for row in own]
    ruled = [reign.turn for reign in reigns(points, schedule.clusters, terms.seen(frames, points).last)]
    counts = [len(sources) for sources in per_step.values()]
    clusters = [set(group) for group in schedule.clusters]
    most = [max((len(sources & group) for group in clusters), default=len(sources)) for sources in per_step.values()]
    return {
        "per_step_mean": _mean(counts),
        "per_step_max": max(counts, default=None),
        "two_leader_steps": sum(count > 1 for count in most),
        "handovers": None,
        "lost_handovers": None,
        "take_overs": sum(turn.how == terms.TAKE_OVER for turn in ruled),
        "false_take_overs": sum(turn.how == terms.TAKE_OVER and turn.false for turn in ruled),
        "dissolved": 0,
        **election_metrics([]),
        "reports_used": None,
        "reports_asked": None,
        "out_of_reach_steps": 0,
    }


def out_of_reach(plan: Plan, diaries: Iterable[Diary]) -> set[int]:
    """The steps at which a leader noted that sensors nearer to the target than those it asks are out of its reach."""
    return {
        plan.step_of(told.key[0])
        for diary in diaries
        for told in diary.told
        if isinstance(told.effect, Note) and told.effect.text.startswith(OUT_OF_REACH)
    }


def _mean(counts: Sequence[int]) -> float | None:
    return float(np.mean(counts)) if counts else None


def _sources(plan: Plan, rows: Iterable[TrackRow]) -> dict[int, set[str]]:
    """Who published a live point of the first tracker for each step."""
    found = defaultdict[int, set[str]](set)
    for row in rows:
        if row.point.tracker == plan.info.trackers[0] and not row.point.lag:
            found[plan.step_of(row.t_ns)].add(row.point.source)
    return found


def _reports(
    plan: Plan, frames: Iterable[MessageRow], tracks: Iterable[TrackRow]
) -> tuple[dict[int, int], dict[int, int]]:
    """By step, how many reports the leader used, and for how many it had asked, where that is known."""
    first = plan.info.trackers[0]
    leading = {
        plan.step_of(row.t_ns): row.point
        for row in headline(plan, tracks)
        if row.point.tracker == first and not row.point.lag
    }
    asked = reports_asked(frames, {step: point.source for step, point in leading.items()}, plan.origin_ns, plan.step_ns)
    return {step: point.reports for step, point in leading.items()}, asked


def reports_asked(
    frames: Iterable[MessageRow], leaders: Mapping[int, str], origin_ns: int, step_ns: int
) -> dict[int, int]:
    """By step, how many sensors its leader asked to measure: by a poll; or its own by its beacon, and those of others
    by their masters.

    Only of steps for which it sent a poll or a beacon, heard or not.
    """
    own: dict[tuple[str, int], int] = {}
    merges = defaultdict[str, dict[tuple[int, str], Merge]](dict)
    for row, message in terms.said(frames):
        match message:
            case Wake() as wake if wake.leader == row.src.encode():
                own[row.src, wake.step] = len(wake.places) if wake.steps else 0
            case Poll() as poll:
                own[row.src, poll.step] = len(poll.sensors) // SENSOR_BYTES
            case Merge():
                merges[row.src][row.sent_ns, row.dst] = message
    found = {}
    for step, leader in leaders.items():
        if (leader, step) in own:
            at_ns, asked = origin_ns + step * step_ns, dict[str, Merge]()
            for (sent_ns, dst), merge in sorted(merges[leader].items(), key=lambda one: one[0]):
                if sent_ns < at_ns:
                    asked[dst] = merge
            held = (one for one in asked.values() if one.step <= step < one.step + one.steps)
            found[step] = own[leader, step] + sum(len(one.sensors) // SENSOR_BYTES for one in held)
    return found


def age_metrics(plan: Plan, tracks: Iterable[TrackRow]) -> dict[str, float | None]:
    """``age_of_information_s``: how old what was known of the target was, of points that were predicted from it.

    Of the live points of the first tracker that say so (``known_step``); null without any.
    """
    first = plan.info.trackers[0] if plan.info.trackers else ""
    ages = [
        (row.point.step - row.point.known_step) * plan.step_ns / NS
        for row in tracks
        if row.point.tracker == first and row.point.known_step is not None and row.point.step is not None
    ]
    if not ages:
        return {"mean": None, "p95": None}
    return {"mean": float(np.mean(ages)), "p95": float(np.quantile(ages, 0.95))}
