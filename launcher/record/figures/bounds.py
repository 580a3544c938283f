"""How well the target of a run could be known at all, on the scale of the trackers' errors.

Bounds along the true path (``trackfield/filters/bounds.py``), for trackers that use what the sensors report. The motion
noise is that of the path: the trackers know how hard the target accelerates in each step, but not in which direction.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from launcher.record.tables import Bounds, TrackRow
from launcher.record.views import headline
from launcher.records import SENSES, Plan
from trackfield.filters.bounds import position_sd, trajectory_crlb
from trackfield.filters.gaussian import Motion
from trackfield.filters.measurement import extended, sensing_information, widened
from trackfield.filters.metrics import LOST_M
from trackfield.filters.types import Array, Gaussian, Model, Readings, Reports
from trackfield.models import motion
from trackfield.role import NS
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.following import SPEED_SD, anywhere

Point = tuple[float, float]
Key = tuple[str, str, str, int]
"""(source, tracker, target, instant) of a point."""
Reporting = Mapping[int, Collection[str]]
"""The sensors that reported of each instant (ns)."""
Series = Mapping[int, float]
"""A bound on the sd of the position (m) by instant (ns)."""


def run_bounds(plan: Plan, rows: Collection[TrackRow]) -> dict[str, Series]:
    """The bound of each source's tracks: that of the reports which the process used that made the point.

    Processes that take turns (``term``) hand their beliefs on, so together they are as one. Where a source has points
    of several processes at one instant, the lowest bound holds.
    """
    chains, origins = defaultdict[str, list[TrackRow]](list), _origins(rows)
    for row in rows:
        chains[_chain(row, origins)].append(row)
    series = {chain: run_bound(plan, made) for chain, made in chains.items()}
    sources = defaultdict[str, list[tuple[int, Series]]](list)
    for row in rows:
        sources[row.point.source].append((row.t_ns, series[_chain(row, origins)]))
    return {source: _lowest(holding) for source, holding in sources.items()}


def headline_bound(plan: Plan, rows: Iterable[TrackRow], bounds: Bounds) -> Series:
    """The bound of the points of the plan's first view, of all rows of a run and what ``run_bounds`` found for them."""
    return _lowest([(row.t_ns, bounds[row.point.source]) for row in headline(plan, rows)])


def _origins(rows: Iterable[TrackRow]) -> dict[Key, str]:
    return {_key(row): row.point.origin for row in rows if row.point.origin}


def _chain(row: TrackRow, origins: Mapping[Key, str]) -> str:
    """The process that made a point, which its source may have had over several others; empty if it took turns."""
    if row.point.term:
        return ""
    source, tracker, target, t_ns = _key(row)
    passed = {source}
    while (before := origins.get((source, tracker, target, t_ns))) and before not in passed:
        passed.add(source := before)
    return source


def _key(row: TrackRow) -> Key:
    return row.point.source, row.point.tracker, row.point.target, row.t_ns


def _lowest(holding: Collection[tuple[int, Series]]) -> Series:
    """The lowest of the bounds that hold at each instant; none if one of them has none there.

    If the same one holds at all instants, it is known also between them.
    """
    if len({id(series) for _, series in holding}) == 1:
        return next(series for _, series in holding)
    several = defaultdict[int, list[Series]](list)
    for t_ns, series in holding:
        several[t_ns].append(series)
    return {
        t_ns: min(series[t_ns] for series in found)
        for t_ns, found in several.items()
        if all(t_ns in series for series in found)
    }


def run_bound(plan: Plan, rows: Iterable[TrackRow]) -> Series:
    """The bound at each step for the reports that these points used; empty if there is none.

    With several targets it is unknown which report is of which, so there is none.
    """
    return _series(plan, used(rows))


def scenario_bound(plan: Plan, rows: Iterable[TrackRow]) -> Series:
    """The bound at each step had all sensors in reach of the target reported it, besides those that did."""
    return _series(plan, _all(plan, used(rows)))


def bound_metrics(plan: Plan, rows: Iterable[TrackRow], of_run: Mapping[int, float]) -> dict[str, float | None]:
    """The bounds as they stand in metrics.json, where there are a track and a recorded truth: rms, null without any.

    ``of_run`` is what ``run_bound`` found for these rows.
    """
    kept = list(rows)
    at = {row.t_ns for row in kept if row.has_track and row.truth and not row.interpolated}
    series = {"position": scenario_bound(plan, kept), "trajectory": of_run}
    return {name: _rms([sd for t_ns, sd in one.items() if t_ns in at]) for name, one in series.items()}


def used(rows: Iterable[TrackRow]) -> Reporting:
    """The sensors whose reports of each instant any of these points used."""
    reporting = defaultdict[int, set[str]](set)
    for row in rows:
        reporting[row.t_ns].update(row.point.sensors)
    return reporting


def _all(plan: Plan, heard: Reporting) -> Reporting:
    """With all sensors that are near enough to the target to report it."""
    from scipy.spatial import cKDTree

    sensors, truth = _sensors(plan), _truth(plan)
    if not sensors or not truth:
        return heard
    ids, times = list(sensors), list(truth)
    near = cKDTree(list(sensors.values())).query_ball_point([truth[t][:2] for t in times], plan.reach_m)
    told = {t: {id for id in plan.passes if _foretold(plan, id, plan.step_of(t), heard)} for t in times}
    return {
        t: {id for i in found if _reports(plan, id := ids[i], sensors[id], truth[t])} | told[t] | set(heard.get(t, ()))
        for t, found in zip(times, near, strict=True)
    }


