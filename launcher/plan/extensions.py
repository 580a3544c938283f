"""Users' own trackers and sensors: checked when a run is planned, and named to the processes that need them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import isfinite
from typing import Any

import numpy as np

from launcher.records import Plan
from trackfield.errors import ScenarioError, together
from trackfield.filters.trackers import ANY_SENSOR, TRACKERS, make_tracker
from trackfield.plugins import importable
from trackfield.scenario import Scenario
from trackfield.scenario.faults import Bias
from trackfield.scenario.options import tables
from trackfield.scenario.sections.fusion import Fusion
from trackfield.scenario.sensors import OwnSensor
from trackfield.sensing.kinds import SENSORS, Sensor, make_sensor


def own_places(scenario: Scenario) -> dict[str, str]:
    """Where other processes find the trackers and the sensor that are users' own: ``module:attribute``.

    By ``kind:name``, as ``trackfield.plugins.give`` takes them. Raises ``ScenarioError`` as ``check_trackers`` does.
    """
    check_trackers(scenario.fusion)
    kinds = sorted({kind for _, kind in _kinds(scenario.fusion)} - TRACKERS.own.keys())
    places = {f"tracker:{kind}": TRACKERS.place(kind) for kind in kinds}
    if isinstance(scenario.sensor, OwnSensor):
        places[f"sensor:{scenario.sensor.kind}"] = SENSORS.place(scenario.sensor.kind)
    return places


def check_trackers(fusion: Fusion) -> None:
    """Raise ``ScenarioError`` for an unknown tracker, options that do not fit, and options of a name that is neither a
    tracker nor a variant of one.
    """
    options = tables(fusion.options)
    together(
        partial(_check_tracker, name, options.get(name, {}), name in fusion.trackers)
        for name in dict.fromkeys((*fusion.trackers, *options))
    )


def _check_tracker(name: str, options: Mapping[str, Any], runs: bool) -> None:
    """Raise ``ScenarioError`` unless there is a tracker of this name with these options."""
    if not runs and str(options.get("tracker", name)) not in TRACKERS:
        expected = f"a tracker's name ({', '.join(sorted(TRACKERS))}), or tracker = one of them for a variant"
        raise ScenarioError(f"there is no tracker '{name}'", key=f"fusion.options.{name}", expected=expected)
    make_tracker(name, options)


def _kinds(fusion: Fusion) -> Iterator[tuple[str, str]]:
    """(name, the tracker that it is a variant of) of each tracker that runs."""
    options = tables(fusion.options)
    return ((name, str(options.get(name, {}).get("tracker", name))) for name in fusion.trackers)


def own_sensor(scenario: Scenario, section: OwnSensor) -> Mapping[str, Any]:
    """The arguments of ``make_sensor`` with which other processes make a user's own sensor.

    Raises ``ScenarioError`` for an unknown kind, options that do not fit, methods that do not return what they should,
    and for trackers and faults that do not work with such a sensor.
    """
    kind = section.kind
    _probe(kind, make_sensor(kind, section.options))
    for name, tracker in _kinds(scenario.fusion):
        if tracker in TRACKERS.own.keys() - ANY_SENSOR:
            what = f"'{name}' takes bearings only, and sensors of kind '{kind}' report none"
            expected = f"{', '.join(sorted(ANY_SENSOR))}, or one of your own"
            raise ScenarioError(what, key="fusion.trackers", expected=expected)
    for number, fault in enumerate(scenario.faults):
        if isinstance(fault, Bias):
            what = f"a bias in degrees and dB has no meaning for sensors of kind '{kind}'"
            raise ScenarioError(what, key=f"faults[{number}].kind", expected="stuck, deaf, babble, or another")
    return {"kind": kind, "options": section.options}


def _probe(kind: str, sensor: Sensor) -> None:
    """Raise ``ScenarioError`` unless the methods of a sensor return what they should."""
    m, r = len(sensor.sd), sensor.range_m
    states = np.array([[r / 2.0, r / 3.0, 1.0, -1.0], [-r / 3.0, r / 4.0, 0.0, 0.0]])
    for count in (3, 0):
        positions = np.array([[0.0, 0.0], [r / 5.0, 0.0], [0.0, -r / 5.0]])[:count]
        for x in (states, states[0]):
            shape = (*x.shape[:-1], count, m)
            for name, expected in (("h", shape), ("jacobian", (*shape, 4))):
                given = np.shape(_call(kind, name, getattr(sensor, name), x, positions))
                if given != expected:
                    what = f"returned an array {given} for states {x.shape} and positions {positions.shape}"
                    raise ScenarioError(what, key=f"sensor '{kind}': {name}", expected=f"{expected}")
    reading = _call(kind, "simulate", sensor.simulate, (r / 2.0, 0.0, 1.0, 0.0), (0.0, 0.0), (0.0,) * m)
    if reading is not None and not (len(reading) == m and all(map(isfinite, reading))):
        raise ScenarioError(f"returned {reading!r}", key=f"sensor '{kind}': simulate", expected=f"{m} numbers, or None")


def _call(kind: str, name: str, method: Callable[..., Any], *arguments: object) -> Any:
    try:
        return method(*arguments)
    except Exception as error:
        raise ScenarioError(f"{type(error).__name__}: {error}", key=f"sensor '{kind}': {name}") from error


def check_importable(plan: Plan) -> None:
    """Raise ``ScenarioError`` for a tracker, a sensor or a role that the processes of a run could not import."""
    roles = {f"role:{process.role}": process.factory for process in plan.processes}
    for which, place in {**plan.own_places, **roles}.items():
        if not importable(place):
            kind, _, name = which.partition(":")
            module, _, attribute = place.partition(":")
            where = "the main program" if module == "__main__" else f"a function ({attribute})"
            what = f"is defined in {where}, where other processes cannot import it"
            expected = "a class at the top of a module of its own; in virtual time (--virtual) it may be anywhere"
            raise ScenarioError(what, key=f"{kind} '{name}'", expected=expected)
