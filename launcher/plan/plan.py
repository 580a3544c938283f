"""From a scenario to what every process must know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from launcher.plan.architectures import Built, built, surveyed
from launcher.plan.assembly import assembled
from launcher.plan.connected import connected
from launcher.plan.extensions import own_places
from launcher.plan.faults import Faults, resolve
from launcher.plan.faults.struck import MOST_COMPARED
from launcher.plan.links import (
    check_bursts,
    check_links,
    check_used,
    plain,
    queues_of,
    repeated_by_tree,
    sections_of,
    with_nodes,
)
from launcher.plan.tracking import track_names
from launcher.records import BASE, FieldInfo, Plan, Truth
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.errors import ScenarioError
from trackfield.filters.metrics import Lost
from trackfield.link.fate import FIELD
from trackfield.role import NS
from trackfield.scenario import Scenario, Site
from trackfield.scenario.nearest import suggestion
from trackfield.sensing.kinds import own_options
from trackfield.words import quoted
from trackfield.world.path import Path

TRUTH_SAMPLES: Final = 4
"""Points of a true path per step, in pictures."""


def make_plan(scenario: Scenario, *, run: str, speed: float = 1.0) -> Plan:
    """Lay out the field, compute what can be heard when, and write each process's part.

    Raises ``ScenarioError`` where there is no sensor, no target is ever in range of one, the link's file cannot be
    used, the architecture does not work, or a fault or ``run.external`` names an unknown process.
    """
    site = surveyed(scenario)
    field = built(site)
    faults = planned_faults(field)
    end_ns = site.end_ns
    links = sections_of(scenario, (medium for process in field.processes for medium in process.media))
    check_used(scenario, links)
    check_bursts(links, len(site.sensors), end_ns)
    places = own_places(scenario)
    whole = assembled(field)  # with the kinds of message of users' own roles
    check_links(scenario, links)
    links = with_nodes(links, ((process.id, process.media) for process in field.processes))
    others = {medium: plain(one) for medium, one in links.items() if medium != FIELD}
    radio = (repeated_by_tree if any(one.base for one in field.processes) else plain)(links[FIELD])
    queues = queues_of(links)
    spec = RunSpec(run, scenario.seed, end_ns, radio, speed, faults.partitions, others, queues)
    processes, flows = connected(field, whole.processes, whole.tracking, spec)
    lives = tuple(life for process in processes for life in _lives(process, faults))
    return Plan(
        spec,
        lives,
        site.paths,
        _info(field, spec, faults),
        whole.tracking,
        field.views,
        flows,
        {id: kind.report_m for id, kind in site.sensing.items()},
        site.passes,
        bool(site.played),
        scenario.restart == "on-death",
        lost_of(scenario),
        scenario.fusion.deadline_s,
        scenario.fusion.max_age_s,
        own_places=places,
        banks=whole.banks,
        schedule=field.schedule,
        smoothers=field.smoothers,
        pass_steps=None if (expected := site.pass_steps) is None else frozenset(expected),
        external=_external(scenario, [process.id for process in field.processes]),
        aways=faults.aways,
    )


def _external(scenario: Scenario, ids: Sequence[str]) -> tuple[str, ...]:
    """The processes that come from outside. Raises ``ScenarioError`` for ids of none."""
    external, known = scenario.run.external or (), set(ids)
    if unknown := [id for id in external if id not in known]:
        near = suggestion(unknown[0], ids) if len(ids) <= MOST_COMPARED else ""
        like = ", ".join(dict.fromkeys((ids[0], ids[-1])))
        what = f"there is no {quoted(unknown[0])}{near}"
        raise ScenarioError(what, key="run.external", expected=f"ids of this field, like {like}")
    return external


def planned_faults(field: Built) -> Faults:
    """The planned faults by process. Raises ``ScenarioError`` as ``resolve`` does."""
    site, scenario = field.site, field.site.scenario
    base = next((view.sources for view in field.views if view.name == BASE), ())
    inside = tuple(id for id in field.fusing if id not in base)
    parts = {"tracking": inside or field.fusing, "base": base}
    paths = site.paths.values()
    return resolve(
        scenario.faults, scenario.seed, field.places, site.end_ns, site.origin_ns, site.sensing, parts, paths
    )


def lost_of(scenario: Scenario) -> Lost:
    """When a track counts as lost."""
    rule = scenario.score.lost
    return Lost(scenario.lost_beyond_m, rule.steps, rule.within)


def _lives(process: ProcessSpec, faults: Faults) -> list[ProcessSpec]:
    """The process in each of its lives: each has its own sensor noise, but the same clock and sensor faults."""
    fates = faults.of(process.id)
    return [
        replace(
            process,
            incarnation=incarnation,
            sound={**process.sound, "incarnation": incarnation} if process.sound else {},
            start_ns=life.start_ns,
            kill_ns=life.kill_ns,
            freezes=life.freezes,
            jumps=fates.jumps,
            faults=fates.sensor,
        )
        for incarnation, life in enumerate(fates.lives)
    ]


def _info(field: Built, spec: RunSpec, faults: Faults) -> FieldInfo:
    site = field.site
    return FieldInfo(
        spec.run,
        site.scenario.name,
        field.places,
        tuple(_truth(site, target, path) for target, path in site.paths.items()),
        track_names(site.scenario),
        (spec.end_ns - site.origin_ns) / NS,
        faults.marks,
        faults.spells,
        paths=field.routes,
        origin_ns=site.origin_ns,
        step_ns=site.step_ns,
        headline=field.views[0].sources,
        layers={id: kind.layer for id, kind in site.sensing.items() if kind.layer},
        sensing=_drawn(site),
        hears=hears(site),
        listens=any(kind.hearing is not None for kind in site.sensing.values()),
    )


def hears(site: Site) -> bool:
    """Whether all sensors report that targets pass."""
    return all(section.sensing.passes is not None for section in site.sections.values())


def _drawn(site: Site) -> dict[str, dict[str, Any]]:
    """The kind and options of the sensors whose kind says what is drawn of a reading, by their ids."""
    known = {name: section.plain for name, section in site.sections.items() if hasattr(section.sensing.own, "drawn")}
    ids = ((site.sensors[i][0], plain) for name, plain in known.items() for i in site.kinds[name])
    return {id: plain | {"options": own_options(plain["options"], id)} for id, plain in ids}


def _truth(site: Site, target: str, path: Path) -> Truth:
    """A target's path for pictures, from the first step on."""
    every_s, origin_s = site.step_ns / NS / TRUTH_SAMPLES, site.origin_ns / NS
    times = [k * every_s for k in range(site.steps * TRUTH_SAMPLES + 1)]
    points = ((t, state[0], state[1]) for t in times if (state := path.at(origin_s + t)) is not None)
    return Truth(target, tuple(points), tuple((a - origin_s, b - origin_s) for a, b in path.guessed_inside))
