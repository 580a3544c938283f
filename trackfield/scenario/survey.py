"""A scenario worked out: the targets' paths, the sensors, and when each sensor can hear a target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from trackfield.draw import normal
from trackfield.errors import ScenarioError, together
from trackfield.scenario.layouts import Ground
from trackfield.scenario.paths import MAX_STEPS, Course, PathSection, origin_of
from trackfield.scenario.places import Place, Point
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sensors import Acoustic
from trackfield.world.acoustic import AcousticSensor
from trackfield.world.path import Path
from trackfield.world.windows import Array, Windows, distances, merged, windows

Leg = tuple[int, float, float]

MOST_POINTS: Final = 500_000
"""Steps of all targets together."""
MOST_HEARERS: Final = 2_000_000
"""Sensors times targets."""
_NS: Final = 1_000_000_000


@dataclass(frozen=True)
class Site:
    """A scenario worked out; all times are emulated, in ns since the start of the run.

    Step k is at ``origin_ns`` + k ``step_ns``, up to and including ``steps``. ``paths`` are the targets' paths by
    id, in order. ``windows`` hold for each sensor when it may hear any target, in order and disjoint; ``believed``
    are the sensors at the places that the fusion centre assumes; ``centre`` is the centre's own place (m), and
    ``route`` its positions over time if it moves: (t ns, x m, y m), with straight lines between them.
    """

    scenario: Scenario
    paths: Mapping[str, Path]
    steps: int
    step_ns: int
    origin_ns: int
    sensors: tuple[Place, ...]
    believed: tuple[Place, ...]
    windows: tuple[Windows, ...]
    centre: Point
    route: tuple[Leg, ...] = ()

    @property
    def end_ns(self) -> int:
        """When a run ends: the last step's deadline falls after the paths' end; one step more lets it pass."""
        return self.origin_ns + (self.steps + 1) * self.step_ns

    def sound(self, index: int) -> dict[str, Any]:
        """The plain form of the sensor of this index, acoustic or a user's own."""
        scenario, paths = self.scenario, tuple(self.paths.values())
        return scenario.sensor.plain(self.sensors[index], paths, self.windows[index], scenario.seed)

    def acoustic(self, index: int, incarnation: int = 0) -> AcousticSensor:
        """The acoustic sensor of this index."""
        sensor, seed, paths = self.scenario.sensor, self.scenario.seed, tuple(self.paths.values())
        assert isinstance(sensor, Acoustic)
        return sensor.placed(self.sensors[index], paths, self.windows[index], seed, incarnation)


def survey(scenario: Scenario) -> Site:
    """Work a scenario out.

    Raises ``ScenarioError`` if a file cannot be used, there are no sensors, one has the fusion centre's id, or no
    target comes in range of any of them.
    """
    steps, found = target_paths(scenario)
    sensors, place = _stand(scenario, tuple(found.values()))
    if len(sensors) * len(found) > MOST_HEARERS:
        what = f"{len(sensors)} sensors may hear {len(found)} targets"
        raise ScenarioError(what, key="targets", expected=f"at most {MOST_HEARERS} pairs of the two")
    check(scenario, sensors, tuple(found.values()))
    positions = np.array([place[1:] for place in sensors])
    awake_m, _ = scenario.sensor.reach_m()
    setup_s = scenario.run.setup_s
    origin_ns = round(setup_s * _NS)
    paths = {id: path.shifted(setup_s) for id, path in found.items()}
    heard = [windows(positions, path, awake_m) for path in paths.values()]
    return Site(
        scenario=scenario,
        paths=paths,
        steps=steps,
        step_ns=_step_ns(scenario),
        origin_ns=origin_ns,
        sensors=tuple(sensors),
        believed=tuple(believed(scenario, sensors)),
        windows=tuple(map(merged, zip(*heard, strict=True))),
        centre=_centre(scenario, place, positions),
        route=tuple((origin_ns + round(t * _NS), x, y) for t, x, y in scenario.fusion.path or ()),
    )


