"""``camera`` of metrics.json: what became of fixes beyond the gateway, and whether targets were in the picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from launcher.outside import ANSWERS, LOST, OUTCOMES, Counts, Known, Outside
from launcher.record.figures.camera.judged import REPLACED, Judge, Shot
from launcher.record.figures.frames import MOST
from trackfield.role import NS
from trackfield.world.path import Path

COUNTED: Final = ("passed", "refused", "dropped", "unwanted")
"""What a gateway counts."""


def camera_metrics(outside: Outside | None, paths: Mapping[str, Path], end_ns: int) -> dict[str, Any] | None:
    """``camera`` of metrics.json, of a run that ended at ``end_ns``; None without a camera."""
    if outside is None:
        return None
    shots = Judge(outside, paths, end_ns).shots
    outcomes, answers = (
        Counter(one.outcome for one in outside.aims),
        Counter(one.answer for one in outside.orders),
    )
    errors = [shot.error for shot in shots if shot.error is not None]
    return {
        "fixes": len(outside.aims),
        "shots": len(shots),
        "replaced": sum(shot.why == REPLACED for shot in shots),
        "outcomes": {name: outcomes[name] for name in OUTCOMES if outcomes[name]},
        "in_frame": _in_frame(shots),
        "delay_s": _spread(shot.aim.delay_s for shot in shots),
        "slew_s": _spread(shot.slew_s for shot in shots),
        "first_seen_s": _spread(shot.first_seen_s for shot in shots),
        "place_m": _spread(one.place_m for one in errors),
        "pan_deg": _spread(abs(one.pan_deg) for one in errors),
        "tilt_deg": _spread(abs(one.tilt_deg) for one in errors),
        "lost": _lost(outside.states, end_ns),
        "gateway": _gateway(outside.counts),
        "orders": {answer: answers[answer] for answer in ANSWERS},
        "refused_orders": len(outside.refusals),
        "targets": {id: _of_target(shots, id) for id in paths} if len(paths) > 1 else {},
    }


def _in_frame(shots: Sequence[Shot]) -> dict[str, Any]:
    aims = [shot for shot in shots if shot.judged]
    frames = [seen for shot in shots for _, seen in shot.frames]
    filmed = [shot for shot in shots if shot.frames]
    return {
        "at_aim": _share(sum(bool(shot.in_frame) for shot in aims), len(aims)),
        "aims": len(aims),
        "frames": _share(sum(frames), len(frames)),
        "frames_n": len(frames),
        "shots": _share(sum(any(seen for _, seen in shot.frames) for shot in filmed), len(filmed)),
    }


def _of_target(shots: Sequence[Shot], id: str) -> dict[str, Any]:
    """Of the shots that are of this target."""
    own = [shot for shot in shots if shot.target == id]
    return {"n": len(own), **_in_frame(own)}


def _lost(states: Sequence[Known], end_ns: int) -> dict[str, Any]:
    """How often camera control lost the camera, and for how long."""
    times, lost_ns, since = 0, 0, None
    for one in states:
        if one.state == LOST and since is None:
            times, since = times + 1, one.t_ns
        elif one.state != LOST and since is not None:
            lost_ns, since = lost_ns + one.t_ns - since, None
    return {"times": times, "s": (lost_ns + (end_ns - since if since is not None else 0)) / NS}


def _gateway(counts: Sequence[Counts]) -> dict[str, Any]:
    """What the gateway counted in all of its lives, and the most items that waited."""
    last = {one.life: one for one in counts}
    sums = {name: sum(getattr(one, name) for one in last.values()) for name in COUNTED}
    return {**sums, "queue_max": max((one.waiting for one in counts), default=0)}


def _share(some: int, of: int) -> float | None:
    return some / of if of else None


def _spread(values: Iterable[float | None]) -> dict[str, float | None]:
    """Mean, the value that 95 % stay below, and maximum, of those that are known; a turn may last for ever."""
    known = np.array([value for value in values if value is not None and value <= MOST], float)
    if not len(known):
        return {"mean": None, "p95": None, "max": None}
    return {"mean": float(known.mean()), "p95": float(np.quantile(known, 0.95)), "max": float(known.max())}