def _foretold(plan: Plan, id: str, step: int, heard: Reporting) -> bool:
    """Whether a sensor that reports by itself was to report for a step, and did for none beside it.

    Noise may move what it says into the step before or after.
    """
    beside = (plan.origin_ns + one * plan.step_ns for one in (step - 1, step + 1))
    return step in plan.passes[id] and not any(id in heard.get(t, ()) for t in beside)


def _reports(plan: Plan, id: str, place: Point, state: Array) -> bool:
    """Whether a sensor that is read at steps reports a target in this state."""
    return id not in plan.passes and bool(np.hypot(*(state[:2] - place)) <= plan.reaches.get(id, 0.0))


def _series(plan: Plan, reporting: Reporting) -> Series:
    """From the start if there is a prior, else from the time when the target is known to within ``lost_m``."""
    truth, sensors = _truth(plan), _sensors(plan)
    prior, model = plan.tracking.get("prior"), _model(plan)
    first = next((t for t in truth if t > plan.origin_ns and (prior or reporting.get(t))), None)
    if first is None or model is None:
        return {}
    times = [t for t in truth if t >= first]
    informations = np.stack([_information(plan, t, truth[t], reporting.get(t, ()), sensors, model) for t in times])
    speed_sd = plan.tracking.get("speed_sd", SPEED_SD)
    begin = anywhere(speed_sd) if prior is None else np.diag(np.square(np.array(prior["sd"], float)))
    begin = extended(Gaussian(np.zeros(4), begin), model.unknowns).covariance
    bounds = position_sd(trajectory_crlb(begin, _motions(truth, times, plan.step_ns, model), informations))
    known = bounds <= plan.tracking.get("lost_m", LOST_M)
    shown = 0 if prior else int(known.argmax()) if known.any() else len(times)
    return dict(zip(times[shown:], bounds[shown:].tolist(), strict=True))


def _model(plan: Plan) -> Model | None:
    """What is known of the sensors; None if no process tracks, and then there is no bound."""
    sensing = plan.tracking.get("sensing")
    return Model({name: _reported(**arguments) for name, arguments in sensing.items()}) if sensing else None


def _reported(options: Mapping[str, Any], **others: Any) -> Kind:
    """A kind with all that its reports say: of passes also how loud they were, which solvers always use."""
    kind = make_sensor(options=options, **others)
    if kind.passes is None or kind.m > 1:
        return kind
    return make_sensor(options={**options, "use_strength": True}, **others)


def _information(
    plan: Plan, t_ns: int, state: Array, ids: Collection[str], places: Mapping[str, Point], model: Model
) -> Array:
    """That of the reports of these sensors for a step, at the true ``state`` (4,); unknowns are taken at their means.

    What a sensor reports by itself it measured at its planned instant, or at the step's if none is planned.
    """
    step = plan.step_of(t_ns)
    kinds: Mapping[str, Collection[str]] = plan.tracking.get("kinds", dict.fromkeys(model.kinds, places))
    known, readings = list[str](), list[Readings]()
    for name, kind in model.kinds.items():
        mine = sorted(id for id in ids if id in places and id in kinds[name])
        known += mine
        early_s = [(t_ns - plan.passes.get(id, {}).get(step, t_ns)) / NS for id in mine]
        readings.append(
            Readings(name, np.zeros((len(mine), len(kind.sd))), np.array(early_s) if any(early_s) else None)
        )
    positions = np.reshape([places[id] for id in known], (-1, 2))
    x = np.append(state, [one.mean for one in model.unknowns])
    return sensing_information(model, x, Reports(0, tuple(known), positions, tuple(readings)))


def _motions(truth: Mapping[int, Array], times: Collection[int], step_ns: int, model: Model) -> Motion:
    """Nearly constant velocity (T, 4 + u, 4 + u), with as much acceleration in each step as there was."""
    dt = step_ns / NS
    moved = [truth[t][2:] - truth.get(t - step_ns, truth[t])[2:] for t in times]
    square = np.square(moved).mean(axis=-1) / dt**2  # per axis
    motions = Motion(np.array(motion.transition(dt)), square[:, None, None] * np.array(motion.process_noise(dt, 1.0)))
    if not model.unknowns:
        return motions
    wide = [widened(Motion(motions.F, Q), model.unknowns, dt) for Q in motions.Q]
    return Motion(wide[0].F, np.stack([one.Q for one in wide]))


def _sensors(plan: Plan) -> dict[str, Point]:
    return {place.id: (place.x, place.y) for place in plan.info.tagged(SENSES)}


def _truth(plan: Plan) -> dict[int, Array]:
    """Where the target is at each step (ns) at which it is there; empty if there are several."""
    if len(plan.paths) != 1:
        return {}
    (path,) = plan.paths.values()
    times = range(plan.origin_ns, plan.run.end_ns, plan.step_ns)
    return {t: np.array(state) for t in times if (state := path.at(t / NS)) is not None}


def _rms(values: Collection[float]) -> float | None:
    return float(np.sqrt(np.square(list(values)).mean())) if values else None
