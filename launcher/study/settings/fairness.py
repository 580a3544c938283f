"""What settings have in common, so that their runs can be compared, and what some of them have besides."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Final

from launcher.records import BATTERY, SENSES, Plan
from trackfield.scenario import Scenario

_SECTIONS: Final = {
    "sensing": ("sensor", "sensors"),
    "link": ("link", "radio"),
    "clocks": ("clock",),
    "trackers, prior and deadline": ("fusion",),
    "rule for a lost track": ("score",),
    "planned faults": ("faults",),
    "time without a target": ("run.idle_s",),
}
"""Sections of a scenario that settings may have in common, in words."""


@dataclass(frozen=True)
class Facts:
    """What is to be known of a setting: a digest of each thing that others may have the same, by its name, and the
    processes that are not sensors, in words."""

    same: Mapping[str, str]
    extras: tuple[str, ...]


def facts_of(scenario: Scenario, plan: Plan) -> Facts:
    """Those of a setting, from its scenario and its plan for one seed."""
    sensors = plan.info.tagged(SENSES)
    ids = {place.id for place in sensors}
    own = [process for process in plan.processes if process.id in ids and not process.incarnation]
    plain = scenario.plain()
    found = {
        f"{len(sensors)} sensors and their places": [(place.id, place.x, place.y) for place in sensors],
        "targets and their paths": [truth.points for truth in plan.info.truths],
        "steps": (plan.step_ns, scenario.steps),
        "batteries and power of sensors": [(one.id, one.power, dict(one.tx_dbms).get(one.id)) for one in own],
        **{name: [_part(plain, key) for key in keys] for name, keys in _SECTIONS.items()},
    }
    return Facts({name: _digest(value) for name, value in found.items()}, tuple(_extras(plan)))


def _part(plain: Mapping[str, Any], key: str) -> Any:
    part: Any = plain
    for name in key.split("."):
        part = part.get(name) if isinstance(part, Mapping) else None
    return part


def _digest(value: Any) -> str:
    return sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


def _extras(plan: Plan) -> list[str]:
    """The processes without a sensor: how many of each role, and what they run on."""
    powered = {one.id for one in plan.processes if one.power.get("battery_fj") is not None}
    counts = Counter(
        (place.role, "battery" if BATTERY in place.tags and place.id in powered else "mains")
        for place in plan.info.places
        if SENSES not in place.tags
    )
    return [f"{number} {role} ({supply})" for (role, supply), number in counts.items()]


def common(groups: Sequence[Sequence[Facts]]) -> tuple[list[str], list[str]]:
    """(what all settings of each group have the same, what differs in some group), by name.

    A group are the settings that are compared with each other. What only some settings have counts as different, under
    the name that each gives it.
    """
    names = list(dict.fromkeys(name for group in groups for facts in group for name in facts.same))
    same = [name for name in names if all(_equal(name, group) for group in groups)]
    return same, [name for name in names if name not in same]


def _equal(name: str, group: Sequence[Facts]) -> bool:
    found = {facts.same.get(name) for facts in group}
    return len(found) == 1
