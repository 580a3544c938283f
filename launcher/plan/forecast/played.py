"""What of a recording will not be sent, or not be used, said before a run; recorded sound, which nobody knows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

from launcher.records import Plan
from trackfield.role import NS
from trackfield.world.placed import Placed

MOST_NAMED = 5


def played_in_part(plan: Plan) -> Iterator[str]:
    """How many recorded reports are left out or impossible, and which sensors have none; a sentence each."""
    recorded = {one.id: one.sound["times"] for one in plan.processes if "times" in one.sound}
    total = sum(map(len, recorded.values()))
    sent = sum(len(plan.passes[id]) for id in recorded)
    if sent < total:
        why = f"a sensor reports once in a step of {plan.step_ns / NS:g} s, from the first step to the last"
        yield f"{total - sent} of {total} recorded reports are left out: {why}"
    if impossible := list(_impossible(plan)):
        which = "1 recorded report is" if len(impossible) == 1 else f"{len(impossible)} recorded reports are"
        yield f"{which} impossible, and trackers are not given such: {_listed(impossible)}"
    if silent := [id for id, times in recorded.items() if not times]:
        yield f"no report was recorded of {_listed(silent)}"


def listening(plan: Plan) -> set[str]:
    """The sensors that hear recorded sound."""
    return {one.id for one in plan.processes if one.sound.get("sounds", (None, None))[1] is not None}


def without_sound(plan: Plan) -> Plan:
    """The plan with these reporting nothing: targets' paths do not say what they will."""
    mute = listening(plan)
    passes = {id: {} if id in mute else steps for id, steps in plan.passes.items()}
    return replace(plan, passes=passes, reaches={id: 0.0 if id in mute else far for id, far in plan.reaches.items()})


def _impossible(plan: Plan) -> Iterator[str]:
    """The recorded readings that no target gives, wherever it is: by which sensor, and what it read."""
    for sensor in (Placed.from_plain(one.sound) for one in plan.processes if one.sound.get("readings")):
        kind = sensor.kind
        for _, values in sensor.played or ():
            if not kind.possible(kind.corrected(values, sensor.id)):
                read = ", ".join(f"{value:g} {unit}".strip() for value, unit in zip(values, kind.units, strict=True))
                yield f"{read} of {sensor.id}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{', '.join(islice(names, MOST_NAMED))}{more}"
