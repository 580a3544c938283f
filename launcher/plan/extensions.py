"""Users' own trackers and sensors: checked when a run is planned, and named to the processes that need them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

from launcher.plan.hardware import adaptive
from launcher.plan.probe import biases, probe
from launcher.records import Plan
from trackfield.drivers.spec import role_places
from trackfield.errors import ScenarioError, together
from trackfield.filters.needs import unmet
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.plugins import importable
from trackfield.scenario import Scenario
from trackfield.scenario.faults import Bias
from trackfield.scenario.options import tables
from trackfield.scenario.sections.fusion import Fusion
from trackfield.scenario.sensors import SensorSection
from trackfield.scenario.survey import named
from trackfield.sensing.kinds import SENSORS


def own_places(scenario: Scenario) -> dict[str, str]:
    """Where other processes find the trackers and the sensor that are users' own: ``module:attribute``.

    By ``kind:name``, as ``trackfield.plugins.give`` takes them. Raises ``ScenarioError`` as ``check_trackers`` does.
    """
    check_trackers(scenario.fusion)
    kinds = sorted({kind for _, kind in _kinds(scenario.fusion) if not TRACKERS.owns(kind)})
    places = {f"tracker:{kind}": TRACKERS.place(kind) for kind in kinds}
    for _, section in scenario.keyed_sensors:
        if section.kind in SENSORS and section.kind not in SENSORS.own:
            places[f"sensor:{section.kind}"] = SENSORS.place(section.kind)
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


def check_kinds(scenario: Scenario) -> None:
    """Raise ``ScenarioError`` unless the kinds of sensing that it names are what they should be."""
    for _, section in scenario.keyed_sensors:
        if section.sensing.name not in SENSORS.own:
            probe(section.sensing)


def check_sensing(scenario: Scenario, sections: Mapping[str, SensorSection]) -> None:
    """Raise ``ScenarioError`` unless trackers and faults fit the kinds of sensing that its sensors have."""
    kinds = {name: section.sensing for name, section in sections.items()}
    adaptive(sections)
    for name, tracker in _kinds(scenario.fusion):
        if tracker in TRACKERS and (why := unmet(TRACKERS[tracker], kinds)):
            able = [own for own in TRACKERS.own if not unmet(TRACKERS.own[own], kinds)]
            expected = f"{', '.join(sorted(able))}, or one of your own"
            raise ScenarioError(f"'{name}' {why}", key="fusion.trackers", expected=expected)
    if len(kinds) == 1:  # of several, whose reading is off shows only in the field
        (kind,) = kinds.values()
        for number, fault in enumerate(scenario.faults):
            if isinstance(fault, Bias):
                biases(number, fault, kind)


def suited(scenario: Scenario) -> Scenario:
    """Without the trackers that cannot work with its kinds of sensing; with the default ones if none is left.

    Raises ``ScenarioError`` for an unknown kind, and for unsuitable options.
    """
    kinds = {name: section.sensing for name, section in named(scenario).items()}
    kept = [name for name, own in _kinds(scenario.fusion) if own not in TRACKERS or not unmet(TRACKERS[own], kinds)]
    return scenario.set("fusion.trackers", kept or list(Fusion().trackers))


def check_importable(plan: Plan) -> None:
    """Raise ``ScenarioError`` for a tracker, a sensor or a role that the processes of a run could not import."""
    factories = {process.factory: process.role for process in plan.processes}
    roles = (
        (f"role:{name or role}", place)
        for factory, role in factories.items()
        for name, place in role_places(factory).items()
    )
    for which, place in (*plan.own_places.items(), *roles):
        if not importable(place):
            kind, _, name = which.partition(":")
            module, _, attribute = place.partition(":")
            where = "the main program" if module == "__main__" else f"a function ({attribute})"
            what = f"is defined in {where}, where other processes cannot import it"
            expected = "a class at the top of a module of its own; in virtual time (--virtual) it may be anywhere"
            raise ScenarioError(what, key=f"{kind} '{name}'", expected=expected)
