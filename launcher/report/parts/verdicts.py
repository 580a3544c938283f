"""The verdict on each tracker, with a few sentences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from launcher.record.figures.verdict import LOST, TRACKED, WITH_GAPS, told
from launcher.report import outages, style
from launcher.report.cells import number, percent
from launcher.report.folder import Run
from launcher.report.parts.consistency import in_words
from launcher.report.tracks import Track
from trackfield.tracking.smoothing import WHOLE

FIGURES: Final[style.Figures] = {}
NEAREST: Final = "With several targets, each step is scored against the nearest one."
LOOKS: Final = {TRACKED: "good", WITH_GAPS: "fair", LOST: "bad"}
"""How a verdict looks on the page."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one tracker: its ``state`` as in metrics.json, how that looks, and sentences."""

    tracker: str
    colour: str
    state: str
    look: str
    text: str


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"each": verdicts(run), "gaps": gaps(run)}


def verdicts(run: Run) -> list[Verdict]:
    """One for each tracker."""
    return [_verdict(run, name, m) for name, m in run.metrics["trackers"].items()]


def _verdict(run: Run, name: str, m: dict[str, Any]) -> Verdict:
    own = [track for track in run.tracks if track.tracker == name]
    there = any(track.known.any() for track in own)
    sentences = [
        _error(own, m) if m["steps"] else "",
        _within(run, m) if m["steps"] else "",
        "" if run.site.paths else f"A track at {m['steps_tracked']:,} of {m['steps_expected']:,} steps.",
        *(outages.in_words(run, track) for track in own if there),
        *(outages.told_late(run, track) for track in own),
        "" if there else _never(run, name),
        _rule(run) if m["lost"] and there else "",
        _in_gaps(m),
        NEAREST if m["association"] and there else "",
        in_words(m),
    ]
    look = LOOKS.get(m["verdict"], "fair")
    return Verdict(name, style.colour(run, name), told(m), look, " ".join(filter(None, sentences)))


def _never(run: Run, name: str) -> str:
    """Why a tracker never had a track."""
    if _whole(run, name) and run.ended_early:
        return "The run ended before the track did, and only then is it smoothed."
    return outages.never(run, _lag(run, name))


def _lag(run: Run, name: str) -> int:
    """By how many steps a tracker comes later that said nothing: those with names of their own are smoothed."""
    live = name in run.scenario.fusion.trackers or _whole(run, name)
    return 0 if live else run.scenario.fusion.smooth_lag


def _whole(run: Run, name: str) -> bool:
    return bool(run.field.smoothers) and name.endswith(WHOLE)


def _error(own: list[Track], m: dict[str, Any]) -> str:
    """Its errors, over which steps, and against which bound."""
    expected, tracked, scored = m["steps_expected"], m["steps_tracked"], m["steps"]
    steps = f"all {expected:,} steps" if scored == expected else f"{scored:,} of {expected:,} steps"
    if scored > tracked:
        steps = f"{scored:,} steps"
    blind = sum(int((track.coasting & track.scored).sum()) for track in own)
    if blind:
        steps += f" ({'all' if blind == m['steps'] else f'{blind:,}'} of them without a report)"
    text = f"RMSE {number(m['rmse']['position'], 'm')}, median error {number(m['median_error'], 'm')} over {steps}"
    if m["times_bound"] is not None:
        bounded = sum(int((track.scored & np.isfinite(track.bound)).sum()) for track in own)
        over = "the same steps" if bounded == m["steps"] else f"the {bounded:,} of them that have one"
        text += f"; {number(m['times_bound'])} times the bound of {number(m['bound_m'], 'm')} over {over}"
    if scored > tracked:
        text += f". A track at {tracked:,} of the {expected:,} steps at which one was expected"
    return f"{text}."


def _within(run: Run, m: dict[str, Any]) -> str:
    """The share of steps at which it was near enough, unless that is all."""
    share = m["share_within"]
    if share is None or share >= 1.0:
        return ""
    return f"Within {run.scenario.lost_beyond_m:g} m of the truth at {percent(share)} of the steps."


def _rule(run: Run) -> str:
    """Why a track counts as lost, by the rule of the scenario."""
    rule = run.scenario.score.lost
    beyond = f"more than {run.scenario.lost_beyond_m:g} m off, or without a track,"
    if (rule.steps, rule.within) == (1, 1):
        when = "at the last step"
    else:
        last = "" if rule.within is None else f" within the last {rule.within}"
        when = f"for {rule.steps} step{'s' * (rule.steps != 1)} in a row{last}"
    return f"Lost by the rule of the scenario: {beyond} {when}."


def _in_gaps(m: dict[str, Any]) -> str:
    """Its error from the straight line that stands in for the truth."""
    gap = m["gap"]
    if not gap["steps"]:
        return ""
    rmse = number(gap["rmse"], "m")
    return (
        f"In gaps and jumps of the recorded path, not counted above: RMSE {rmse} against a straight line, "
        f"{gap['steps']:,} steps."
    )


def gaps(run: Run) -> str:
    """How much of the truth is interpolated, in a sentence; empty if none is."""
    times, guessed = run.course.at_ns, len(run.course.interpolated)
    if not guessed:
        return ""
    jumps = len(run.jumps)
    where = [("gap", len(run.gaps) - jumps), ("jump", jumps)]
    places = " and ".join(f"{count} {what}{'s' * (count != 1)}" for what, count in where if count)
    return (
        f"{guessed:,} of {len(times):,} steps ({percent(guessed / len(times))}) lie in {places} of the recorded path, "
        "where a straight line stands in for the truth. Errors, NEES and bounds leave them out, "
        "unless they say otherwise."
    )
