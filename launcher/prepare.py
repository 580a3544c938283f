"""From what the user typed to a scenario and its plan; everything a user can get wrong is found here."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from fusion.smoothing import lagged_name
from launcher.plan import make_plan
from launcher.reception import receptions
from launcher.records import Plan
from launcher.view import program
from trackfield.drivers.session import PROTOCOLS, is_endpoint
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario
from trackfield.scenario.layouts import Surveyed
from trackfield.scenario.links import Trace
from trackfield.scenario.override import parse
from trackfield.scenario.paths import FromFile

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
    overrides = whole | dict(map(parse, settings)) | {k: v for k, v in options.items() if v is not None}
    return Scenario.load(name, overrides, known_trackers=TRACKERS)


def checked(scenario: Scenario, seed: int | None = None) -> Scenario:
    """The scenario, perhaps under another seed, with its trackers' names checked too. Raises ``ScenarioError``."""
    overrides = {} if seed is None else {"seed": seed}
    return Scenario.load(scenario.plain(), overrides, known_trackers=TRACKERS)


def planned(scenario: Scenario, speed: float = 1.0) -> Plan:
    """The scenario's plan under a run id of its own, and how well reports get through. Raises ``ScenarioError``."""
    if not 0 < speed <= 100:
        raise ScenarioError(f"is {speed}", key="--speed", expected="more than 0, at most 100")
    plan = make_plan(scenario, run=f"{scenario.name}-{scenario.seed}-{uuid.uuid4().hex[:8]}", speed=speed)
    if len(plan.info.places) > MAX_LINKS:
        return plan
    reports = next(iter(receptions(plan).values()))
    links = tuple((*link, share) for link, share in reports.items())
    return replace(plan, info=replace(plan.info, receptions=links))


def keep(scenario: Scenario, folder: Path) -> None:
    """Write ``scenario.toml`` into the run folder, and beside it the files that it names: to be run again anywhere."""
    for section, name in (("target", "target"), ("field", "sensors"), ("link", "link")):
        scenario = scenario.model_copy(update={section: _kept(getattr(scenario, section), folder, name)})
    names = [f"target-{one.id}" if one is not scenario.every_target[0] else "target" for one in scenario.targets]
    targets = tuple(_kept(one, folder, name) for one, name in zip(scenario.targets, names, strict=True))
    scenario = scenario.model_copy(update={"targets": targets})
    (folder / "scenario.toml").write_text(scenario.to_toml(), encoding="utf-8")


def _kept(part: Any, folder: Path, name: str) -> Any:
    """A section whose file is the copy made of it in the folder; one that names no file as it is."""
    if not isinstance(part, FromFile | Surveyed | Trace):
        return part
    file = Path(part.file)
    copy = shutil.copyfile(file, folder / f"{name}{file.suffix}")
    return part.model_copy(update={"file": copy.name})


def check_endpoint(endpoint: str, option: str) -> None:
    """Raise ``ScenarioError`` unless this can be where a Zenoh router listens."""
    if not is_endpoint(endpoint):
        expected = f"PROTOCOL/ADDRESS, like tcp/127.0.0.1:7447 (protocols: {', '.join(PROTOCOLS)})"
        raise ScenarioError(f"is {endpoint!r}", key=option, expected=expected)


def check_driver(*, virtual: bool, external: bool, live: bool, connect: str) -> None:
    """Raise ``ScenarioError`` if these options contradict each other, ``RunFailed`` if what they need is missing."""
    if external and virtual:
        raise ScenarioError("there are no processes in virtual time", key="--external", expected="it without --virtual")
    if live and virtual:
        expected = "it without --virtual, or the timeline afterwards: trackfield view RUN"
        raise ScenarioError("a run in virtual time is over at once", key="--live", expected=expected)
    if live:
        program()
    if external and not connect:
        raise ScenarioError("nobody can find a router of our own", key="--external", expected="--connect beside it")


def remarks(plan: Plan) -> list[str]:
    """What a user should know of the plan before it runs: gaps in the track, and trackers that cannot be smoothed."""
    centre = next((process.config for process in plan.processes if process.role == "fusion"), {})
    lag, tracks = centre.get("smooth_lag", 0), plan.info.trackers
    rough = [name for name in centre.get("trackers", ()) if lag and lagged_name(name, lag) not in tracks]
    return [
        f"the track has no fixes from {a:.1f} s to {b:.1f} s ({b - a:.0f} s): a straight line stands in"
        for a, b in plan.info.gaps
    ] + [f"{name} does not tell the motion that it expects, so its track is not smoothed" for name in rough]
