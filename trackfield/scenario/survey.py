"""A scenario worked out: the targets' paths, the sensors, and when each sensor can hear a target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import count
from math import ceil, isinf
from typing import Final

import numpy as np

from trackfield.draw import bits, normal
from trackfield.errors import RunFailed, ScenarioError, together
from trackfield.scenario.layouts import Ground
from trackfield.scenario.paths import MAX_STEPS, Course, PathSection, origin_of
from trackfield.scenario.places import Place, Point
from trackfield.scenario.reached import check, check_speeds
from trackfield.scenario.recordings import plays_of, recordings_of, spell
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sensors import SensorSection
from trackfield.scenario.sensors.by_sensor import check_tables
from trackfield.scenario.sounds import heard_s, recordings_heard, sounds_at, sounds_of, spell_of
from trackfield.sensing.complete import Kind
from trackfield.words import quoted
from trackfield.world.events import awaited_steps
from trackfield.world.heard import Sounds
from trackfield.world.path import Path
from trackfield.world.placed import Placed, Played
from trackfield.world.scene import Scene
from trackfield.world.windows import Array, Windows, merged, windows

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
    are the sensors at the places that the fusion centre assumes. ``sections`` are the kinds of sensors by name, and
    ``kinds`` the indices of those that are of each kind. ``centre`` is the centre's own place (m), and ``route`` its
    positions over time if it moves: (t ns, x m, y m), with straight lines between them. ``played`` are the recorded
    reports by sensor, of those that play any, ``heard`` the recorded sound. ``sounds`` are what the targets sound like,
    empty if all are vehicles. There are no ``paths`` where no recording says where the target was.
    """

    scenario: Scenario
    paths: Mapping[str, Path]
    steps: int
    step_ns: int
    origin_ns: int
    sensors: tuple[Place, ...]
    believed: tuple[Place, ...]
    windows: tuple[Windows, ...]
    sections: Mapping[str, SensorSection]
    kinds: Mapping[str, frozenset[int]]
    centre: Point
    route: tuple[Leg, ...] = ()
    played: Mapping[str, tuple[Played, ...]] = field(default_factory=dict)
    sounds: tuple[bytes | None, ...] = ()
    heard: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def end_ns(self) -> int:
        """When a run ends: the last step's deadline falls after the paths' end; one step more lets it pass.

        Steps go on for ``run.idle_s`` after that.
        """
        return self.origin_ns + (self.steps + 1 + idle_steps(self.scenario)) * self.step_ns

    def kind_of(self, index: int) -> str:
        """The name of the kind of the sensor of this index."""
        return next(name for name, members in self.kinds.items() if index in members)

    @cached_property
    def passes(self) -> dict[str, dict[int, int]]:
        """For which steps, and when (ns), each sensor that reports by itself does so, by its id; the first for a step.

        Raises ``ScenarioError`` for instants of a user's kind outside of the window that it was asked for.
        """
        found = dict[str, dict[int, int]]()
        for name, section in self.sections.items():
            if section.sensing.rhythm == "events":
                for index in sorted(self.kinds[name]):
                    found[self.sensors[index][0]] = self._passes(index)
        return found

    def _passes(self, index: int) -> dict[int, int]:
        try:
            times = self.sensor(index).events()
        except RunFailed as error:
            raise ScenarioError(str(error), key=f"sensor '{self.kind_of(index)}': event") from None
        steps = {self.step_after(t_ns): t_ns for t_ns in reversed(times)}
        return {step: t_ns for step, t_ns in sorted(steps.items()) if 1 <= step <= self.steps}

    @property
    def pass_steps(self) -> set[int] | None:
        """The steps at which alone a track is expected, if all sensors report by themselves: those of their reports.

        Where single reports give no position, those for some time after several ones (``awaited_steps``). Of recorded
        reports some of a step may be missing, and nobody knows what is heard in recorded sound: then a track is
        expected at all steps, which is None.
        """
        if len(self.passes) < len(self.sensors) or self.played or self.heard:
            return None
        if all(section.sensing.passes for section in self.sections.values()):
            return awaited_steps(self.passes, self.origin_ns, self.step_ns, self.steps)
        return {step for steps in self.passes.values() for step in steps}

    def step_after(self, t_ns: int) -> int:
        """The first step that is not before this time."""
        return -(-(t_ns - self.origin_ns) // self.step_ns)

    @property
    def sensing(self) -> dict[str, Kind]:
        """The kind of sensing of each sensor, by its id."""
        made = {name: section.sensing for name, section in self.sections.items()}
        return {self.sensors[i][0]: made[name] for name, members in self.kinds.items() for i in sorted(members)}

    def sensor(self, index: int, incarnation: int = 0) -> Placed:
        """The sensor of this index, in one of its node's lives."""
        section = self.sections[self.kind_of(index)]
        id, x, y = self.sensors[index]
        sensing = section.sensing
        return Placed(
            id,
            (x, y),
            Scene(tuple(self.paths.values())),
            self.windows[index],
            sensing,
            section.options,
            sensing.threshold,
            self.scenario.seed,
            incarnation,
            self.played.get(id),
            section.play == "times",
            sounds_at(self.sounds, self.heard.get(id), self.origin_ns) if sensing.hearing else Sounds(),
        )


def survey(scenario: Scenario) -> Site:
    """Work a scenario out.

    Raises ``ScenarioError`` if a file cannot be used, there are no sensors, one has the fusion centre's id, or no
    target comes in range of any of them.
    """
    recordings = recordings_of(named(scenario))
    steps, found = target_paths(scenario)
    sensors, place = _stand(scenario, tuple(found.values()))
    if len(sensors) * len(found) > MOST_HEARERS:
        what = f"{len(sensors)} sensors may hear {len(found)} targets"
        raise ScenarioError(what, key="targets", expected=f"at most {MOST_HEARERS} pairs of the two")
    kinds = assigned(scenario, sensors)
    check_tables(scenario.keyed_sensors, [id for id, *_ in sensors])
    sections = {name: section for name, section in named(scenario).items() if name in kinds}
    heard = recordings_heard(sections, kinds, [id for id, *_ in sensors])
    simulated = {
        name: one
        for name, one in sections.items()
        if one.listens_to is None and (name not in recordings or one.play == "times")
    }
    if simulated and not found:
        what = (
            f"the recording does not say where the target was, and sensors of kind '{next(iter(simulated))}' sense it"
        )
        raise ScenarioError(what, key="target", expected="a path, or sensors that all play what was reported")
    if simulated:
        check(simulated, kinds, sensors, tuple(found.values()))
        check_speeds(simulated, found)
    positions = np.array([place[1:] for place in sensors])
    setup_s = scenario.run.setup_s or 0.0
    origin_ns = round(setup_s * _NS)
    paths = {id: path.shifted(setup_s) for id, path in found.items()}
    plays = plays_of(scenario, recordings, kinds, [id for id, *_ in sensors], origin_ns)
    audible = [_windows(simulated, kinds, positions, path) for path in paths.values()]
    audible.append([spell(plays.get(id, ())) for id, *_ in sensors])
    audible.append([spell_of(heard[id], origin_ns) if id in heard else () for id, *_ in sensors])
    return Site(
        scenario=scenario,
        paths=paths,
        steps=steps,
        step_ns=_step_ns(scenario),
        origin_ns=origin_ns,
        sensors=tuple(sensors),
        believed=tuple(believed(scenario, sensors, sections, kinds)),
        windows=tuple(map(merged, zip(*audible, strict=True))),
        sections=sections,
        kinds=kinds,
        centre=_centre(scenario, place, positions),
        route=tuple((origin_ns + round(t * _NS), x, y) for t, x, y in scenario.fusion.path or ()),
        played=plays,
        sounds=sounds_of(scenario, sections),
        heard=heard,
    )


def _stand(scenario: Scenario, paths: tuple[Path, ...]) -> tuple[list[Place], Point | None]:
    """The sensors, and where the fusion centre stands if the layout says so."""
    centre = scenario.architecture.centre_id
    origin = partial(origin_of, scenario.keyed_targets)
    sensors, place = scenario.field.stand(Ground(scenario.seed, paths, centre, origin))
    if centre is not None and any(id == centre for id, *_ in sensors):
        what = f"is {centre!r}, which is also a sensor's id"
        raise ScenarioError(what, key=scenario.architecture.centre_key, expected="an id that no sensor has")
    return sensors, place


def named(scenario: Scenario) -> dict[str, SensorSection]:
    """The kinds of sensors by name; of several sections of one kind, the later ones are ``kind-2``, ``kind-3``, ...

    A number is left out where a kind is called so.
    """
    found: dict[str, SensorSection] = {}
    sections = [section for _, section in scenario.keyed_sensors]
    kinds = {section.kind for section in sections}
    for section in sections:
        more = (f"{section.kind}-{number}" for number in count(2))
        free = (name for name in more if name not in found and name not in kinds)
        found[next(free) if section.kind in found else section.kind] = section
    return found


def assigned(scenario: Scenario, sensors: Sequence[Place]) -> dict[str, frozenset[int]]:
    """Which sensors (by index) are of each kind: those that it names, its share of all by lot, or all others.

    Raises ``ScenarioError`` for an unknown id, one that two kinds name, and a share for which none are left.
    """
    index = {id: i for i, (id, *_) in enumerate(sensors)}
    (rest, _), *groups = named(scenario).items()
    free, found = dict(index), dict[str, frozenset[int]]()
    for number, (name, section) in enumerate(groups):
        for id in section.nodes or ():
            if id not in free:
                what = f"{quoted(id)} is named twice" if id in index else f"there is no sensor {quoted(id)}"
                expected = f"ids of this field, like {next(iter(index))}"
                raise ScenarioError(what, key=f"sensors[{number}].nodes", expected=expected)
            del free[id]
        found[name] = frozenset(index[id] for id in section.nodes or ())
    for number, (name, section) in enumerate(groups):
        if section.share is not None:
            drawn = sorted(free, key=lambda id: bits(scenario.seed, "sensor kind", number, id))
            drawn = drawn[: max(round(section.share * len(index)), 1)]
            if not drawn:
                raise ScenarioError(
                    "no sensor is left for it", key=f"sensors[{number}].share", expected="less before it"
                )
            found[name] = frozenset(free.pop(id) for id in drawn)
    return {rest: frozenset(free.values()), **found} if free else found


def _windows(
    sections: Mapping[str, SensorSection], kinds: Mapping[str, frozenset[int]], positions: Array, path: Path
) -> list[Windows]:
    """When each sensor can sense the target on this path."""
    found: list[Windows] = [()] * len(positions)
    for name, section in sections.items():
        members, sensing = sorted(kinds[name]), section.sensing
        delay_s = 0.0 if isinf(sensing.speed_m_s) else 2.0 * sensing.range_m / sensing.speed_m_s
        late_ns = ceil((delay_s + sensing.memory_s) * _NS)
        for i, own in zip(members, windows(positions[members], path, sensing.range_m), strict=True):
            found[i] = tuple((begin, end + late_ns) for begin, end in own)
    return found


def believed(
    scenario: Scenario,
    sensors: Sequence[Place],
    sections: Mapping[str, SensorSection],
    kinds: Mapping[str, frozenset[int]],
) -> Sequence[Place]:
    """The sensors at the places that the fusion centre assumes: off by a Gaussian error, east and north."""
    sds = {i: sections[name].position_error_m for name, members in kinds.items() for i in members}
    error = partial(normal, scenario.seed)
    return [
        (id, x + sd * error(id, 0, "position", "x"), y + sd * error(id, 0, "position", "y")) if sd else (id, x, y)
        for (id, x, y), sd in zip(sensors, map(sds.__getitem__, range(len(sensors))), strict=True)
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

    A target of which nobody knows where it was has none.

    Raises ``ScenarioError`` if a file cannot be used, or a target is not present for a whole step.
    """
    step_ns, targets = _step_ns(scenario), scenario.keyed_targets
    origin = origin_of(targets) if len(targets) > 1 else None  # a single target decides the origin itself
    recordings = tuple(recordings_of(named(scenario)).values())
    long_s = heard_s(named(scenario))
    course = partial(Course, scenario.seed, step_ns, scenario.steps, origin, recordings=recordings, heard_s=long_s)
    followed = 0

    def run(key: str, target: PathSection) -> tuple[int, Path | None]:
        nonlocal followed
        if followed > MOST_POINTS:
            what = f"the paths of {len(targets)} targets have more than {MOST_POINTS} steps in all"
            raise ScenarioError(what, key="targets", expected="fewer targets, or fewer or longer steps")
        steps, path = target.run(course(key=key))
        followed += steps
        return steps, path

    runs = together(partial(run, key, target) for key, target in targets)
    longest = max(steps for steps, _ in runs)
    steps = min(longest, scenario.steps or longest)
    if steps + idle_steps(scenario) > MAX_STEPS:
        what = f"the run would have {steps + idle_steps(scenario)} steps"
        key = "run.idle_s" if steps <= MAX_STEPS else f"{targets[0][0]}.steps"
        raise ScenarioError(what, key=key, expected=f"at most {MAX_STEPS}, the highest step that a report can hold")
    end_s = steps * step_ns / _NS
    for (key, _), (there_for, path) in zip(targets, runs, strict=True):
        if path is not None and (there_for < 1 or path.start_s > end_s):
            there = f"{path.start_s:g} s to {path.end_s:g} s"
            what = f"the target is present from {there}, but the run ends after {end_s:g} s"
            raise ScenarioError(what, key=f"{key}.steps", expected="at least one step at which it is present")
    found = ((target.id, path) for (_, target), (_, path) in zip(targets, runs, strict=True))
    return steps, {id: path.clip(0.0, end_s) for id, path in found if path is not None}


def idle_steps(scenario: Scenario) -> int:
    """How many steps a run goes on for after the last one with a target."""
    return ceil(round((scenario.run.idle_s or 0.0) * _NS) / _step_ns(scenario))


def _step_ns(scenario: Scenario) -> int:
    return round(scenario.step_s * _NS)
