"""From a scenario to what every process must know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Final

import numpy as np

from launcher.records import FieldInfo, Place, Plan
from trackfield.draw import normal
from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.errors import ScenarioError
from trackfield.link.models import make_link
from trackfield.models.sound import audible_radius
from trackfield.role import NS
from trackfield.scenario import Plan as Site
from trackfield.scenario import Scenario
from trackfield.scenario import plan as survey
from trackfield.scenario.places import CENTRE

TRUTH_SAMPLES: Final = 4
"""Points of the true path per step, in pictures."""


def make_plan(scenario: Scenario, *, run: str, speed: float = 1.0) -> Plan:
    """Lay out the field, compute what can be heard when, and write each process's part.

    Raises ``ScenarioError`` where there is no sensor, the target is never in range of one, or the link's file is of no
    use.
    """
    site = survey(scenario)
    # The last step's deadline falls after the path's end; one step more lets it pass.
    end_ns = (site.steps + 1) * site.step_ns
    spec = RunSpec(run, scenario.seed, end_ns, scenario.plain()["link"], speed)
    nodes = [_node(site, index) for index in range(len(site.sensors))]
    centre = _centre(site)
    # Nodes and centre send to each other, and nobody else.
    nodes = [replace(node, peers=places_of([centre])) for node in nodes]
    processes = (replace(centre, peers=places_of(nodes)), *nodes)
    _check_link(spec)
    sensor = scenario.sensor
    reach_m = audible_radius(sensor.level_db, sensor.alpha, sensor.threshold_db)
    return Plan(spec, processes, site.path, _info(site, spec, processes), site.step_ns, reach_m)


def _check_link(spec: RunSpec) -> None:
    """Raise ``ScenarioError`` unless the link can be made; all but its file was checked with the scenario."""
    try:
        make_link(spec.link, spec.seed)
    except ValueError as error:
        raise ScenarioError(str(error), key="link.file") from None


@cache
def factory(role: str) -> str:
    """Where an installed package makes roles of this name. Raises ``ScenarioError`` if none does."""
    for entry in entry_points(group="trackfield.roles", name=role):
        return entry.value
    raise ScenarioError(f"no installed package offers the role {role!r}", expected="an entry point in trackfield.roles")


def _node(site: Site, index: int) -> ProcessSpec:
    id, x, y = site.sensors[index]
    threshold_db = site.scenario.sensor.threshold_db
    config = {"step_ns": site.step_ns, "threshold_db": threshold_db, "centre": CENTRE}
    return ProcessSpec(id, "node", factory("node"), config, x, y, site.acoustic(index).to_plain())


def _centre(site: Site) -> ProcessSpec:
    scenario = site.scenario
    config: dict[str, Any] = {
        "trackers": list(scenario.fusion.trackers),
        "sensors": [list(place) for place in site.believed],
        "step_ns": site.step_ns,
        "deadline_ns": round(scenario.fusion.deadline_s * NS),
        "doa_sd_deg": scenario.sensor.doa_sd_deg,
        "seed": scenario.seed,
        "prior": _prior(site),
    }
    return ProcessSpec(CENTRE, "fusion", factory("fusion"), config, *site.centre, sink=True)


def _prior(site: Site) -> Mapping[str, Sequence[float]] | None:
    """Zhai et al.: the initial estimate is drawn around the truth, anew for each run."""
    scenario = site.scenario
    truth, sd = site.path.at(0.0), scenario.fusion.prior_sd
    if scenario.fusion.prior == "none" or truth is None:
        return None
    draws = [normal(scenario.seed, CENTRE, "prior", i) for i in range(len(sd))]
    return {"mean": [x + s * z for x, s, z in zip(truth, sd, draws, strict=True)], "sd": list(sd)}


def _info(site: Site, spec: RunSpec, processes: Sequence[ProcessSpec]) -> FieldInfo:
    every_s = site.step_ns / NS / TRUTH_SAMPLES
    times = np.arange(site.steps * TRUTH_SAMPLES + 1) * every_s
    truth = tuple((t, state[0], state[1]) for t in times.tolist() if (state := site.path.at(t)) is not None)
    places = tuple(Place(p.id, p.role, p.x, p.y) for p in processes)
    trackers = tuple(site.scenario.fusion.trackers)
    return FieldInfo(spec.run, site.scenario.name, places, truth, site.path.gaps, trackers, spec.end_ns / NS)
