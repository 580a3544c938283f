"""Errors of a scenario that show only when it is worked out: in files, places, faults, trackers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from functools import partial
from typing import Final

from launcher.plan.architectures import Built, built, surveyed
from launcher.plan.links import SECTIONS, check_links
from launcher.plan.plan import planned_faults
from launcher.plan.tracking import check_tracking
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.scenario.survey import target_paths

TARGETS: Final = {"target", "targets"}
GROUND: Final = TARGETS | {"field", "sensor", "sensors", "architecture", "fusion", "run"}
"""The sections that the survey of a field depends on."""


def worked_out(scenario: Scenario, broken: Collection[str]) -> list[ScenarioError]:
    """The errors, without those that depend on a section that is ``broken``."""
    found: list[ScenarioError] = []
    field: list[Built] = []

    def look(sections: Collection[str], check: Callable[[], object]) -> bool:
        """Whether it could be checked, and is right."""
        wrong = None if set(sections) & set(broken) else found_by([check])
        found.extend(wrong or [])
        return wrong == []

    look({"fusion", "sensor", "sensors", "faults"}, partial(check_tracking, scenario))
    if look(TARGETS, partial(target_paths, scenario)) and look(GROUND, lambda: field.append(built(surveyed(scenario)))):
        look({"faults"}, lambda: planned_faults(field[0]))
    look(set(SECTIONS.values()), partial(check_links, scenario))
    return found


def found_by(checks: Iterable[Callable[[], object]]) -> list[ScenarioError]:
    """The errors that these raise."""
    found: list[ScenarioError] = []
    for check in checks:
        try:
            check()
        except ScenarioError as error:
            found.extend(error.parts)
    return found
