"""What is said of a field in which leaders choose who measures, before it runs: in figures, and as warnings."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np

from launcher.plan.forecast.heads.headed import astray, who_is_polled
from launcher.plan.forecast.heads.polled import Polled
from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.forecast.hearing.words import unheard, who_hears
from launcher.plan.forecast.masters.association import FULL
from launcher.plan.forecast.masters.scheduled import Scheduled

MANY: Final = 0.03
"""If so many slaves find no master, there is a warning."""


def leading(field: Scheduled | Polled | Passed | None) -> str:
    """Who leads there."""
    if isinstance(field, Passed):
        return "nodes"
    return "heads" if isinstance(field, Polled) else "masters"


def doubtful(field: Scheduled | Polled | Passed) -> Iterator[str]:
    """What is likely to go wrong because of who leads and who measures."""
    if isinstance(field, Passed):
        return unheard(field)
    return astray(field) if isinstance(field, Polled) else orphaned(field)


def who_measures(field: Scheduled | Polled | Passed) -> Iterator[str]:
    """Who leads and how many measure, and what that takes of a step; a line each."""
    if isinstance(field, Passed):
        yield from who_hears(field)
        return
    yield from who_is_polled(field) if isinstance(field, Polled) else _clusters(field)
    parts = dict(field.schedule.budget)
    least_s, step_s = parts.pop("at least", 0.0), field.plan.step_ns / 1e9
    if parts:
        each = ", ".join(f"{what} {seconds:.2f} s" for what, seconds in parts.items())
        yield f"budget: {each} at most, of a step of {step_s:g} s, which needs {least_s:.2f} s"


def _clusters(field: Scheduled) -> Iterator[str]:
    """Which slaves have a master, and how many measure."""
    association, turns = field.association, list(field.turns.values())
    slaves, masters = len(association.asked), len(field.schedule.masters)
    yield (
        f"clusters: {len(association.masters)} of {slaves} slaves find one of {masters} masters with a place"
        f"{_orphans(field)}"
    )
    if turns:
        counts = [len(turn.slots) for turn in turns]
        changes = sum(b.leader != a.leader for a, b in pairwise(turns) if b.step == a.step + 1)
        handed = f", {changes} hand-overs" if field.every == 1 else ""
        yield (
            f"schedule: by policy '{field.schedule.policy}' {np.mean(counts):.1f} slaves measure in a step "
            f"({max(counts)} at most), of {np.mean([len(turn.sensors) for turn in turns]):.1f} clusters{handed}"
        )


def orphaned(field: Scheduled) -> Iterator[str]:
    """Slaves that find no master, if they are many."""
    association, schedule = field.association, field.schedule
    if len(association.orphans) > MANY * len(association.asked):
        places = len(schedule.masters) * schedule.capacity
        remedy = "more masters, or more places (architecture.capacity)" if association.why(FULL) else "more masters"
        short = (
            f"; {len(association.asked)} slaves are more than the {places} places of {len(schedule.masters)} masters"
            if len(association.asked) > places
            else ""
        )
        yield (
            f"{len(association.orphans)} of {len(association.asked)} slaves find no master and will not measure"
            f"{_orphans(field)}{short}; use {remedy}, or more power"
        )


def _orphans(field: Scheduled) -> str:
    """How many find none, and why."""
    association = field.association
    reasons = sorted(set(association.orphans.values()))
    return f" ({', '.join(f'{association.why(one)}: {one}' for one in reasons)})" if reasons else ""
