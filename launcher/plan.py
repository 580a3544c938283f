"""From a scenario to what every process must know."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Final

import numpy as np

from fusion.smoothing import lagged_names
from launcher.extensions import own_sensor, tracker_places
from launcher.faults import Faults, Mark, resolve
from launcher.hardware import FJ_PER_MJ, clock_of, duty_of, power_of, sync_of
from launcher.records import FieldInfo, Place, Plan
from trackfield.draw import normal
from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import make_tracker
from trackfield.link.models import make_link
from trackfield.link.places import Places
from trackfield.role import NS
from trackfield.scenario import Scenario, Site, survey
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.options import tables
from trackfield.scenario.sensors import Acoustic, OwnSensor
from trackfield.wire.registry import product_kinds

TRUTH_SAMPLES: Final = 4
"""Points of the true path per step, in pictures."""


def make_plan(scenario: Scenario, *, run: str, speed: float = 1.0) -> Plan:
    """Lay out the field, compute what can be heard when, and write each process's part.

    Raises ``ScenarioError`` where there is no sensor, the target is never in range of one, the link's file is of no
    use, or a fault befalls somebody who is not there.
    """
    site = survey(scenario)
    # The last step's deadline falls after the path's end; one step more lets it pass.
    end_ns = (site.steps + 1) * site.step_ns
    faults = resolve(
        scenario.faults, scenario.seed, [id for id, *_ in site.sensors], [scenario.architecture.centre], end_ns
    )
    link = scenario.plain()["link"]
    queue = {"queue": link.pop("queue")} if "queue" in link else {}  # of the process, not of what is in the air
    spec = RunSpec(run, scenario.seed, end_ns, link, speed, faults.partitions, **queue)
    _check_link(spec)
    # Nodes and centre send to each other, and nobody else.
    centre = _centre(site)
    nodes = [life for node in _nodes(site, places_of([centre]), end_ns) for life in _lives(node, faults)]
    processes = (*_lives(replace(centre, peers=places_of(nodes)), faults), *nodes)
    info = _info(site, spec, processes, faults.marks)
    _, report_m = scenario.sensor.reach_m()
    again, lost_m = scenario.restart == "on-death", scenario.fusion.lost_m
    return Plan(spec, processes, next(iter(site.paths.values())), info, site.step_ns, report_m, again, lost_m)


def _check_link(spec: RunSpec) -> None:
    """Raise ``ScenarioError`` unless the link can be made; the scenario checked all but its file and ``acks``."""
    for kind in spec.link.get("acks", {}):
        known = [one.name for one in product_kinds()]
        if kind not in known:
            what = f"there is no message {kind!r}{suggestion(kind, known)}"
            raise ScenarioError(what, key="link.acks", expected=f"names of messages: {', '.join(known)}")
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


def _lives(process: ProcessSpec, faults: Faults) -> list[ProcessSpec]:
    """The process in each of its lives; a sensor's noise is another in each, its clock and its faults stay."""
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


def _nodes(site: Site, peers: Places, end_ns: int) -> Iterator[ProcessSpec]:
    """The sensor nodes; what is the same for all of them is there once."""
    scenario, role = site.scenario, factory("node")
    power = power_of(scenario, scenario.energy.battery_j, round(scenario.energy.sample_mj * FJ_PER_MJ))
    for index, (id, x, y) in enumerate(site.sensors):
        config: dict[str, Any] = {
            "step_ns": site.step_ns,
            **_threshold_db(scenario),
            "centre": scenario.architecture.centre,
            **_if_used(sync=sync_of(scenario, id), adaptive=duty_of(scenario, end_ns)),
        }
        sound, clock = site.sound(index), clock_of(scenario, id)
        yield ProcessSpec(id, "node", role, config, x, y, sound, peers=peers, clock=clock, power=power)


