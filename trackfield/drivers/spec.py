"""What a driver must know of a run and of each of its processes: plain values, sent in a join reply."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Final, Self

from trackfield.drivers.engine.conditions import MAINS, NEVER, QUEUE, At, Conditions, Sense
from trackfield.drivers.engine.core import Core
from trackfield.drivers.ports import Port, inputs
from trackfield.host import Host
from trackfield.link.clock import Clock
from trackfield.link.energy import Power
from trackfield.link.fate import FIELD, Link
from trackfield.link.media import Media
from trackfield.link.models import make_link
from trackfield.link.partitioned import Cut, Partitioned
from trackfield.link.places import Path, Places, Point
from trackfield.plugins import load
from trackfield.protocols.collected import Collected
from trackfield.role import NEIGHBOURHOOD, Role
from trackfield.sensing.readings import Ears
from trackfield.wire.keys import Medium
from trackfield.world.faulty import with_faults
from trackfield.world.placed import Placed

Plain = dict[str, Any]

ALL: Final = "c0"
"""The cell of all processes, unless the field is divided in cells."""


@dataclass(frozen=True, slots=True)
class RunSpec:
    """The part that all processes of a run share. ``link`` is the scenario's section, ``end_ns`` the end of the run.

    ``partitions`` are times at which some processes cannot be reached: (from ns, until ns, their ids, the medium or
    None for all). ``media`` are the links of other media than the field. ``queues`` say how many frames may wait for
    the radio of a medium.
    """

    run: str
    seed: int
    end_ns: int
    link: Plain
    speed: float = 1.0
    partitions: Sequence[Cut] = ()
    media: Mapping[str, Plain] = field(default_factory=dict)
    queues: Mapping[str, int] = field(default_factory=dict)

    def queue(self, medium: str = FIELD) -> int:
        """How many frames may wait for the radio of this medium."""
        return self.queues.get(medium, QUEUE)


@dataclass(frozen=True, slots=True)
class ProcessSpec:
    """One process: the name of its role, the ``module:attribute`` and arguments that make it, and its surroundings.

    The ``factory`` is never sent: a process knows its own, from its parent or as the program that it is. Of a process
    with several roles it is ``name=module:attribute,name=module:attribute``, and ``config`` has the arguments of each
    role by its name, in the order in which they get events.

    ``sound`` is the plain form of its sensor (``world/placed.py``); empty: none. ``media`` are the radios and wires it
    has. ``cell`` is where its broadcasts in the field go, ``cells`` those it listens to there (none if none of its
    roles takes broadcasts); each other medium is one cell. ``peers`` are the places of the processes whose frames it
    may receive (empty: of all), not of the whole field; ``tx_dbms`` the transmit powers that it and they have of their
    own. A process that moves has ``legs`` as in ``link/places.py``; ``x``, ``y`` is its place at the start.

    A process may live several times, one ``incarnation`` after the other, each with a specification of its own: this
    one lives, and owns the frames due, in [``start_ns``, ``kill_ns``) (None: to the end). ``name`` tells lives apart.
    ``clock`` holds the arguments of its ``Clock``, ``power`` those of its ``Power`` (empty: not counted), ``devices``
    those of what it has for other media, which draw from the same battery. ``freezes`` are times (from ns, until ns) at
    which it does nothing, ``jumps`` (at ns, by ns) belong to its clock, and ``faults`` to its sensor, as in
    ``world/faulty.py``. ``ports`` are those of its devices, by name; a process with several roles has them as
    ``role/port``. A process in a collection tree has the arguments of its ``Collected`` in ``tree`` (empty: it is in
    none), one that hands on what others send those of its ``Carried`` in ``carries``, one that takes orders those of
    its ``Managed`` in ``managed``.
    """

    id: str
    role: str
    factory: str
    config: Plain = field(default_factory=dict)
    x: float = 0.0
    y: float = 0.0
    sound: Plain = field(default_factory=dict)
    media: tuple[Medium, ...] = ("field",)
    cell: str = ALL
    cells: tuple[str, ...] = ()
    incarnation: int = 0
    sink: bool = False
    peers: Places = field(default_factory=dict)
    tx_dbms: Mapping[str, float] = field(default_factory=dict)
    start_ns: int = 0
    kill_ns: int | None = None
    clock: Plain = field(default_factory=dict)
    power: Plain = field(default_factory=dict)
    devices: Mapping[str, Plain] = field(default_factory=dict)
    freezes: tuple[tuple[int, int], ...] = ()
    jumps: tuple[tuple[int, int], ...] = ()
    faults: tuple[Plain, ...] = ()
    legs: Path = ()
    ports: Mapping[str, Port] = field(default_factory=dict)
    tree: Plain = field(default_factory=dict)
    carries: Plain = field(default_factory=dict)
    managed: Plain = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The process's name: its id, and the number of this life unless it is the first."""
        return life_name(self.id, self.incarnation)

    @property
    def before(self) -> str:
        """The name of the life before this one; there is none before the first."""
        return life_name(self.id, self.incarnation - 1)

    def plain(self) -> Plain:
        """The form that is sent; a battery's capacity may exceed 64 bits."""
        power = {name: None if value is None else str(value) for name, value in self.power.items()}
        ports = {name: asdict(port) for name, port in self.ports.items()}
        # not asdict, which would copy the contents of all: most of what a process that joins costs the launcher
        plain = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "factory"}
        return {**plain, "power": power, "ports": ports}

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any], factory: str) -> Self:
        """The inverse of ``plain``, for a process that is made by ``factory``."""
        tuples = {name: tuple(plain[name]) for name in ("media", "cells", "faults")}
        pairs = {name: tuple((a, b) for a, b in plain[name]) for name in ("freezes", "jumps")}
        power = {name: None if value is None else int(value) for name, value in plain["power"].items()}
        peers = {id: _place(place) for id, place in plain["peers"].items()}
        ports = {name: Port.from_plain(port) for name, port in plain["ports"].items()}
        places = {"peers": peers, "legs": _legs(plain["legs"]), "ports": ports}
        return cls(**{**plain, **tuples, **pairs, **places, "power": power, "factory": factory})

    @property
    def place(self) -> Point | Path:
        """Where it is, at rest or over time."""
        return self.legs or (self.x, self.y)

    @property
    def powers(self) -> dict[str, Power]:
        """Its devices by medium."""
        own = Power(**self.power) if self.power else MAINS
        return {FIELD: own, **{medium: Power(**plain) for medium, plain in self.devices.items()}}

    @property
    def places(self) -> Places:
        """Where it and its peers stand."""
        return {**self.peers, self.id: self.place}

    def cell_in(self, medium: str) -> str:
        """Where its broadcasts on this medium go."""
        return self.cell if medium == FIELD else ALL

    def cells_in(self, medium: str) -> tuple[str, ...]:
        """The cells to which it listens on this medium."""
        return self.cells if medium == FIELD else (ALL,)

    def gets(self, medium: str, to: str, src: str, cell: str) -> bool:
        """Whether a frame from ``src`` to this address (a broadcast: into ``cell``) comes to this process."""
        if medium not in self.media:
            return False
        return src != self.id and cell in self.cells_in(medium) if to == NEIGHBOURHOOD else to == self.id

    def hears(self, medium: str, to: str, src: str, cell: str) -> bool:
        """Whether it is one of those for whom such a frame is: not if it is a broadcast by one out of reach."""
        mine = self.gets(medium, to, src, cell)
        return mine and (to != NEIGHBOURHOOD or not self.peers or src in self.peers)


