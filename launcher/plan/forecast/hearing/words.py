"""What is said of a field that hears targets pass, before it runs: in figures, and as warnings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from launcher.plan.forecast.hearing.camera import Watched
from launcher.plan.forecast.hearing.diffusing import Diffusing
from launcher.plan.forecast.hearing.events import Event
from launcher.plan.forecast.hearing.passed import Fixed, Passed
from launcher.plan.forecast.played import listening
from trackfield.role import NS
from trackfield.world.events import ENOUGH

NAMED: Final = 3
"""So many events or processes are named."""


def who_hears(field: Passed) -> Iterator[str]:
    """Which passes will be heard, how long fixes take, and what is sent for it; a line each."""
    events, fixes = field.events, field.fixes
    clusters = (
        "around the loudest sensors" if field.schedule.loudest else f"in {_count(len(_groups(field)), 'cluster')}"
    )
    mean = float(np.mean([len(field.hops(event)) for event in events])) if events else 0.0
    yield (
        f"passes: {_count(len(events), 'event')} {clusters}, with {mean:.1f} reports each that reach their heads; "
        f"enough for a fix ({ENOUGH}) in {len(fixes)}"
    )
    if fixes:
        yield f"fixes: {_later(fixes)}"
    yield _messages(field)
    if (watched := Watched.of(field)) is not None:
        yield from watched.words()


def _groups(field: Passed) -> Sequence[tuple[str, ...]]:
    return field.schedule.clusters


def _later(fixes: Sequence[Fixed]) -> str:
    """How long after the last pass heads and base have them."""
    after_s = [one.after_s for one in fixes]
    told = [one for one in fixes if one.base_ns is not None]
    hops = f"; {len(told)} of {len(fixes)} are told the base" if len(told) < len(fixes) else ""
    low, high = min(after_s), max(after_s)
    span = f"{low:.1f} s" if high - low < 0.1 else f"{low:.1f} to {high:.1f} s"
    return f"a head has one {span} after the last pass of an event{hops}"


def _messages(field: Passed) -> str:
    """Messages of an event, and of interests."""
    diffusing = Diffusing(field)
    interests = len(list(diffusing.refresh()))
    each = Counter(one.kind for step in range(1, _steps(field) + 1) for one in diffusing.of_step(step))
    events = max(len(field.events), 1)
    data, acks = each["data"] / events, each["data-ack"] / events
    return (
        f"messages: {interests} of interests every {diffusing.every_ns / NS:g} s; {data:.1f} of data and {acks:.1f} "
        "acknowledgements for an event, with its fix"
    )


def _steps(field: Passed) -> int:
    return (field.plan.run.end_ns - field.plan.origin_ns) // field.plan.step_ns


# --- warnings ---------------------------------------------------------------------------------------------------------


def unheard(field: Passed) -> Iterator[str]:
    """What is likely to go wrong."""
    yield from _few(field)
    yield from _apart(field)
    yield from _base(field)
    yield from _slow(field)
    if (watched := Watched.of(field)) is not None:
        yield from watched.doubtful()


def _few(field: Passed) -> Iterator[str]:
    """Events without enough reports."""
    few = [event for event in field.events if len(field.hops(event)) < ENOUGH]
    if not few or listening(field.plan):
        return
    named = "; ".join(_why(field, event) for event in few[:NAMED])
    more = f"; and {len(few) - NAMED} more" if len(few) > NAMED else ""
    yield f"{len(few)} of {_count(len(field.events), 'event')} have too few reports for a fix ({ENOUGH}): {named}{more}"


def _why(field: Passed, event: Event) -> str:
    """Which reports an event lacks."""
    at_s = (event.last_ns - field.plan.origin_ns) / NS
    reaches = field.plan.reaches
    missed = ", ".join(f"{id} at {away:.0f} m" for id, away in event.missed.items() if away > reaches[id])
    beyond = f", beyond range: the target passes {missed}" if missed else ""
    lost = len(event.heard) - len(field.hops(event))
    radio = f", {lost} more by no way" if lost else ""
    return f"{len(field.hops(event))} at {event.head} at {at_s:.1f} s{radio}{beyond}"


def _apart(field: Passed) -> Iterator[str]:
    """A radio that does not connect the field."""
    groups = field.reached.apart
    if len(groups) > 1:
        few = ", ".join(groups[1][:NAMED])
        yield (
            f"the radio leaves the field in {len(groups)} groups that do not reach each other, the largest of "
            f"{len(groups[0])} processes, the next with {few}; use more power or range, or more nodes"
        )


def _base(field: Passed) -> Iterator[str]:
    """Heads from which no way leads to the base."""
    lost = [id for id in field.heads if field.schedule.base not in field.reached.hops(id)]
    if lost:
        yield (
            f"no way by radio leads to {field.schedule.base} from {_count(len(lost), 'head')} "
            f"({', '.join(lost[:NAMED])}): it is not told of their fixes; move it (fusion.x_m, fusion.y_m)"
        )


def _slow(field: Passed) -> Iterator[str]:
    """Reports that may come after the deadline of their step."""
    hops = max((one for event in field.events for one in field.hops(event).values()), default=0)
    most_s, use_s = hops * field.schedule.hop_ns / NS, max(field.plan.deadline_s, field.plan.max_age_s)
    if most_s > use_s:
        yield (
            f"reports go up to {hops} hops, which takes up to {most_s:.2f} s if one try fails, and they are of use for "
            f"{use_s:g} s; use a longer fusion.deadline_s, or fusion.max_age_s"
        )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
