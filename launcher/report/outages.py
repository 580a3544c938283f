"""Stretches of a run without a track, and why there was none; reports that did not come in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Final

import numpy as np

from launcher.record.words import losses, span, uninformed
from launcher.records import TRACKS
from launcher.report.folder import Run
from launcher.report.tracks import Array, Track
from trackfield.role import NS
from trackfield.wire.keys import id_of

SETTLING: Final = 3
"""Steps that a centre may need for a track once it is back, before the report explains why there is none."""
FEW: Final = 0.5
"""If a smaller share of the reports came in time, the report says so at its top."""


@dataclass(frozen=True)
class Outage:
    """Consecutive steps, at ``t_s`` (n,), with a track expected and none there; each lasts ``step_s``."""

    t_s: Array
    step_s: float

    @property
    def seconds(self) -> float:
        """How long it was."""
        return len(self.t_s) * self.step_s


@dataclass(frozen=True)
class Down:
    """The process ``id``, which tracks, was down from ``from_s`` until ``until_s``; ``text`` says why."""

    id: str
    from_s: float
    until_s: float
    text: str


def outages(run: Run, track: Track) -> list[Outage]:
    """The outages of a track, in the order of time; the last steps of a smoothed one are not expected."""
    at = track.t_s[track.expected]
    missing = ~track.known[track.expected]
    missing[max(len(missing) - track.lag, 0) :] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], missing.view(np.int8), [0]])))
    return [Outage(at[begin:end], run.step_s) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def in_words(run: Run, track: Track) -> str:
    """How long there was no track, and why, in a sentence; empty if there was always one."""
    found = outages(run, track)
    if not found:
        return ""
    longest = max(found, key=lambda one: one.seconds)
    cause = why(run, longest, track.lag)
    if len(found) == 1:
        return f"{span(longest.seconds)} without a track{cause}."
    total = sum(one.seconds for one in found)
    return f"{span(total)} without a track, in {len(found)} stretches; the longest, {span(longest.seconds)}{cause}."


def never(run: Run, lag: int = 0) -> str:
    """A sentence that says that there was no track at all, and why; ``lag`` as ``Track`` has it."""
    times = (np.array(run.course.at_ns, float) - run.site.origin_ns) / NS
    times = times[: max(len(times) - lag, 0)]
    if not len(times):
        return "The run ended before a track was due."
    cause = why(run, Outage(times, run.step_s), lag)
    return f"No track of {'a' if run.several else 'the'} target at any of the {len(times):,} steps{cause}."


def told_late(run: Run, track: Track) -> str:
    """A sentence that says how many steps were published more than a step late, and why; empty if none was."""
    due_s = track.t_s + run.scenario.fusion.deadline_s + track.lag * run.step_s
    late_s = np.where(track.known & track.expected, track.told_s - due_s, 0.0)
    slow = late_s > run.step_s
    if track.whole or not slow.any():
        return ""
    causes = [one.text for one in downs(run) if ((one.from_s <= due_s) & (due_s < one.until_s))[slow].any()]
    steps = "1 step was" if slow.sum() == 1 else f"{slow.sum():,} steps were"
    cause = f": {'; '.join(causes)}" if causes else ""
    return f"{steps} published more than a step late, by up to {span(late_s.max())}{cause}."


def why(run: Run, outage: Outage, lag: int = 0) -> str:
    """The reason: processes that were down, then what became of the reports of steps that this does not explain.

    It explains a step if nobody was up who fuses reports, or nobody of the headline view. A smoothed track is published
    ``lag`` steps later: a process that dies before that never publishes it.
    """
    lag_s = lag * run.step_s
    told_s = outage.t_s + run.scenario.fusion.deadline_s + lag_s
    end_s = outage.t_s[-1] + outage.step_s + lag_s
    causes = [one for one in downs(run) if one.from_s < end_s and one.until_s > outage.t_s[0]]
    down = {one.id: np.zeros(len(told_s), bool) for one in causes}
    for one in causes:
        down[one.id] |= (one.from_s <= told_s) & (outage.t_s < one.until_s)
    nobody = np.zeros(len(told_s), bool)
    for needed in (run.field.fusing, run.field.views[0].sources):
        if needed and down.keys() >= set(needed):
            nobody |= np.all([down[id] for id in needed], axis=0)
    rest = outage.t_s[~nobody]
    said = [one.text for one in causes]
    if not causes or len(rest) > SETTLING:
        said.append(f"{'then ' if causes else ''}{_reports(run, rest)}")
    return f": {'; '.join(said)}"


def downs(run: Run) -> Iterator[Down]:
    """When processes that track were dead or frozen, as planned or not."""
    ids = {place.id for place in run.tagged(TRACKS)}
    for id in sorted(ids):
        lives = run.faults.of(id).lives
        for life, after in pairwise([*lives, None]):
            for begin, end in life.freezes if life else ():
                a, b = _since(run, begin), _since(run, end)
                yield Down(id, a, b, f"{id} was frozen from {a:g} s to {b:g} s")
            if life and life.kill_ns is not None:
                a, b = _since(run, life.kill_ns), _since(run, after.start_ns) if after else inf
                fate = f"restarted at {a:g} s and came back at {b:g} s" if after else f"killed at {a:g} s"
                yield Down(id, a, b, f"{id} was {fate}")
    for away in run.faults.aways:
        if away.id in ids:
            until_s = inf if away.until_s is None else away.until_s
            yield Down(away.id, away.at_s, until_s, f"{away.id} was away at {away.at_s:g} s ({away.kind})")
    processes = run.metrics["processes"]
    for one in processes["died"] or []:
        if id_of(one["id"]) in ids and one["t"] is not None:
            back = min((t for track in run.tracks for t in track.t_s[track.known] if t > one["t"]), default=inf)
            yield Down(
                id_of(one["id"]), one["t"], back, f"{one['id']} died unplanned at {one['t']:.1f} s ({one['why']})"
            )
    for one in processes["stopped"] or []:
        if id_of(one["id"]) in ids and one["t"] is not None:
            on = inf if one["s"] is None else one["t"] + one["s"]
            yield Down(id_of(one["id"]), one["t"], on, f"{one['id']} was stopped from outside at {one['t']:.1f} s")
    for one in run.metrics["lifetime_s"].get("empty") or []:
        if one["id"] in ids:
            yield Down(one["id"], one["t"], inf, f"the battery of {one['id']} was empty at {one['t']:.1f} s")


def _since(run: Run, t_ns: int) -> float:
    return (t_ns - run.site.origin_ns) / NS


def _reports(run: Run, t_s: Array) -> str:
    """What became of the reports of these steps."""
    chosen = run.frames.reports & np.isin(run.frames.steps, np.rint(t_s / run.step_s))
    fates, fused_late = run.frames.fates(chosen), int((chosen & run.fused_late).sum())
    total, in_time = sum(fates.values()), fates.get("delivered", 0)
    if not total:
        return "no sensor sent a report"
    if not in_time + fused_late:
        return f"none of {total} reports arrived in time ({losses(fates)})"
    late = f", {_all_the_same(fused_late)}" if fused_late else ""
    return f"{in_time} of {total} reports arrived in time{late}, but the tracker had no track"


def _all_the_same(fused_late: int) -> str:
    """What became of these reports, which came after their deadline."""
    return f"{fused_late:,} came late and {'was' if fused_late == 1 else 'were'} still fused (fusion.max_age_s)"


def few_reports(run: Run) -> str:
    """A sentence or two that say that most reports did not come in time, and what became of them; empty if most did."""
    fates, frames = run.frames.fates(run.frames.reports), run.metrics["frames"]
    in_time, total = fates.get("delivered", 0), sum(fates.values())
    if not frames["delivered"]:
        return ""  # of any kind: that is said elsewhere
    if not total:
        return f"no sensor sent a report: {uninformed(run.metrics)}"
    if in_time >= FEW * total:
        return ""
    some = f"only {in_time:,}" if in_time else "none"
    said = f"{some} of {total:,} reports arrived in time ({losses(fates)})"
    if fused_late := int(run.fused_late.sum()):
        said += f"; {_all_the_same(fused_late)}"
    elif not in_time:
        said += f": {uninformed(run.metrics)}"
    return " ".join(filter(None, [f"{said}.", _lateness(run)])).removesuffix(".")


def _lateness(run: Run) -> str:
    """By how much late reports were late, in a sentence."""
    deadline_s = run.scenario.fusion.deadline_s
    late = run.frames.late_s(run.site.step_ns, deadline_s)
    late = late[np.isfinite(late)]
    if not len(late):
        return ""
    typical, least = span(float(np.median(late))), span(float(late.min()))
    when = f"{typical} (median; at least {least}) after their deadline"
    return f"Late reports came {when}, which is {span(deadline_s)} after the step."


def broken_at(run: Run) -> list[float]:
    """When a fault began or ended, or a process died or was stopped, s; each instant once."""
    unplanned = [one["t"] for name in ("died", "stopped") for one in run.metrics["processes"][name] or []]
    empty = [one["t"] for one in run.metrics["lifetime_s"].get("empty") or []]
    return sorted({t_s for t_s, *_ in run.marks} | {t for t in (*unplanned, *empty) if t is not None})