def _centre(site: Site) -> ProcessSpec:
    scenario = site.scenario
    config: dict[str, Any] = {
        "trackers": list(scenario.fusion.trackers),
        "sensors": [list(place) for place in site.believed],
        "step_ns": site.step_ns,
        "deadline_ns": round(scenario.fusion.deadline_s * NS),
        **_noise(scenario),
        "seed": scenario.seed,
        "prior": _prior(site),
        "sigma_v": scenario.fusion.sigma_v,
        "lost_m": scenario.fusion.lost_m,
        **_if_used(
            options=tables(scenario.fusion.options),
            places=tracker_places(scenario.fusion),
            max_age_ns=round(scenario.fusion.max_age_s * NS),
            smooth_lag=scenario.fusion.smooth_lag,
            threshold=_threshold(scenario),
        ),
    }
    return ProcessSpec(
        scenario.architecture.centre,
        "fusion",
        factory("fusion"),
        config,
        *site.centre,
        sink=True,
        power=power_of(scenario, scenario.energy.centre_battery_j),
        legs=site.route,
    )


def _if_used(**more: Any) -> dict[str, Any]:
    """Those that are not off: a role has them off by default, and a thousand nodes need not be told so."""
    return {name: value for name, value in more.items() if value}


def _threshold_db(scenario: Scenario) -> Mapping[str, float]:
    """The level from which sensors report, if they measure one."""
    return {"threshold_db": scenario.sensor.threshold_db} if isinstance(scenario.sensor, Acoustic) else {}


def _noise(scenario: Scenario) -> Mapping[str, Any]:
    """What the fusion centre must know of its reports: how they are off, or of what kind of sensor they are."""
    sensor = scenario.sensor
    if isinstance(sensor, OwnSensor):
        return {"sensor": own_sensor(scenario, sensor)}
    return {"doa_sd_deg": sensor.doa_sd_deg} if isinstance(sensor, Acoustic) else {}


def _threshold(scenario: Scenario) -> Mapping[str, float] | None:
    """Within which bounds the centre sets the sensors' threshold, beginning where, and whom it tells; None: never."""
    sensor = scenario.sensor
    if not isinstance(sensor, Acoustic) or not sensor.adaptive:
        return None
    low, high = sensor.thresholds_db
    awake_m, _ = scenario.sensor.reach_m()
    return {
        "low_db": low,
        "high_db": high,
        "start_db": sensor.threshold_db,
        "target_sd_m": scenario.fusion.target_sd_m,
        "reach_m": awake_m,
    }


def _prior(site: Site) -> Mapping[str, Sequence[float]] | None:
    """Zhai et al.: the initial estimate is drawn around the truth, anew for each run."""
    scenario = site.scenario
    truth, sd = next(iter(site.paths.values())).at(0.0), scenario.fusion.prior_sd
    if scenario.fusion.prior == "none" or truth is None:
        return None
    draws = [normal(scenario.seed, "fusion", "prior", i) for i in range(len(sd))]
    return {"mean": [x + s * z for x, s, z in zip(truth, sd, draws, strict=True)], "sd": list(sd)}


def _tracks(scenario: Scenario) -> tuple[str, ...]:
    """The names of all tracks, smoothed ones last."""
    names, options = scenario.fusion.trackers, tables(scenario.fusion.options)
    made = ((name, make_tracker(name, options.get(name))) for name in names)
    return (*names, *lagged_names(made, scenario.fusion.smooth_lag))


def _info(site: Site, spec: RunSpec, processes: Sequence[ProcessSpec], marks: tuple[Mark, ...]) -> FieldInfo:
    every_s = site.step_ns / NS / TRUTH_SAMPLES
    times = np.arange(site.steps * TRUTH_SAMPLES + 1) * every_s
    truth = tuple(
        (t, state[0], state[1]) for t in times.tolist() if (state := next(iter(site.paths.values())).at(t)) is not None
    )
    places = tuple(Place(p.id, p.role, p.x, p.y) for p in processes if not p.incarnation)
    paths = tuple((p.id, p.legs) for p in processes if p.legs and not p.incarnation)
    return FieldInfo(
        spec.run,
        site.scenario.name,
        places,
        truth,
        next(iter(site.paths.values())).gaps,
        _tracks(site.scenario),
        spec.end_ns / NS,
        marks,
        paths=paths,
    )
