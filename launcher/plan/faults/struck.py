"""Which processes a planned fault affects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import dist
from typing import Final

from launcher.records import SENSES, Place
from trackfield.draw import bits
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.scenario.faults import ContainerRestart, Fault, Restart, SensorFault
from trackfield.scenario.nearest import suggestion
from trackfield.words import quoted
from trackfield.world.path import Path

MOST_COMPARED: Final = 10_000
"""Of more ids, none is suggested for an unknown one: it takes long."""
MOST_STRUCK: Final = 500_000
"""Pairs of a fault and a process that it affects."""
MOST_DRAWN: Final = 5_000_000
"""Pairs of a fault and a process that it may affect, as it affects a share of them."""


@dataclass(frozen=True, slots=True)
class Affected:
    """The processes that faults may affect, by id: with a sensor, without one, of each role their places, and of
    each part; the targets' ``paths``, on which the first step is at ``origin_ns``."""

    sensors: Mapping[str, Place]
    others: Mapping[str, Place]
    roles: Mapping[str, list[Place]]
    parts: Mapping[str, list[Place]]
    origin_ns: int
    paths: tuple[Path, ...]

    @classmethod
    def of(
        cls, places: Sequence[Place], parts: Mapping[str, Sequence[str]], origin_ns: int, paths: tuple[Path, ...]
    ) -> Affected:
        """That of these places."""
        roles: dict[str, list[Place]] = {}
        for place in places:
            roles.setdefault(place.role, []).append(place)
        sensors = {place.id: place for place in places if SENSES in place.tags}
        others = {place.id: place for place in places if place.id not in sensors}
        known = {place.id: place for place in places}
        members = {part: [known[id] for id in ids] for part, ids in parts.items()}
        return cls(sensors, others, roles, members, origin_ns, paths)

    def candidates(self, fault: Fault) -> list[Place]:
        """The places of the role or the part that a fault names, or else of the sensors; none of an unknown name."""
        if fault.part is not None:
            return list(self.parts.get(fault.part, ()))
        return list(self.sensors.values()) if fault.role is None else list(self.roles.get(fault.role, ()))

    def concerned(self, fault: Fault) -> int:
        """The number of processes that a fault affects, or of which it affects a share."""
        if fault.nodes is not None:
            return len(fault.nodes)
        return len(self.candidates(fault))

    def check_number(self, faults: Sequence[Fault]) -> None:
        """Raise ``ScenarioError`` for faults of so many processes that it cannot be meant."""
        numbers = [self.concerned(fault) for fault in faults]
        struck = sum(number * (fault.share or 1) for number, fault in zip(numbers, faults, strict=True))
        for number, most, what in (
            (struck, MOST_STRUCK, "affect {} processes in all"),
            (sum(numbers), MOST_DRAWN, "are drawn from {} processes in all"),
        ):
            if number > most:
                said = f"{len(faults)} faults {what.format(round(number))}"
                raise ScenarioError(said, key="faults", expected=f"at most {most}, each counted once for each fault")


def struck(number: int, fault: Fault, seed: int, field: Affected, end_ns: int) -> tuple[str, ...]:
    """The processes that the fault affects; its times are checked first."""
    _check_times(number, fault, end_ns)
    return _ids(number, fault, seed, field)


def _check_times(number: int, fault: Fault, end_ns: int) -> None:
    """Raise ``ScenarioError`` for a fault that begins, or a process that would be up again, after the end."""
    for name in ("at_s", *(["until_s"] if isinstance(fault, Restart | ContainerRestart) else [])):
        value = getattr(fault, name)
        if value * NS >= end_ns:
            what, expected = f"is {value:g}, and the run ends at {end_ns / NS:g} s", "a time before that"
            raise ScenarioError(what, key=f"faults[{number}].{name}", expected=expected)


def _ids(number: int, fault: Fault, seed: int, field: Affected) -> tuple[str, ...]:
    """The processes that the fault affects."""
    if fault.nodes is None:
        _check_candidates(number, fault, field)
        concerned = [place.id for place in field.candidates(fault)]
        if fault.nearest is not None:
            return _nearest(number, fault, field)
        if fault.share is None:
            return tuple(sorted(concerned))
        drawn = sorted(concerned, key=lambda id: bits(seed, "fault", number, id))
        return tuple(sorted(drawn[: max(round(fault.share * len(concerned)), 1)]))
    of_sensors = isinstance(fault, SensorFault)
    for id in fault.nodes:
        if id not in field.sensors and (of_sensors or id not in field.others):
            raise _no_such(number, fault, id, field)
    return fault.nodes


def _no_such(number: int, fault: Fault, id: str, field: Affected) -> ScenarioError:
    """The error for an id that is none, or is not that of a sensor."""
    key = f"faults[{number}].nodes"
    if id in field.others:
        what = f"{id} has no sensor, and {fault.kind} is a fault of sensors"
        return ScenarioError(what, key=key, expected="ids of sensor nodes")
    known = list(field.sensors if isinstance(fault, SensorFault) else (*field.sensors, *field.others))
    like = ", ".join(dict.fromkeys((known[0], known[-1])))
    near = suggestion(id, known) if len(known) <= MOST_COMPARED else ""
    return ScenarioError(f"there is no {quoted(id)}{near}", key=key, expected=f"ids of this field, like {like}")


def _check_candidates(number: int, fault: Fault, field: Affected) -> None:
    """Raise ``ScenarioError`` if no process has the role or is of the part, or if one lacks the sensor that fails."""
    name = "role" if fault.part is None else "part"
    key, given = f"faults[{number}].{name}", getattr(fault, name)
    found, known = field.candidates(fault), field.roles if name == "role" else field.parts
    if given is not None and not found:
        what = f"no process has the role {quoted(given)}{suggestion(given, known)}"
        if name == "part":
            what = f"the architecture has no process of the part {quoted(given)}"
        raise ScenarioError(what, key=key, expected=f"one of {', '.join(one for one in known if known[one])}")
    if isinstance(fault, SensorFault) and any(SENSES not in place.tags for place in found):
        what = f"a {given} has no sensor, and {fault.kind} is a fault of sensors"
        raise ScenarioError(what, key=key, expected=f"a {name} with sensors")


def _nearest(number: int, fault: Fault, field: Affected) -> tuple[str, ...]:
    """So many of the processes that a fault may affect as it says, those nearest to any target when it begins."""
    t_s = field.origin_ns / NS + fault.at_s
    targets = [state[:2] for path in field.paths if (state := path.at(t_s)) is not None]
    if not targets:
        what = f"no target is there {fault.at_s:g} s after the first step"
        raise ScenarioError(what, key=f"faults[{number}].at_s", expected="a time at which one is, for nearest")

    def away(place: Place) -> tuple[float, str]:
        return min(dist((place.x, place.y), target) for target in targets), place.id

    return tuple(sorted(place.id for place in sorted(field.candidates(fault), key=away)[: fault.nearest]))