def life_name(id: str, incarnation: int) -> str:
    """The name of this life of the process with this id."""
    return f"{id}~{incarnation}" if incarnation else id


def places_of(processes: Iterable[ProcessSpec]) -> Places:
    """Where all of these are."""
    return {p.id: p.place for p in processes}


def _place(plain: Sequence[Any]) -> Point | Path:
    """A place that came as lists."""
    return _legs(plain) if isinstance(plain[0], Sequence) else (plain[0], plain[1])


def _legs(plain: Iterable[Sequence[Any]]) -> Path:
    return tuple((t, x, y) for t, x, y in plain)


def role_places(factory: str) -> dict[str, str]:
    """The ``module:attribute`` of each role of a process by its name; of a single role without a name, by ``""``."""
    parts = (part.rpartition("=") for part in factory.split(","))
    return {name: place for name, _, place in parts}


def factory_of(places: Mapping[str, str]) -> str:
    """The inverse of ``role_places``."""
    return ",".join(f"{name}={place}" if name else place for name, place in places.items())


def role_factories(factory: str) -> dict[str, Callable[..., Role[Any]]]:
    """What makes each role of a process; loading it registers the message kinds that its module defines."""
    return {name: load(place) for name, place in role_places(factory).items()}


def make_role(factory: str, config: Mapping[str, Any], id: str) -> Role[Any]:
    """The role of process ``id``; of several, their host. Raises ``ValueError`` if ``config`` is for other roles."""
    makers = role_factories(factory)
    if "" in makers:
        return makers[""](**config)
    if config.keys() != makers.keys():
        raise ValueError(f"its roles are {', '.join(makers)}, not {', '.join(config)}")
    return Host({name: makers[name](**arguments) for name, arguments in config.items()}, id=id)


