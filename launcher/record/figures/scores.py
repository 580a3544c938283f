"""How well a tracker did: its errors where the truth is known, and in how many of the expected steps it was there."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from launcher.record.figures.verdict import verdict
from launcher.record.tables import Bounds, TrackRow, bound_of
from launcher.records import SENSES, Plan, last_due
from trackfield.filters import metrics as score
from trackfield.filters.types import Array
from trackfield.role import NS

_NOTHING: Final = {
    "rmse": dict.fromkeys(("x", "y", "position", "velocity")),
    "median_error": None,
    "nees": None,
    "nees_band": None,
    "nees_position": None,
    "nees_position_band": None,
    "steps": 0,
}


def scored(
    plan: Plan, rows: Sequence[TrackRow], end_ns: int, bounds: Bounds, lag: int = 0, *, awaited: bool = True
) -> dict[str, Any]:
    """The figures of one tracker in one view, of a run that ended at ``end_ns``; its points come ``lag`` steps later.

    Errors, and the ``bounds`` beside them, are over the instants at which there are both a track
    and a recorded truth; what lies in gaps of the truth stands apart. Each step at which a target is there is expected
    to have a track, also those for which nothing was published; none is if the track is not ``awaited``.
    """
    known = [row for row in rows if row.has_track and row.truth is not None]
    guessed = [row for row in known if row.interpolated]
    known = [row for row in known if not row.interpolated]
    return {
        **(_errors(known) if known else _NOTHING),
        **_beside(known, bounds),
        **_presence(plan, rows, end_ns, lag, awaited=awaited),
        "gap": {"rmse": score.rmse(offsets(guessed)[:, :2]) if guessed else None, "steps": len(guessed)},
    }


def first_in_range(plan: Plan) -> int | None:
    """The first step at which a target is within reach of a sensor; None if none ever is.

    Where the places of sensors or their reach are not known: at which a target is there.
    """
    sensors = [place for place in plan.info.tagged(SENSES) if place.id in plan.reaches]
    at = np.array([(place.x, place.y) for place in sensors]).reshape(-1, 2)
    reach = np.array([plan.reaches[place.id] for place in sensors])
    for step in range(1, last_due(plan.run.end_ns - plan.origin_ns, plan.step_ns, 0.0) + 1):
        t_s = (plan.origin_ns + step * plan.step_ns) / NS
        for state in filter(None, (path.at(t_s) for path in plan.paths.values())):
            if not sensors or (np.hypot(*(at - state[:2]).T) <= reach).any():
                return step
    return None


def detection_s(plan: Plan, rows: Iterable[TrackRow], reached: int | None) -> float | None:
    """How long after the step at which a target is first in range (``first_in_range``) a track of it was known first.

    A track of which the truth is known counts if it is near enough, others do not. None: there never was one.
    """
    if reached is None:
        return None
    from_ns = plan.origin_ns + reached * plan.step_ns
    told = [
        row.told_ns for row in rows if row.has_track and row.t_ns >= from_ns and _worst([row]) <= plan.lost.beyond_m
    ]
    return (min(told) - from_ns) / NS if told else None


def offsets(rows: Sequence[TrackRow]) -> Array:
    """(n, 4) estimate minus truth."""
    offsets: Array = np.array([row.point.mean for row in rows]) - np.array([row.truth for row in rows])
    return offsets


def _errors(rows: Sequence[TrackRow]) -> dict[str, Any]:
    errors, covariances = offsets(rows), np.array([row.point.covariance for row in rows]).reshape(-1, 4, 4)
    return {
        "rmse": {
            "x": score.rmse(errors[:, 0:1]),
            "y": score.rmse(errors[:, 1:2]),
            "position": score.rmse(errors[:, :2]),
            "velocity": score.rmse(errors[:, 2:]),
        },
        "median_error": score.median_error(errors[:, :2]),
        **_consistency("nees", errors, covariances),
        **_consistency("nees_position", errors[:, :2], covariances[:, :2, :2]),
        "steps": len(rows),
    }


def _consistency(name: str, errors: Array, covariances: Array) -> dict[str, Any]:
    """The mean NEES of errors (n, d), and the band in which it lies if covariances (n, d, d) are right."""
    nees = score.nees(errors, covariances)
    if not np.isfinite(nees).all():
        return {name: None, f"{name}_band": None}
    band = score.nees_band(errors.shape[1], score.effective_count(nees))
    return {name: float(nees.mean()), f"{name}_band": list(band)}


def _beside(rows: Sequence[TrackRow], bounds: Bounds) -> dict[str, float | None]:
    """The bound, and the error divided by it, both over the instants that have a bound."""
    found = [(row, bound_of(row, bounds)) for row in rows]
    bounded = [row for row, bound in found if bound is not None]
    if not bounded:
        return {"bound_m": None, "times_bound": None}
    bound_m = score.rmse(np.array([[bound] for _, bound in found if bound is not None]))
    return {"bound_m": bound_m, "times_bound": score.rmse(offsets(bounded)[:, :2]) / bound_m}


def _presence(plan: Plan, rows: Sequence[TrackRow], end_ns: int, lag: int, *, awaited: bool) -> dict[str, Any]:
    """In how many of the expected steps there was a track, and one that was near enough; and the verdict.

    Where sensors report by themselves, the passes of targets are expected; where nobody knows of any target, every step
    is, and none can be judged.
    """
    tracks = defaultdict[int, list[TrackRow]](list)
    for row in rows:
        if row.has_track:
            tracks[round((row.t_ns - plan.origin_ns) / plan.step_ns)].append(row)
    last = last_due(end_ns - plan.origin_ns, plan.step_ns, plan.deadline_s) - lag
    passes = plan.pass_steps
    steps = range(1, last + 1) if passes is None else sorted(step for step in passes if step <= last)
    there = {k: recorded for k in steps if awaited and (recorded := _recorded(plan, k)) is not None}
    if not plan.paths:
        return _without_truth(plan, list(there), tracks)
    judged = [k for k, recorded in there.items() if recorded and not _only_guessed(tracks.get(k, ()))]
    errors = np.array([_worst(tracks.get(k, ())) for k in judged]).reshape(-1, 1)
    share = float((errors <= plan.lost.beyond_m).mean()) if judged else None
    lost = bool(judged and plan.lost.holds(errors))
    blackout = _longest([k for k in there if k not in tracks])
    return {
        "verdict": verdict(lost=lost, share_within=share, blackout_steps=blackout),
        "lost": lost,
        "steps_expected": len(judged),
        "steps_tracked": int(np.isfinite(errors).sum()),
        "share_within": share,
        "longest_blackout_s": blackout * plan.step_ns / NS,
    }


def _without_truth(plan: Plan, steps: Sequence[int], tracks: Collection[int]) -> dict[str, Any]:
    """The same of a run in which nobody knows where the target was."""
    tracked = [k for k in steps if k in tracks]
    return {
        "verdict": None,
        "lost": False,
        "steps_expected": len(steps),
        "steps_tracked": len(tracked),
        "share_within": None,
        "longest_blackout_s": _longest([k for k in steps if k not in tracks]) * plan.step_ns / NS,
    }


def _recorded(plan: Plan, step: int) -> bool | None:
    """Whether any target's place at a step was recorded, not interpolated in a gap; None if no target is there."""
    if not plan.paths:
        return False
    t_s = (plan.origin_ns + step * plan.step_ns) / NS
    present = [path for path in plan.paths.values() if path.at(t_s) is not None]
    return any(not path.interpolated(t_s) for path in present) if present else None


def _only_guessed(rows: Sequence[TrackRow]) -> bool:
    """Whether there are tracks, and all are of targets whose place was interpolated."""
    return bool(rows) and all(row.interpolated for row in rows)


def _worst(rows: Iterable[TrackRow]) -> float:
    """The largest error of the tracks of a step, m; NaN if there is none."""
    known = [row for row in rows if row.truth is not None and not row.interpolated]
    return float(np.linalg.norm(offsets(known)[:, :2], axis=1).max()) if known else np.nan


def _longest(steps: Sequence[int]) -> int:
    """The length of the longest run of consecutive steps."""
    longest = row = min(len(steps), 1)
    for before, step in pairwise(steps):
        row = row + 1 if step == before + 1 else 1
        longest = max(longest, row)
    return longest
