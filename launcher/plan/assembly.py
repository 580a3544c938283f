"""From the processes that an architecture arranged to what each of them is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any, Final

from launcher.plan.architectures import Built, Process
from launcher.plan.hardware import (
    FJ_PER_MJ,
    clock_of,
    devices_of,
    following_of,
    power_of,
    sync_of,
    tree_of,
    without_radio,
)
from launcher.plan.links import sections_of
from launcher.plan.messages import check_sent
from launcher.plan.roles import Roles
from launcher.plan.tracking import if_used, tracking_of
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.link.fate import FIELD
from trackfield.protocols.collection.piece import QUEUE
from trackfield.role import NEIGHBOURHOOD
from trackfield.scenario.links import LognormalPrr
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.radios import OwnRadio, own_radios
from trackfield.words import quoted

SYNC_HOPS: Final = 8
"""Over so many hops a process may ask for the time in a tree."""


@dataclass(frozen=True)
class Assembled:
    """The processes of a field without faults and peers, one life each; ``tracking`` and ``banks`` as in a ``Plan``."""

    processes: tuple[ProcessSpec, ...]
    tracking: Mapping[str, Any]
    banks: Mapping[str, Mapping[str, Any]]


def assembled(built: Built) -> Assembled:
    """The processes of a run. Raises ``ScenarioError`` if trackers and sensors do not fit, or a role cannot be made."""
    tracking = tracking_of(built.site, built.process(built.first).draws or built.first)
    banks = {p.id: _bank(built, p, tracking) for p in built.processes if p.fuses}
    key = f"architecture '{built.site.scenario.architecture.kind}'"
    processes = _Assembly(built, tracking, banks, key).processes()  # loads the kinds of message of users' own roles
    check_sent(built.processes, key)
    return Assembled(tuple(processes), tracking, banks)


def _bank(built: Built, process: Process, tracking: Mapping[str, Any]) -> dict[str, Any]:
    """In what the ``Bank`` of a process differs from ``tracking``, that of the first for all sensors."""
    own: dict[str, Any] = {}
    if len(process.fuses) < len(built.site.believed):
        fuses = frozenset(process.fuses)
        own["sensors"] = [place for place in tracking["sensors"] if place[0] in fuses]
    if process.id != built.first:
        own["draws"] = [process.id]
        if not process.draws or process.draws != built.process(built.first).draws:
            own["prior"] = tracking_of(built.site, process.draws or process.id)["prior"]
    return own


class _Assembly:
    """Makes specifications; values that are the same for many processes are shared."""

    def __init__(
        self, built: Built, tracking: Mapping[str, Any], banks: Mapping[str, Mapping[str, Any]], key: str
    ) -> None:
        self._built, self._scenario = built, built.site.scenario
        self._tracking, self._banks = tracking, banks
        self._numbers = {id: index for index, (id, *_) in enumerate(built.site.sensors)}
        self._bases = {process.id: process for process in built.processes if process.id == process.base}
        self._roles = Roles(key)
        self._powers: dict[tuple[float | None, bool, OwnRadio, str], dict[str, Any]] = {}
        self._radios = own_radios(self._scenario.radio)
        self._links = sections_of(self._scenario, (medium for one in built.processes for medium in one.media))
        known = [name for one in built.processes for name in (one.id, one.role)]
        others = {entry.name for entry in entry_points(group="trackfield.roles")}  # of other architectures
        for name in self._radios.keys() - {*known, *others}:
            what = f"there is no role or process {quoted(name)}{suggestion(name, known)}"
            raise ScenarioError(what, key=f"radio.{name}", expected="a role, like node, or the id of a process")
        if not isinstance(self._scenario.link, LognormalPrr):
            for name in (name for name, own in self._radios.items() if own.tx_dbm is not None):
                what = f"is set, and with link model {self._scenario.link.model} no frame depends on it"
                raise ScenarioError(what, key=f"radio.{name}.tx_dbm", expected="link model lognormal_prr")

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
            devices=devices_of(self._links, process.media),
            tx_dbms=self._tx_dbms(process),
            legs=tuple((int(t), float(x), float(y)) for t, x, y in process.route),
            ports=process.ports,
            media=tuple(process.media),
            tree=self._tree(process),
            carries=dict(process.carries),
            managed=dict(process.managed),
        )

    def _tree(self, process: Process) -> dict[str, Any]:
        """The arguments of its ``Collected``; a base holds as many messages as it may send at a time."""
        if not process.base:
            return {}
        sends = self._bases[process.base].sends.values()
        most = max((len(ids) for ids in sends), default=0) if process.id == process.base else 0
        announces = any(process.id in ids for ids in sends)
        size = sum(one.base == process.base for one in self._built.processes)
        tree = tree_of(self._scenario, process.base, size, queue=max(most, QUEUE), announces=announces)
        return {**tree, **if_used(direct=self._direct(process))}

    def _direct(self, process: Process) -> list[str]:
        """The kinds that do not go over the tree; the base of a tree also sends to others than those in it."""
        if process.id != process.base:
            return list(process.direct)
        inside = {NEIGHBOURHOOD, *(one.id for one in self._built.processes if one.base == process.base)}
        outside = (kind for kind, ids in process.sends.items() if not inside.issuperset(ids))
        return list(dict.fromkeys((*process.direct, *outside)))

    def _config(self, process: Process) -> dict[str, Any]:
        """The arguments of its role: its own, what it needs to track, how it sets its clock; by role, of several."""
        bank = {**self._tracking, **self._banks[process.id]} if process.fuses else {}
        over_tree = process.base in (process.id, process.asks) and "sync-request" not in process.direct
        hops = SYNC_HOPS if process.base and over_tree else 1
        sync = sync_of(self._scenario, process.id, process.asks, hops, process.asks_over) if process.asks else None
        if not process.roles:
            return {**bank, **process.config, **if_used(sync=sync)}
        syncs = {"keeps": sync, "follows": following_of(sync), "": None}
        return {
            name: {**(bank if role.fuses else {}), **role.config, **if_used(sync=syncs[role.clock])}
            for name, role in process.roles.items()
        }

    def _power(self, process: Process) -> dict[str, Any]:
        own = self._radio(process)
        key = process.battery_j, process.senses, own, self._said_of(process, "tx_dbm")
        if key not in self._powers:
            sample_fj = round(self._scenario.energy.sample_mj * FJ_PER_MJ) if process.senses else 0
            self._powers[key] = power_of(self._scenario, process.battery_j, sample_fj, own, f"radio.{key[-1]}.tx_dbm")
        return self._powers[key] if FIELD in process.media else without_radio(self._powers[key])

    def _tx_dbms(self, process: Process) -> dict[str, float]:
        tx_dbm = self._radio(process).tx_dbm
        return {} if tx_dbm is None else {process.id: tx_dbm}

    def _radio(self, process: Process) -> OwnRadio:
        """What the radio of a process has of its own; what is said of its id comes before what is said of its role."""
        names = {name: self._said_of(process, name) for name in OwnRadio.model_fields}
        return OwnRadio(**{name: getattr(self._radios[by], name) for name, by in names.items() if by})

    def _said_of(self, process: Process, name: str) -> str:
        """Whether this is said of its id, or of its role; empty: of neither."""
        return next(
            (by for by in (process.id, process.role) if getattr(self._radios.get(by), name, None) is not None), ""
        )
