"""What a scenario comes to: the target's path, the sensors, and who can hear it when."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np

from trackfield.errors import ScenarioError
from trackfield.models.sound import audible_radius
from trackfield.scenario.layout import believed, layout
from trackfield.scenario.places import Place, Point
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sections import MAX_STEPS, FromFile, Manoeuvre
from trackfield.scenario.sensing import Acoustic
from trackfield.world import targets
from trackfield.world.acoustic import AcousticSensor, Window
from trackfield.world.own import PlacedSensor, plain
from trackfield.world.path import Path
from trackfield.world.sensors import SENSORS, make_sensor
from trackfield.world.tracks import read_track
from trackfield.world.windows import Array, distances, windows

Leg = tuple[int, float, float]

_NS: Final = 1_000_000_000
_LENGTH_S: Final = {"s1": 60, "s2": 75, "s3": 40}


@dataclass(frozen=True)
class Plan:
    """A scenario worked out; all times in ns since the start of the run.

    The steps are at 0, ``step_ns``, ... up to and including ``steps`` times ``step_ns``. ``windows`` hold
    each sensor's audible windows; ``believed`` are the sensors where the fusion centre takes them to stand;
    ``centre`` is where it stands itself (m), and if it drives, ``route`` when it is where: (t ns, x m, y m), in a
    straight line from one to the next.
    """

    scenario: Scenario
    path: Path
    steps: int
    step_ns: int
    sensors: tuple[Place, ...]
    believed: tuple[Place, ...]
    windows: tuple[tuple[Window, ...], ...]
    centre: tuple[float, float]
    route: tuple[Leg, ...] = ()

    def sound(self, index: int) -> dict[str, Any]:
        """The plain form of the sensor of this index, acoustic or of a user's own."""
        sensor = self.scenario.sensor
        if isinstance(sensor, Acoustic):
            return self.acoustic(index).to_plain()
        name, x, y = self.sensors[index]
        made = make_sensor(sensor.kind, sensor.options)
        placed = PlacedSensor(name, (x, y), self.path, self.windows[index], made, self.scenario.seed)
        return plain(placed, sensor.kind, sensor.options, SENSORS.place(sensor.kind))

    def acoustic(self, index: int, incarnation: int = 0) -> AcousticSensor:
        """What the acoustic sensor of this index hears."""
        name, x, y = self.sensors[index]
        sensor = self.scenario.sensor
        assert isinstance(sensor, Acoustic)
        return AcousticSensor(
            id=name,
            position=(x, y),
            path=self.path,
            windows=self.windows[index],
            source_db=sensor.level_db,
            alpha=sensor.alpha,
            audible_db=sensor.audible_db,
            doa_sd_deg=sensor.doa_sd_deg,
            level_sd_db=sensor.level_sd_db,
            seed=self.scenario.seed,
            incarnation=incarnation,
        )


def plan(scenario: Scenario) -> Plan:
    """Work a scenario out.

    Raises ``ScenarioError`` if a file cannot be used, there are no sensors, or the target comes in range of
    none of them.
    """
    steps, path = target_path(scenario)
    sensors, centre = layout(scenario, path)
    check(scenario, sensors, path)
    positions = np.array([place[1:] for place in sensors])
    awake_m, _ = reach_m(scenario)
    return Plan(
        scenario=scenario,
        path=path,
        steps=steps,
        step_ns=_step_ns(scenario),
        sensors=tuple(sensors),
        believed=tuple(believed(scenario, sensors)),
        windows=tuple(windows(positions, path, awake_m)),
        centre=_centre(scenario, centre, positions),
        route=tuple((round(t * _NS), x, y) for t, x, y in scenario.fusion.path or ()),
    )


def _centre(scenario: Scenario, surveyed: Point | None, positions: Array) -> Point:
    """Where the fusion centre stands at the start: as its section says, as its file says, or amid the sensors."""
    fusion = scenario.fusion
    if fusion.path is not None:
        return fusion.path[0][1:]  # from the start on: no time in it is below 0
    east, north = surveyed or ((positions.min(axis=0) + positions.max(axis=0)) / 2).tolist()
    return east if fusion.x_m is None else fusion.x_m, north if fusion.y_m is None else fusion.y_m


def target_path(scenario: Scenario) -> tuple[int, Path]:
    """The number of steps, and the target's path for as long as they take.

    Raises ``ScenarioError`` if its file cannot be used, or if it is not there long enough for a step.
    """
    target, step_ns = scenario.target, _step_ns(scenario)
    if isinstance(target, Manoeuvre):
        steps = target.steps or _LENGTH_S[target.path] * _NS // step_ns
        end_s = steps * step_ns / _NS
        match target.path:
            case "s1":
                return steps, targets.s1(scenario.seed, steps, step_ns / _NS)
            case "s2":
                return steps, targets.s2(end_s)
            case "s3":
                return steps, targets.s3(end_s)
    if isinstance(target, FromFile):
        path = read_track(FilePath(target.file), target.from_, target.to)
    else:
        path = targets.waypoints(target.waypoints)
    steps = min(round(path.end_s * _NS) // step_ns, target.steps or sys.maxsize)
    if steps > MAX_STEPS:
        what = f"the run would have {steps} steps"
        raise ScenarioError(what, key="target.steps", expected=f"at most {MAX_STEPS}, as far as a report counts")
    end_s = steps * step_ns / _NS
    if steps < 1 or path.start_s > end_s:
        there = f"{path.start_s:g} s to {path.end_s:g} s"
        what = f"the target is there from {there}, and the run ends after {end_s:g} s"
        raise ScenarioError(what, key="target.steps", expected="some step at which it is there")
    return steps, path.clip(0.0, end_s)


def check(scenario: Scenario, sensors: Sequence[Place], path: Path) -> None:
    """Raise ``ScenarioError`` unless the target comes near enough to some sensor for a report."""
    positions = np.array([place[1:] for place in sensors])
    _, radius = reach_m(scenario)
    if np.isfinite(distances(positions, path, radius)).any():
        return
    far = distances(positions, path, np.inf)
    nearest = f"{far.min():.0f} m from {sensors[int(far.argmin())][0]}, the nearest"
    what = f"the target never comes in range: it stays {nearest}"
    key = "sensor.threshold" if isinstance(scenario.sensor, Acoustic) else "sensor.range_m"
    raise ScenarioError(what, key=key, expected=f"a path within the {radius:.0f} m that a sensor hears")


def reach_m(scenario: Scenario) -> tuple[float, float]:
    """How near (m) the target has to be for a sensor to be awake, and for it to report, if its threshold is lowest.

    Raises ``ScenarioError`` for a sensor of a user's own that there is not, or whose options do not fit.
    """
    sensor = scenario.sensor
    if not isinstance(sensor, Acoustic):
        range_m = make_sensor(sensor.kind, sensor.options).range_m
        return range_m, range_m
    awake_db, report_db = sensor.audible_db, sensor.thresholds_db[0]
    awake_m, report_m = (audible_radius(sensor.level_db, sensor.alpha, db) for db in (awake_db, report_db))
    return awake_m, report_m


def _step_ns(scenario: Scenario) -> int:
    return round(scenario.target.step_s * _NS)
