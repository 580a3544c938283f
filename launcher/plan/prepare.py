"""From the user's input to a scenario and its plan; all errors in the input are found here."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from launcher.plan.architectures.ports import check_devices
from launcher.plan.extensions import suited
from launcher.plan.flaws import found_by, worked_out
from launcher.plan.forecast.backbone import check_backbone
from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.graph import check_reach
from launcher.plan.forecast.hearing.reached import check_clusters
from launcher.plan.forecast.played import played_in_part
from launcher.plan.forecast.reception import receptions
from launcher.plan.forecast.warnings import warnings
from launcher.plan.plan import make_plan
from launcher.records import Passing, Plan
from trackfield.errors import ScenarioError, combined
from trackfield.filters.trackers import TRACKERS
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.scenario.override import parse
from trackfield.scenario.paths import FromFile
from trackfield.scenario.problems import section_of
from trackfield.tracking.smoothing import WHOLE, lagged_name
from trackfield.world.path import Path as TruePath

SLOWEST: Final = 0.001
FASTEST: Final = 100.0
"""Emulated seconds in a second."""
MAX_LINKS: Final = 2000
"""In a field of more places, the reception of links is not worked out for the timeline."""
JUMPS_TOLD: Final = 3
"""Of more jumps in a recording, a remark names the times of the first."""


def load(name: str, **options: Any) -> Scenario:
    """The scenario with what the command line changes in it (see ``changes``). Raises ``ScenarioError``."""
    scenario, errors = examine(name, **options)
    if scenario is None or errors:
        raise combined(errors)
    return scenario


def examine(name: str, **options: Any) -> tuple[Scenario | None, list[ScenarioError]]:
    """As ``load``, but with all that is wrong; the scenario is without that, or None if there is none.

    Sensors of another kind than the scenario's leave out those of its trackers that cannot use them.
    """
    overrides, errors = _changes(name, **options)
    scenario, found = Scenario.examine(name, overrides, known_trackers=TRACKERS)
    errors += found
    if scenario is not None and not errors and _of_another_kind(overrides):
        try:
            scenario = suited(scenario)
        except ScenarioError as error:
            errors.append(error)
    return scenario, errors


def _of_another_kind(overrides: Mapping[str, Any]) -> bool:
    """Whether these change what sensors measure, and say nothing of trackers."""
    sensing, tracking = {"sensor", "sensors", "sensor.kind"}, {"fusion", "fusion.trackers"}
    return bool(sensing & overrides.keys()) and not tracking & overrides.keys()


def changes(name: str, **options: Any) -> dict[str, Any]:
    """The keys that the command line sets in this scenario, with their values. Raises ``ScenarioError``.

    The options are ``settings`` (of ``--set``), ``seed``, ``target``, ``start``, ``end``, ``sensors``, ``nodes``,
    ``link`` and ``trackers``.
    """
    overrides, errors = _changes(name, **options)
    if errors:
        raise combined(errors)
    return overrides


def _changes(
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
) -> tuple[dict[str, Any], list[ScenarioError]]:
    """See ``changes``; with all that is wrong."""
    options: dict[str, tuple[str, Any]] = {
        "seed": ("--seed", seed),
        "target.path": ("--target", target and "file"),
        "target.file": ("--target", target and str(target)),
        "target.from": ("--from", start),
        "target.to": ("--to", end),
        "field.layout": ("--sensors", sensors and "file"),
        "field.file": ("--sensors", sensors and str(sensors)),
        "field.nodes": ("--nodes", nodes),
        "link.model": ("--link", link),
        "fusion.trackers": ("--tracker", list(trackers) or None),
    }
    overrides, errors = _parsed(settings)
    if target is None and (start is not None or end is not None) and not _recorded(name, overrides):
        errors.append(ScenarioError("there is no track to cut", key="--from, --to", expected="--target FILE as well"))
        del options["target.from"], options["target.to"]
    for key, (option, value) in options.items():
        if value is not None and key in overrides:
            errors.append(ScenarioError("is set twice", key=key, expected=f"either --set {key}=... or {option}"))
        if value is not None:
            overrides[key] = value
    if {"field.nodes", "field.extent_m"} <= overrides.keys():
        what = "has no effect, since the number of nodes decides how large the field is"
        errors.append(ScenarioError(what, key="field.extent_m", expected="one of field.extent_m and field.nodes"))
    whole = {"target.steps": None} if "target.to" in options and end is not None else {}  # all steps up to --to
    return whole | overrides, errors


def _parsed(settings: Sequence[str]) -> tuple[dict[str, Any], list[ScenarioError]]:
    """Keys and values of ``--set``, and what is wrong with them."""
    overrides: dict[str, Any] = {}
    errors: list[ScenarioError] = []
    for setting in settings:
        try:
            key, value = parse(setting)
        except ScenarioError as error:
            errors.append(error)
            continue
        if key in overrides:
            errors.append(ScenarioError("is set twice", key=key, expected=f"a single --set {key}=..."))
        overrides[key] = value
    return overrides, errors


def _recorded(name: str, overrides: Mapping[str, Any]) -> bool:
    """Whether the target of the scenario follows a recorded track."""
    scenario, _ = Scenario.examine(name, overrides, known_trackers=TRACKERS)
    return scenario is not None and isinstance(scenario.target, FromFile)


def prepare(
    name: str, speed: float = 1.0, checks: Sequence[Callable[[], object]] = (), **options: Any
) -> tuple[Scenario, Plan]:
    """The scenario with these changes (see ``changes``), and its plan with its warnings.

    Raises ``ScenarioError`` with all that is wrong: by any of the ``checks``, with the options, in the scenario, and
    what shows only when it is worked out.
    """
    scenario, errors = examine(name, **options)
    errors += found_by([partial(check_speed, speed), *checks])
    if scenario is None or errors:
        late = [] if scenario is None else worked_out(scenario, {section_of(error.key) for error in errors})
        raise combined([*errors, *late])
    try:
        return scenario, warned(planned(scenario, speed))
    except ScenarioError as error:
        raise combined([error, *worked_out(scenario, set())]) from None


def checked(scenario: Scenario, seed: int | None = None) -> Scenario:
    """The scenario, perhaps under another seed, with its trackers' names checked too. Raises ``ScenarioError``."""
    overrides = {} if seed is None else {"seed": seed}
    return Scenario.load(scenario.plain(), overrides, known_trackers=TRACKERS)