def role_of(spec: ProcessSpec) -> Role[Any]:
    """The role of a process, with what surrounds it there. Raises ``ValueError`` as ``make_role`` does."""
    role = make_role(spec.factory, spec.config, spec.id)
    if spec.managed:
        from trackfield.protocols.managed import Managed

        near = {*spec.peers, *spec.carries.get("next", ())}
        role = Managed(role, id=spec.id, media=spec.media, near=near, **spec.managed)
    if spec.carries:
        from trackfield.protocols.carried import Carried

        role = Carried(role, id=spec.id, **spec.carries)
    return Collected(role, id=spec.id, **spec.tree) if spec.tree else role


def powers_of(processes: Iterable[ProcessSpec]) -> dict[str, float]:
    """The transmit powers (dBm) that these have of their own."""
    return {p.id: p.tx_dbms[p.id] for p in processes if p.id in p.tx_dbms}


def links_of(run: RunSpec, processes: Iterable[ProcessSpec]) -> dict[str, Link]:
    """The link of each medium among these processes and their peers, as if nothing were ever cut."""
    places, tx_dbms = dict[str, Point | Path](), dict[str, float]()
    for process in processes:
        places.update(process.places)
        tx_dbms.update(process.tx_dbms)
    others = {medium: make_link(spec, run.seed, places) for medium, spec in run.media.items()}
    return {FIELD: make_link(run.link, run.seed, places, tx_dbms), **others}


def link_of(run: RunSpec, processes: Iterable[ProcessSpec], *, cut: bool = True) -> Link:
    """The run's link among these processes and their peers; unless ``cut``, as if nothing were ever cut."""
    link: Link = Media(links_of(run, processes))
    return Partitioned(link, run.partitions) if cut and run.partitions else link


def build_core(run: RunSpec, spec: ProcessSpec, link: Link, *, horizon_ns: int = 0) -> Core:
    """A process's engine with its sensors, clock, battery and faults; ``link`` tells what its frames cost."""
    clock = Clock(**spec.clock).jumped(sum(by for at, by in spec.jumps if at <= spec.start_ns))
    core = Core(
        role_of(spec),
        owner=spec.id,
        clock=clock,
        sense=_senses(spec),
        conditions=Conditions(
            start_ns=spec.start_ns,
            kill_ns=NEVER if spec.kill_ns is None else spec.kill_ns,
            freezes=spec.freezes,
            jumps=tuple(jump for jump in spec.jumps if jump[0] > spec.start_ns),
            powers=spec.powers,
            queues=run.queues,
            cost=lambda frame: frame.cost(link),
        ),
        incarnation=spec.incarnation,
        horizon_ns=horizon_ns,
    )
    for one in inputs(spec.ports):
        if core.owns(one.due_ns):  # bytes wait until a frozen process reads them
            core.offer(replace(one, due_ns=core.conditions.thaw_ns(one.due_ns)))
    return core


def _senses(spec: ProcessSpec) -> Sense:
    """``sound`` reads the sensor; ``wake-up`` answers when it will next hear something."""
    sensor = _ears(spec) if spec.sound else None

    def sense(name: str, t_ns: int) -> Any:
        if sensor is None:
            raise LookupError(f"{spec.id} has no sensor {name!r}")
        return sensor.sample(t_ns) if name == "sound" else At(sensor.next_window(t_ns))

    return sense


def _ears(spec: ProcessSpec) -> Ears:
    return with_faults(Placed.from_plain(spec.sound), spec.faults)