def _stand(scenario: Scenario, paths: tuple[Path, ...]) -> tuple[list[Place], Point | None]:
    """The sensors, and where the fusion centre stands if the layout says so."""
    centre = scenario.architecture.centre_id
    origin = partial(origin_of, scenario.keyed_targets)
    sensors, place = scenario.field.stand(Ground(scenario.seed, paths, centre, origin))
    if centre is not None and any(id == centre for id, *_ in sensors):
        what = f"is {centre!r}, which is also a sensor's id"
        raise ScenarioError(what, key="architecture.centre", expected="an id that no sensor has")
    return sensors, place


def believed(scenario: Scenario, sensors: Sequence[Place]) -> Sequence[Place]:
    """The sensors at the places that the fusion centre assumes: off by a Gaussian error, east and north."""
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
        return fusion.path[0][1:]  # where it rests until then: no time of a path is below 0
    east, north = surveyed or ((positions.min(axis=0) + positions.max(axis=0)) / 2).tolist()
    return east if fusion.x_m is None else fusion.x_m, north if fusion.y_m is None else fusion.y_m


def target_paths(scenario: Scenario) -> tuple[int, dict[str, Path]]:
    """The number of steps, and each target's path by its id, from the first step to the last at most.

    Raises ``ScenarioError`` if a file cannot be used, or a target is not present for a whole step.
    """
    step_ns, targets = _step_ns(scenario), scenario.keyed_targets
    origin = origin_of(targets) if len(targets) > 1 else None  # a single target decides the origin itself
    course = partial(Course, scenario.seed, step_ns, scenario.steps, origin)
    followed = 0

    def run(key: str, target: PathSection) -> tuple[int, Path]:
        nonlocal followed
        if followed > MOST_POINTS:
            what = f"the paths of {len(targets)} targets have more than {MOST_POINTS} steps in all"
            raise ScenarioError(what, key="targets", expected="fewer targets, or fewer or longer steps")
        steps, path = target.run(course(key))
        followed += steps
        return steps, path

    runs = together(partial(run, key, target) for key, target in targets)
    longest = max(steps for steps, _ in runs)
    steps = min(longest, scenario.steps or longest)
    if steps > MAX_STEPS:
        what, key = f"the run would have {steps} steps", f"{targets[0][0]}.steps"
        raise ScenarioError(what, key=key, expected=f"at most {MAX_STEPS}, the highest step that a report can hold")
    end_s = steps * step_ns / _NS
    for (key, _), (there_for, path) in zip(targets, runs, strict=True):
        if there_for < 1 or path.start_s > end_s:
            there = f"{path.start_s:g} s to {path.end_s:g} s"
            what = f"the target is present from {there}, but the run ends after {end_s:g} s"
            raise ScenarioError(what, key=f"{key}.steps", expected="at least one step at which it is present")
    return steps, {target.id: path.clip(0.0, end_s) for (_, target), (_, path) in zip(targets, runs, strict=True)}


def check(scenario: Scenario, sensors: Sequence[Place], paths: Sequence[Path]) -> None:
    """Raise ``ScenarioError`` unless some target comes near enough to some sensor for a report."""
    positions = np.array([place[1:] for place in sensors])
    _, radius = scenario.sensor.reach_m()
    if any(np.isfinite(distances(positions, path, radius)).any() for path in paths):
        return
    far = np.min([distances(positions, path, np.inf) for path in paths], axis=0)
    nearest = f"{far.min():.0f} m from {sensors[int(far.argmin())][0]}, the nearest"
    what = "the target never comes in range: it stays" if len(paths) == 1 else "no target comes in range: they stay"
    expected = f"a path within the {radius:.0f} m in which a sensor hears a target"
    raise ScenarioError(f"{what} {nearest}", key=scenario.sensor.reach_key, expected=expected)


def _step_ns(scenario: Scenario) -> int:
    return round(scenario.step_s * _NS)