def check_speed(speed: float) -> None:
    """Raise ``ScenarioError`` unless a run can go at this speed."""
    if not SLOWEST <= speed <= FASTEST:
        raise ScenarioError(f"is {speed}", key="--speed", expected=f"more than 0: from {SLOWEST:g} to {FASTEST:g}")


def planned(scenario: Scenario, speed: float = 1.0) -> Plan:
    """The scenario's plan under a run id of its own, and how well reports get through. Raises ``ScenarioError``."""
    check_speed(speed)
    plan = make_plan(scenario, run=f"{scenario.name}-{scenario.seed}-{uuid.uuid4().hex[:8]}", speed=speed)
    check_devices(plan)
    if plan.bases:
        check_reach(plan, plan.bases)
    if isinstance(plan.schedule, Passing):
        check_clusters(plan, plan.schedule)
    check_backbone(plan)
    if len(plan.info.places) > MAX_LINKS:
        return plan
    return replace(plan, info=replace(plan.info, receptions=tuple(_links(plan))))


def _links(plan: Plan) -> Iterator[tuple[str, str, float]]:
    """The links that the timeline shows, with what they deliver: of reports, and of other messages on other links."""
    known: set[frozenset[str]] = set()
    for shares in receptions(plan).values():
        new = {pair: share for pair, share in shares.items() if frozenset(pair) not in known}
        known.update(map(frozenset, new))
        yield from ((*pair, share) for pair, share in new.items())


def warned(plan: Plan) -> Plan:
    """The plan with its warnings."""
    return replace(plan, warnings=warnings(plan, foresee(plan)))


def remarks(plan: Plan) -> list[str]:
    """What a user should know of the plan before it runs.

    Gaps and jumps in tracks, trackers that cannot be smoothed, recorded reports that nobody will send.
    """
    lag, tracks = plan.tracking.get("smooth_lag", 0), plan.info.trackers
    live = plan.tracking["trackers"]
    smoothed = {name for name in live for end in WHOLE if f"{name}{end}" in tracks} if plan.smoothers else set(live)
    rough = [name for name in live if (lag and lagged_name(name, lag) not in tracks) or name not in smoothed]
    lacks = "solve for passes" if isinstance(plan.schedule, Passing) else "report its motion model"
    return [
        *(text for target, path in plan.paths.items() for text in _in_gaps(plan, target, path)),
        *(f"{name} does not {lacks}, so its track is not smoothed" for name in rough),
        *played_in_part(plan),
    ]


def _in_gaps(plan: Plan, target: str, path: TruePath) -> Iterator[str]:
    """How much of a target's truth is interpolated, in gaps and in jumps of the recording; nothing if none is."""
    steps = range(plan.origin_ns + plan.step_ns, plan.run.end_ns, plan.step_ns)
    there = [t / NS for t in steps if path.at(t / NS) is not None]
    jumping = sum(map(path.jumping, there))
    inside = sum(map(path.interpolated, there)) - jumping
    whose = "" if len(plan.paths) == 1 else f" of {target}"
    if inside:
        begin, end = max(path.gaps_inside, key=lambda gap: gap[1] - gap[0])
        gaps = "a gap" if len(path.gaps) == 1 else f"{len(path.gaps)} gaps"
        longest = f"{'' if len(path.gaps) == 1 else 'the longest '}from {begin - plan.origin_ns / NS:.1f} s"
        yield (
            f"{inside} of {len(there)} steps lie in {gaps} of the recording{whose} "
            f"({longest} for {end - begin:.0f} s): "
            "a straight line stands in for the truth there, and headline errors leave these steps out"
        )
    if jumping:
        at = [f"{begin - plan.origin_ns / NS:.1f} s" for begin, _ in path.jumps_inside]
        more = f" and {len(at) - JUMPS_TOLD} more" if len(at) > JUMPS_TOLD else ""
        yield (
            f"{jumping} of {len(there)} steps lie where the recording{whose} jumps, as no target moves (at "
            f"{', '.join(at[:JUMPS_TOLD])}{more}): headline errors leave these steps out"
        )
