"""From a scenario and a seed to what every process must know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from launcher.records import FieldInfo, Place, Plan
from trackfield.draw import normal
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.models.sound import audible_radius
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.scenario.layout import check, layout, target_path
from trackfield.world.acoustic import AcousticSensor
from trackfield.world.path import Path
from trackfield.world.windows import windows

CENTRE: Final = "fusion"
TRUTH_SAMPLES: Final = 4
"""Points of the true path per step, in pictures."""

Placed = Sequence[tuple[str, float, float]]


def make_plan(scenario: Scenario, *, seed: int, run: str, speed: float = 1.0) -> Plan:
    """Lay out the field, compute what can be heard when, and write each process's part.

    Raises ``ScenarioError`` where there is no sensor, or the target is never in range of one.
    """
    sensor = scenario.sensor
    path = target_path(scenario, seed)
    placed = layout(scenario, path)
    audible_db = sensor.threshold * sensor.level_db - sensor.margin_db
    radius = audible_radius(sensor.level_db, sensor.alpha, audible_db)
    heard = windows(np.array([(x, y) for _, x, y in placed], float).reshape(-1, 2), path, radius)
    check(scenario, placed, heard)
    step_ns = round(scenario.target.step_s * NS)
    steps = int(path.end_s / scenario.target.step_s + 1e-9)
    nodes = [
        _node(scenario, seed, id, x, y, path, tuple(w), audible_db, step_ns)
        for (id, x, y), w in zip(placed, heard, strict=True)
    ]
    centre = _centre(scenario, seed, placed, path, step_ns)
    spec = RunSpec(run, seed, (steps + 1) * step_ns, scenario.plain()["link"], speed)
    processes = (centre, *nodes)
    return Plan(spec, processes, path, _info(scenario, spec, processes, path), step_ns)


def _node(
    scenario: Scenario,
    seed: int,
    id: str,
    x: float,
    y: float,
    path: Path,
    heard: tuple[tuple[int, int], ...],
    audible_db: float,
    step_ns: int,
) -> ProcessSpec:
    s = scenario.sensor
    sensor = AcousticSensor(
        id, (x, y), path, heard, s.level_db, s.alpha, audible_db, s.doa_sd_deg, s.level_sd_db, seed
    )
    config = {"step_ns": step_ns, "threshold_db": s.threshold * s.level_db, "centre": CENTRE}
    return ProcessSpec(id, "node", config, x, y, sensor.to_plain())


def _centre(scenario: Scenario, seed: int, placed: Placed, path: Path, step_ns: int) -> ProcessSpec:
    config: dict[str, Any] = {
        "trackers": list(scenario.fusion.trackers),
        "sensors": [list(place) for place in placed],
        "step_ns": step_ns,
        "deadline_ns": round(scenario.fusion.deadline_s * NS),
        "doa_sd_deg": scenario.sensor.doa_sd_deg,
        "seed": seed,
        "prior": _prior(scenario, seed, path),
    }
    x, y = np.mean([(x, y) for _, x, y in placed], axis=0).tolist()
    return ProcessSpec(CENTRE, "fusion", config, x, y)


def _prior(scenario: Scenario, seed: int, path: Path) -> Mapping[str, Sequence[float]] | None:
    """Zhai et al.: the initial estimate is drawn around the truth, anew for each run."""
    if scenario.fusion.prior == "none":
        return None
    truth, sd = path.at(0.0), scenario.fusion.prior_sd
    assert truth is not None
    mean = [x + s * normal(seed, CENTRE, "prior", i) for i, (x, s) in enumerate(zip(truth, sd, strict=True))]
    return {"mean": mean, "sd": list(sd)}


def _info(scenario: Scenario, spec: RunSpec, processes: Sequence[ProcessSpec], path: Path) -> FieldInfo:
    times = np.arange(0.0, path.end_s + 1e-9, scenario.target.step_s / TRUTH_SAMPLES).tolist()
    truth = tuple((t, state[0], state[1]) for t in times if (state := path.at(t)) is not None)
    places = tuple(Place(p.id, p.role, p.x, p.y) for p in processes)
    trackers = tuple(scenario.fusion.trackers)
    return FieldInfo(spec.run, scenario.name, places, truth, path.gaps, trackers, spec.end_ns / NS)
