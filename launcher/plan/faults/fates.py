"""The planned faults of a scenario, worked out for each process, in whole nanoseconds."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

from launcher.away import Away
from launcher.plan.faults.struck import Affected, struck
from launcher.plan.probe import biases
from launcher.records import Place
from trackfield.errors import ScenarioError, combined, together
from trackfield.link.partitioned import Cut
from trackfield.role import NS
from trackfield.scenario.faults import (
    Bias,
    ClockJump,
    ContainerFault,
    ContainerRestart,
    Fault,
    Freeze,
    Kill,
    Partition,
    Restart,
    SensorFault,
)
from trackfield.sensing.complete import Kind
from trackfield.world.path import Path

MS: Final = 1_000_000
Span = tuple[int, int]
Mark = tuple[float, str, str]
"""(t s, id, what happens)"""
Spell = tuple[float, float, str, str]
"""(from s, until s, id, what is wrong)"""


@dataclass(frozen=True, slots=True)
class Life:
    """A process from ``start_ns`` until it is killed (None: never), and the freezes in between."""

    start_ns: int = 0
    kill_ns: int | None = None
    freezes: tuple[Span, ...] = ()

    def later(self, by_ns: int) -> Life:
        """The same, later by ``by_ns``; a life that begins with the run still does."""
        kill_ns = None if self.kill_ns is None else self.kill_ns + by_ns
        return Life(
            self.start_ns and self.start_ns + by_ns, kill_ns, tuple((a + by_ns, b + by_ns) for a, b in self.freezes)
        )


@dataclass(frozen=True, slots=True)
class Fates:
    """The faults of one process: its lives, jumps (at ns, by ns) of its clock, and faults of its sensor."""

    lives: tuple[Life, ...] = (Life(),)
    jumps: tuple[Span, ...] = ()
    sensor: tuple[dict[str, Any], ...] = ()

    def later(self, by_ns: int) -> Fates:
        """The same, later by ``by_ns``."""
        times = ("from_ns", "until_ns")
        return Fates(
            tuple(life.later(by_ns) for life in self.lives),
            tuple((at + by_ns, by) for at, by in self.jumps),
            tuple(one | {k: one[k] + by_ns for k in times if one[k] is not None} for one in self.sensor),
        )


@dataclass(frozen=True, slots=True)
class Faults:
    """All planned faults of a run. ``fates`` holds only the processes that have any.

    ``marks`` are the times at which faults begin or end; ``spells`` are the faults that last, to the end of the run at
    most. ``aways`` are the faults of containers in the order of time.
    """

    fates: Mapping[str, Fates] = field(default_factory=dict)
    partitions: tuple[Cut, ...] = ()
    marks: tuple[Mark, ...] = ()
    spells: tuple[Spell, ...] = ()
    aways: tuple[Away, ...] = ()

    def of(self, id: str) -> Fates:
        """The faults of this process."""
        return self.fates.get(id, Fates())

    def later(self, by_ns: int) -> Faults:
        """The same, later by ``by_ns`` after the start; marks and spells count from the first step and stay."""
        if not by_ns:
            return self
        cuts = tuple((begin + by_ns, until + by_ns, ids, medium) for begin, until, ids, medium in self.partitions)
        fates = {id: fates.later(by_ns) for id, fates in self.fates.items()}
        return replace(self, fates=fates, partitions=cuts)


Numbered = tuple[int, Fault]
"""A fault, and its number in the scenario."""


def resolve(
    faults: Sequence[Fault],
    seed: int,
    places: Sequence[Place],
    end_ns: int,
    origin_ns: int = 0,
    kinds: Mapping[str, Kind] | None = None,
    parts: Mapping[str, Sequence[str]] | None = None,
    paths: Iterable[Path] = (),
) -> Faults:
    """The faults of a field, in a run that ends at ``end_ns``; their times count from the first step, at ``origin_ns``.

    ``kinds`` are those of the sensors by id, for biases in their units. A share of the sensors, or of a role, is drawn
    by seed and the fault's number. ``parts`` are the ids of the processes of each part of the architecture, ``paths``
    those of the targets in emulated time, for faults of whom stands nearest to one. Raises one ``ScenarioError`` for
    all unknown ids and roles, faults after the end, and faults that contradict each other.
    """
    befalls: dict[str, list[Numbered]] = defaultdict(list)
    partitions, marks, spells, aways = list[Cut](), list[Mark](), list[Spell](), list[Away]()
    last_ns, field = end_ns - origin_ns, Affected.of(places, parts or {}, origin_ns, tuple(paths))
    field.check_number(faults)
    each = together(partial(struck, number, fault, seed, field, last_ns) for number, fault in enumerate(faults))
    for number, (fault, ids) in enumerate(zip(faults, each, strict=True)):
        marks += _marks(fault, ids, last_ns)
        spells += _spells(fault, ids, last_ns)
        if isinstance(fault, Partition):
            partitions.append((_ns(fault.at_s), min(_ns(fault.until_s), last_ns), ids, fault.medium))
            continue
        if isinstance(fault, ContainerFault):
            aways += _aways(number, fault, ids, last_ns)
        for id in ids:
            befalls[id].append((number, fault))
    fates, wrong = dict[str, Fates](), dict[str, ScenarioError]()
    for id, own in befalls.items():
        try:
            fates[id] = _fates(id, sorted(own, key=_when), last_ns, (kinds or {}).get(id))
        except ScenarioError as error:
            wrong.setdefault(error.key, error)  # the same of a thousand processes is told once
    if wrong:
        raise combined(list(wrong.values()))
    aways.sort(key=lambda one: (one.at_s, one.id))
    found = Faults(fates, tuple(partitions), tuple(sorted(marks)), tuple(sorted(spells)), tuple(aways))
    return found.later(origin_ns)


def _when(one: Numbered) -> tuple[float, bool]:
    """Sorts faults by their beginning; of one instant, those that end a life come first."""
    return one[1].at_s, not isinstance(one[1], Kill | Restart)


def _ns(t_s: float) -> int:
    return round(t_s * NS)


def _fates(id: str, own: Sequence[Numbered], end_ns: int, kind: Kind | None) -> Fates:
    """The faults of this process, from all of them in the order in which they begin."""
    jumps: dict[int, int] = defaultdict(int)
    for _, fault in own:
        if isinstance(fault, ClockJump):
            jumps[_ns(fault.at_s)] += round(fault.jump_ms * MS)
    sensor = [one for one in own if isinstance(one[1], SensorFault)]
    _check_sensor(id, sensor)
    _check_container(id, own, end_ns)
    return Fates(
        lives=_lives(id, own, end_ns),
        jumps=tuple((at, by) for at, by in sorted(jumps.items()) if by),
        sensor=tuple(_plain(one, end_ns, kind) for one in sensor),
    )


def _lives(id: str, own: Sequence[Numbered], end_ns: int) -> tuple[Life, ...]:
    """The lives of a process between kills and restarts, with their freezes.

    A freeze ends with the life that it began in; freezes that meet are one. Raises ``ScenarioError`` for what begins
    while the process is down.
    """
    lives, freezes, start = list[Life](), list[Span](), 0
    by, until_ns = -1, 0  # which fault took it down, and until when
    for number, fault in own:
        if not isinstance(fault, Kill | Restart | Freeze):
            continue
        at = _ns(fault.at_s)
        ends = isinstance(fault, Kill | Restart)
        if by >= 0 and (at < until_ns or (ends and at == until_ns)):
            again = f"until {until_ns / NS:g} s" if until_ns < end_ns else "for good"
            what = f"{fault.kind} of {id} at {fault.at_s:g} s, while faults[{by}] keeps it down {again}"
            raise ScenarioError(
                what, key=f"faults[{number}].at_s", expected="a time at which it is up" + " already" * (at == until_ns)
            )
        if isinstance(fault, Freeze):
            freezes.append((at, min(_ns(fault.until_s), end_ns)))
        else:
            lives.append(Life(start, at, _merged(freezes, at)))
            start = until_ns = _ns(fault.until_s) if isinstance(fault, Restart) else end_ns
            by, freezes = number, []
    return (*lives, Life(start, None, _merged(freezes, end_ns))) if start < end_ns else tuple(lives)


def _merged(freezes: Iterable[Span], end_ns: int) -> tuple[Span, ...]:
    """Freezes in order of their beginning, cut at the end, those that meet as one."""
    merged: list[Span] = []
    for begin, until in freezes:
        if merged and begin <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(merged[-1][1], until)
        else:
            merged.append((begin, until))
    return tuple((begin, min(until, end_ns)) for begin, until in merged)


def _check_sensor(id: str, own: Sequence[Numbered]) -> None:
    """Raise ``ScenarioError`` if a sensor fails in two ways at a time; a bias is added to any reading."""
    failing = [(number, fault) for number, fault in own if not isinstance(fault, Bias)]
    for (before, first), (number, second) in pairwise(failing):
        until_s = getattr(first, "until_s", None)
        if until_s is None or second.at_s < until_s:
            lasting = "to the end" if until_s is None else f"until {until_s:g} s"
            what = f"{second.kind} of {id} at {second.at_s:g} s, during faults[{before}] ({first.kind} {lasting})"
            raise ScenarioError(what, key=f"faults[{number}].at_s", expected="one such fault of a sensor at a time")


def _check_container(id: str, own: Sequence[Numbered], end_ns: int) -> None:
    """Raise ``ScenarioError`` if a container fails while its process, or it, is down, or its process while it is."""
    down = [(number, fault) for number, fault in own if isinstance(fault, Kill | Restart | ContainerFault)]
    for (before, first), (number, second) in pairwise(down):
        until_s = _until_s(first, end_ns)
        again = isinstance(first, ContainerFault) or isinstance(second, ContainerFault)
        if again and (until_s is None or second.at_s <= until_s):
            lasting = "for good" if until_s is None else f"until {until_s:g} s"
            what = f"{second.kind} of {id} at {second.at_s:g} s, during faults[{before}] ({first.kind} {lasting})"
            raise ScenarioError(what, key=f"faults[{number}].at_s", expected="a time after that")


def _aways(number: int, fault: Fault, ids: Sequence[str], end_ns: int) -> Iterator[Away]:
    """The fault at each of these processes."""
    network = getattr(fault, "network", None) or ""
    yield from (Away(number, fault.kind, id, fault.at_s, _until_s(fault, end_ns), network) for id in ids)


def _plain(one: Numbered, end_ns: int, kind: Kind | None) -> dict[str, Any]:
    """As ``world/faulty.py`` has it."""
    number, fault = one
    until_s = _until_s(fault, end_ns)
    plain = {"kind": fault.kind, "from_ns": _ns(fault.at_s), "until_ns": None if until_s is None else _ns(until_s)}
    return plain | ({"bias": biases(number, fault, kind)} if isinstance(fault, Bias) and kind else {})


def _marks(fault: Fault, ids: Sequence[str], end_ns: int) -> Iterator[Mark]:
    """The beginning of a fault, and its end if that comes within the run, for each of its processes."""
    at_s, until_s = fault.at_s, _until_s(fault, end_ns)
    up = isinstance(fault, Restart | ContainerRestart)
    begins, ends = _text(fault, until_s), "up again" if up else f"{fault.kind} ends"
    for id in ids:
        yield at_s, id, begins
        if until_s is not None:
            yield until_s, id, ends


def _spells(fault: Fault, ids: Sequence[str], end_ns: int) -> Iterator[Spell]:
    """How long a fault of these processes lasts; a jump of a clock is over at once."""
    if not isinstance(fault, ClockJump):
        at_s, until_s = fault.at_s, _until_s(fault, end_ns)
        end_s, text = end_ns / NS if until_s is None else until_s, _text(fault, until_s)
        yield from ((at_s, end_s, id, text) for id in ids)


def _until_s(fault: Fault, end_ns: int) -> float | None:
    """When a fault ends, if that comes within the run."""
    until_s: float | None = getattr(fault, "until_s", None)
    return None if until_s is None or until_s * NS >= end_ns else until_s


def _text(fault: Fault, until_s: float | None) -> str:
    text = fault.kind.replace("_", " ") + ("" if until_s is None else f" until {until_s:g} s")
    match fault:
        case ClockJump():
            text = f"clock jump by {fault.jump_ms:+g} ms"
        case Bias():
            by = f"{fault.bias_deg:+g} degrees, {fault.bias_db:+g} dB"
            text += f": {by if fault.by is None else ', '.join(f'{one:+g}' for one in fault.by)}"
    return text
