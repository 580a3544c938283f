"""From the processes that an architecture arranged to what each of them is told."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from launcher.plan.architectures import Built, Process
from launcher.plan.hardware import FJ_PER_MJ, clock_of, following_of, power_of, sync_of
from launcher.plan.messages import check_sent, longest
from launcher.plan.roles import Roles
from launcher.plan.tracking import if_used, tracking_of
from launcher.records import Flow
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.link.places import Path, Point
from trackfield.wire.registry import kind_of_class

Pair = tuple[str, str]


@dataclass(frozen=True)
class Assembled:
    """The processes of a field without faults, one life each; ``tracking``, ``banks`` and ``flows`` as in a ``Plan``.

    The ``peers`` of a process are those that it may hear, and those to which it sends.
    """

    processes: tuple[ProcessSpec, ...]
    tracking: Mapping[str, Any]
    banks: Mapping[str, Mapping[str, Any]]
    flows: tuple[Flow, ...]


def assembled(built: Built) -> Assembled:
    """The processes of a run. Raises ``ScenarioError`` if trackers and sensors do not fit, or a role cannot be made."""
    tracking = tracking_of(built.site, built.first)
    banks = {p.id: _bank(built, p, tracking) for p in built.processes if p.fuses}
    key = f"architecture '{built.site.scenario.architecture.kind}'"
    processes = _Assembly(
        built, tracking, banks, key
    ).processes()  # which loads the kinds of message of users' own roles
    check_sent(built.processes, key)
    sent = {kind for process in built.processes if process.senses for kind in _reports(built, process)}
    end_ns = built.site.end_ns
    flows = [Flow(longest(kind, tracking, end_ns), tuple(links), kind in sent) for kind, links in _pairs(built).items()]
    return Assembled(_acquainted(processes, flows), tracking, banks, tuple(flows))


def _reports(built: Built, process: Process) -> Collection[str]:
    """The kinds of messages in which a process with a sensor reports; another of its roles may send others."""
    if not process.roles:
        return process.sends
    return process.sends.keys() & {kind_of_class(one.sensing.message).name for one in built.site.sections.values()}


def _bank(built: Built, process: Process, tracking: Mapping[str, Any]) -> dict[str, Any]:
    """In what the ``Bank`` of a process differs from ``tracking``, that of the first for all sensors."""
    own: dict[str, Any] = {}
    if len(process.fuses) < len(built.site.believed):
        fuses = frozenset(process.fuses)
        own["sensors"] = [place for place in tracking["sensors"] if place[0] in fuses]
    if process.id != built.first:
        own |= {"prior": tracking_of(built.site, process.id)["prior"], "draws": [process.id]}
    return own


class _Assembly:
    """Makes specifications; values that are the same for many processes are shared."""

    def __init__(
        self, built: Built, tracking: Mapping[str, Any], banks: Mapping[str, Mapping[str, Any]], key: str
    ) -> None:
        self._built, self._scenario = built, built.site.scenario
        self._tracking, self._banks = tracking, banks
        self._numbers = {id: index for index, (id, *_) in enumerate(built.site.sensors)}
        self._roles = Roles(key)
        self._powers: dict[tuple[float | None, bool], dict[str, Any]] = {}

    def processes(self) -> list[ProcessSpec]:
        """One life of each process, without peers."""
        return [self._spec(process) for process in self._built.processes]

    def _spec(self, process: Process) -> ProcessSpec:
        id, config = process.id, self._config(process)
        return ProcessSpec(
            id,
            process.role,
            self._roles.factory(process, config),
            config,
            float(process.x),
            float(process.y),
            self._built.site.sensor(self._numbers[id]).to_plain() if process.senses else {},
            sink=not process.senses or bool(process.fuses),
            clock=clock_of(self._scenario, id) if process.asks else {},
            power=self._power(process),
            legs=tuple((int(t), float(x), float(y)) for t, x, y in process.route),
            ports=process.ports,
        )

    def _config(self, process: Process) -> dict[str, Any]:
        """The arguments of its role: its own, what it needs to track, how it sets its clock; by role, of several."""
        bank = {**self._tracking, **self._banks[process.id]} if process.fuses else {}
        sync = sync_of(self._scenario, process.id, process.asks) if process.asks else None
        if not process.roles:
            return {**bank, **process.config, **if_used(sync=sync)}
        syncs = {"keeps": sync, "follows": following_of(sync), "": None}
        return {
            name: {**(bank if role.fuses else {}), **role.config, **if_used(sync=syncs[role.clock])}
            for name, role in process.roles.items()
        }

    def _power(self, process: Process) -> dict[str, Any]:
        key = process.battery_j, process.senses
        if key not in self._powers:
            sample_fj = round(self._scenario.energy.sample_mj * FJ_PER_MJ) if process.senses else 0
            self._powers[key] = power_of(self._scenario, process.battery_j, sample_fj)
        return self._powers[key]


def _pairs(built: Built) -> dict[str, dict[Pair, None]]:
    """Who sends to whom, by kind of message: first what sensors send, then what sets clocks, then all else."""
    pairs: dict[str, dict[Pair, None]] = defaultdict(dict)
    senders = sorted(built.processes, key=lambda process: not process.senses)
    asking = [process for process in senders if process.asks and sync_of(built.site.scenario, process.id, process.asks)]
    for process in filter(lambda one: one.senses, senders):
        _enter(pairs, process)
    for process in asking:
        pairs["sync-request"][process.id, process.asks] = None
        pairs["sync-reply"][process.asks, process.id] = None
    for process in filter(lambda one: not one.senses, senders):
        _enter(pairs, process)
    return pairs


def _enter(pairs: dict[str, dict[Pair, None]], process: Process) -> None:
    for kind, ids in process.sends.items():
        for id in ids:
            pairs[kind][process.id, id] = None


def _acquainted(processes: Sequence[ProcessSpec], flows: Sequence[Flow]) -> tuple[ProcessSpec, ...]:
    """The same processes, with the places of those whom they hear and to whom they send."""
    places, peers = places_of(processes), defaultdict[str, dict[str, Point | Path]](dict)
    for flow in flows:
        for src, dst in flow.pairs:
            peers[src][dst], peers[dst][src] = places[dst], places[src]
    return tuple(replace(process, peers=peers.get(process.id, {})) for process in processes)
