"""How well the target of a run could be known at all, on the scale of the trackers' errors.

Bounds along the true path (``trackfield/filters/bounds.py``), of trackers that go by what the sensors report.
The motion noise is the path's own: they are told how hard the target accelerates in each step, but not which way.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from math import radians
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from launcher.records import MessageRow, Plan
from trackfield.filters.bounds import information, position_sd, trajectory_crlb
from trackfield.filters.following import ANYWHERE
from trackfield.filters.gaussian import Motion
from trackfield.filters.measurement import OfSensor
from trackfield.filters.types import Array, Measurement, Model
from trackfield.models import motion
from trackfield.role import NS
from trackfield.world.sensors import make_sensor

Reporting = Mapping[int, Collection[str]]
"""Whose reports there are of each step."""
Series = dict[int, float]
"""A bound on the sd of the position (m) by step."""


def run_bound(plan: Plan, rows: Iterable[MessageRow]) -> Series:
    """The bound of each step for the reports that came of use; empty if there is none."""
    return _series(plan, came(plan, rows))


def scenario_bound(plan: Plan, rows: Iterable[MessageRow]) -> Series:
    """The bound of each step had all sensors in reach of the target reported it, besides those that did."""
    return _series(plan, _all(plan, came(plan, rows)))


def bound_metrics(plan: Plan, rows: Iterable[MessageRow], steps: Collection[int]) -> dict[str, float | None]:
    """The bounds over these steps as they stand in metrics.json: root mean squares, null where there is none."""
    kept = list(rows)
    series = {"position": scenario_bound(plan, kept), "trajectory": run_bound(plan, kept)}
    return {name: _rms([sd for step, sd in one.items() if step in steps]) for name, one in series.items()}


def came(plan: Plan, rows: Iterable[MessageRow]) -> Reporting:
    """Whose reports of each step came in time, or late but young enough to be taken in."""
    max_age_ns = _centre(plan).get("max_age_ns", 0)
    heard = defaultdict[int, set[str]](set)
    for row in rows:
        if row.step is None or row.due_ns is None:
            continue
        young = row.outcome == "late" and row.due_ns - row.step * plan.step_ns <= max_age_ns
        if row.outcome == "delivered" or young:
            heard[row.step].add(row.src)
    return heard


def _all(plan: Plan, heard: Reporting) -> Reporting:
    """With all sensors that are near enough to the target to report it."""
    sensors, truth = _sensors(plan), _truth(plan)
    if not sensors or not truth:
        return heard
    ids, steps = list(sensors), list(truth)
    near = cKDTree(list(sensors.values())).query_ball_point([truth[step][:2] for step in steps], plan.reach_m)
    return {step: {ids[i] for i in found} | set(heard.get(step, ())) for step, found in zip(steps, near, strict=True)}


def _series(plan: Plan, reporting: Reporting) -> Series:
    """From the start if there is a prior, else from when on the target is known to within ``lost_m``."""
    centre, truth, sensors = _centre(plan), _truth(plan), _sensors(plan)
    prior, sensor = centre.get("prior"), _sensor(centre)
    first = next((step for step in truth if step and (prior or reporting.get(step))), None)
    if first is None or min(sensor.sd) <= 0.0:
        return {}
    steps = [step for step in truth if step >= first]
    informations = np.stack([_information(truth[step], reporting.get(step, ()), sensors, sensor) for step in steps])
    begin = ANYWHERE if prior is None else np.diag(np.square(np.array(prior["sd"], float)))
    bounds = position_sd(trajectory_crlb(begin, _motions(truth, steps, plan.step_ns / NS), informations))
    known = bounds <= plan.lost_m
    shown = 0 if prior else int(known.argmax()) if known.any() else len(steps)
    return dict(zip(steps[shown:], bounds[shown:].tolist(), strict=True))


def _sensor(centre: Mapping[str, Any]) -> Measurement:
    """What a reading says; of no centre, and of bearings without error, nothing can be said."""
    own = OfSensor(make_sensor(**centre["sensor"])) if "sensor" in centre else None
    return Model(radians(centre.get("doa_sd_deg", 0.0)), own=own).sensor


def _information(
    state: Array, ids: Collection[str], places: Mapping[str, tuple[float, float]], sensor: Measurement
) -> Array:
    positions = np.reshape([places[id] for id in sorted(ids) if id in places], (-1, 2))
    slopes = sensor.jacobian(state, positions)  # (K, m, 4)
    return np.asarray(information(slopes, np.asarray(sensor.sd, float)).sum(axis=0))


def _motions(truth: Mapping[int, Array], steps: Collection[int], dt: float) -> Motion:
    """Nearly constant velocity (T, 4, 4), with as much acceleration in each step as there was."""
    moved = [truth[step][2:] - truth.get(step - 1, truth[step])[2:] for step in steps]
    square = np.square(moved).mean(axis=-1) / dt**2  # per axis
    return Motion(np.array(motion.transition(dt)), square[:, None, None] * np.array(motion.process_noise(dt, 1.0)))


def _centre(plan: Plan) -> Mapping[str, Any]:
    """What the fusion centre is told; nothing where there is none."""
    return next((process.config for process in plan.processes if process.role == "fusion"), {})


def _sensors(plan: Plan) -> dict[str, tuple[float, float]]:
    return {place.id: (place.x, place.y) for place in plan.info.places if place.role == "node"}


def _truth(plan: Plan) -> dict[int, Array]:
    """Where the target is at each step at which it is there."""
    states = ((step, plan.path.at(step * plan.step_ns / NS)) for step in range(plan.run.end_ns // plan.step_ns))
    return {step: np.array(state) for step, state in states if state is not None}


def _rms(values: Collection[float]) -> float | None:
    return float(np.sqrt(np.square(list(values)).mean())) if values else None
