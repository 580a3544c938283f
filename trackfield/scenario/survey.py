"""What a scenario comes to: the targets' paths, the sensors, and who can hear them when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from trackfield.draw import normal
from trackfield.errors import ScenarioError
from trackfield.scenario.layouts import Ground
from trackfield.scenario.paths import MAX_STEPS, Course
from trackfield.scenario.places import Place, Point
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sensors import Acoustic
from trackfield.world.acoustic import AcousticSensor
from trackfield.world.path import Path
from trackfield.world.readings import Window
from trackfield.world.windows import Array, distances, windows

Leg = tuple[int, float, float]

_NS: Final = 1_000_000_000


@dataclass(frozen=True)
class Site:
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
    centre: Point
    route: tuple[Leg, ...] = ()

    def sound(self, index: int) -> dict[str, Any]:
        """The plain form of the sensor of this index, acoustic or of a user's own."""
        scenario = self.scenario
        return scenario.sensor.plain(self.sensors[index], [self.path], self.windows[index], scenario.seed)

    def acoustic(self, index: int, incarnation: int = 0) -> AcousticSensor:
        """What the acoustic sensor of this index hears."""
        sensor, seed = self.scenario.sensor, self.scenario.seed
        assert isinstance(sensor, Acoustic)
        return sensor.placed(self.sensors[index], [self.path], self.windows[index], seed, incarnation)


def survey(scenario: Scenario) -> Site:
    """Work a scenario out.

    Raises ``ScenarioError`` if a file cannot be used, there are no sensors, or the target comes in range of
    none of them.
    """
    steps, path = target_path(scenario)
    sensors, centre = scenario.field.stand(Ground(scenario.seed, (scenario.target,), (path,)))
    check(scenario, sensors, path)
    positions = np.array([place[1:] for place in sensors])
    awake_m, _ = scenario.sensor.reach_m()
    return Site(
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


def believed(scenario: Scenario, sensors: Sequence[Place]) -> Sequence[Place]:
    """The sensors where the fusion centre takes them to stand: off by a Gaussian error, east and north."""
    seed, sd = scenario.seed, scenario.sensor.position_error_m
    if not sd:
        return sensors
    error = partial(normal, seed)
    return [
        (id, x + sd * error(id, 0, "position", "x"), y + sd * error(id, 0, "position", "y")) for id, x, y in sensors
    ]


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
    steps, path = target.run(Course(scenario.seed, step_ns, target.steps))
    steps = min(steps, target.steps or steps)
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
    _, radius = scenario.sensor.reach_m()
    if np.isfinite(distances(positions, path, radius)).any():
        return
    far = distances(positions, path, np.inf)
    nearest = f"{far.min():.0f} m from {sensors[int(far.argmin())][0]}, the nearest"
    what = f"the target never comes in range: it stays {nearest}"
    expected = f"a path within the {radius:.0f} m that a sensor hears"
    raise ScenarioError(what, key=scenario.sensor.reach_key, expected=expected)


def _step_ns(scenario: Scenario) -> int:
    return round(scenario.target.step_s * _NS)
