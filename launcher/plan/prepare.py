"""From what the user typed to a scenario and its plan; everything a user can get wrong is found here."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from fusion.smoothing import lagged_name
from launcher.plan.foresight import foresee
from launcher.plan.plan import make_plan
from launcher.plan.reception import receptions
from launcher.plan.warnings import warnings
from launcher.records import Plan
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario
from trackfield.scenario.override import parse

MAX_LINKS: Final = 2000
"""Nobody looks at more links than that."""


def load(
    name: str,
    *,
    settings: Sequence[str] = (),
    seed: int | None = None,
    target: Path | None = None,
    start: str | None = None,
    end: str | None = None,
    sensors: Path | None = None,
    nodes: int | None = None,
    link: str | None = None,
    trackers: Sequence[str] = (),
) -> Scenario:
    """The scenario with what the command line changes in it. Raises ``ScenarioError``."""
    changed = changes(
        settings=settings,
        seed=seed,
        target=target,
        start=start,
        end=end,
        sensors=sensors,
        nodes=nodes,
        link=link,
        trackers=trackers,
    )
    return Scenario.load(name, changed, known_trackers=TRACKERS)


def changes(
    *,
    settings: Sequence[str] = (),
    seed: int | None = None,
    target: Path | None = None,
    start: str | None = None,
    end: str | None = None,
    sensors: Path | None = None,
    nodes: int | None = None,
    link: str | None = None,
    trackers: Sequence[str] = (),
) -> dict[str, Any]:
    """The keys of a scenario that the command line sets, with their values. Raises ``ScenarioError``."""
    if target is None and (start is not None or end is not None):
        raise ScenarioError("there is no track to cut", key="--from, --to", expected="--target FILE beside it")
    options: Mapping[str, Any] = {
        "seed": seed,
        "target.path": target and "file",
        "target.file": target and str(target),
        "target.from": start,
        "target.to": end,
        "field.layout": sensors and "file",
        "field.file": sensors and str(sensors),
        "field.nodes": nodes,
        "link.model": link,
        "fusion.trackers": list(trackers) or None,
    }
    whole = {"target.steps": None} if end is not None else {}  # who names the end wants all up to there
    return whole | dict(map(parse, settings)) | {k: v for k, v in options.items() if v is not None}


def checked(scenario: Scenario, seed: int | None = None) -> Scenario:
    """The scenario, perhaps under another seed, with its trackers' names checked too. Raises ``ScenarioError``."""
    overrides = {} if seed is None else {"seed": seed}
    return Scenario.load(scenario.plain(), overrides, known_trackers=TRACKERS)


def planned(scenario: Scenario, speed: float = 1.0) -> Plan:
    """The scenario's plan under a run id of its own, and how well reports get through. Raises ``ScenarioError``."""
    if not 0 < speed <= 100:
        raise ScenarioError(f"is {speed}", key="--speed", expected="more than 0, at most 100")
    plan = make_plan(scenario, run=f"{scenario.name}-{scenario.seed}-{uuid.uuid4().hex[:8]}", speed=speed)
    plan = replace(plan, warnings=warnings(plan, foresee(plan)))
    if len(plan.info.places) > MAX_LINKS:
        return plan
    reports = next(iter(receptions(plan).values()))
    links = tuple((*link, share) for link, share in reports.items())
    return replace(plan, info=replace(plan.info, receptions=links))


def remarks(plan: Plan) -> list[str]:
    """What a user should know of the plan before it runs: gaps in tracks, and trackers that cannot be smoothed."""
    lag, tracks = plan.tracking.get("smooth_lag", 0), plan.info.trackers
    rough = [name for name in plan.tracking["trackers"] if lag and lagged_name(name, lag) not in tracks]
    alone = len(plan.info.truths) == 1
    return [
        f"the track{'' if alone else f' of {truth.target}'} has no fixes from {a:.1f} s to {b:.1f} s ({b - a:.0f} s): "
        "a straight line stands in"
        for truth in plan.info.truths
        for a, b in truth.gaps
    ] + [f"{name} does not tell the motion that it expects, so its track is not smoothed" for name in rough]
