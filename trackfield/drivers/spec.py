"""What a driver must know of a run and of each of its processes: plain values that travel in a join answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib import import_module
from typing import Any, Self

from trackfield.drivers.core import Core, Sense
from trackfield.link.clock import Clock
from trackfield.link.places import Places
from trackfield.role import Role
from trackfield.wire.keys import Medium
from trackfield.world.acoustic import AcousticSensor

Plain = dict[str, Any]


@dataclass(frozen=True, slots=True)
class RunSpec:
    """What all processes of a run share. ``link`` is the scenario's section, ``end_ns`` the end of the run.

    ``partitions`` are times at which some cannot be reached: (from ns, until ns, their ids). ``queue`` frames at most
    wait for a radio that is sending.
    """

    run: str
    seed: int
    end_ns: int
    link: Plain
    speed: float = 1.0
    partitions: Sequence[tuple[int, int, Sequence[str]]] = ()
    queue: int = 32


@dataclass(frozen=True, slots=True)
class ProcessSpec:
    """One process: the name of its role, the ``module:attribute`` and arguments that make it, and its surroundings.

    ``sound`` is the plain form of its acoustic sensor (empty: none). ``cell`` is where its broadcasts go, ``cells``
    those it listens to (none if no role of it consumes broadcasts). ``media`` are the radios and wires it has.
    ``peers`` says where those stand whose frames it may hear: (x, y) by id, not of the whole field.

    A process may live several times, one ``incarnation`` after the other, each with a specification of its own: this
    one lives, and owns the frames due, in [``start_ns``, ``kill_ns``) (None: to the end). ``name`` tells lives apart.
    ``clock`` is made into its ``Clock``, ``power`` into its ``Battery`` (empty: mains). ``freezes`` are times
    (from ns, until ns) at which it does nothing, ``jumps`` (at ns, by ns) are of its clock, and ``faults`` of its
    sensor, as ``world/faulty.py`` has them.
    """

    id: str
    role: str
    factory: str
    config: Plain = field(default_factory=dict)
    x: float = 0.0
    y: float = 0.0
    sound: Plain = field(default_factory=dict)
    media: tuple[Medium, ...] = ("field",)
    cell: str = "c0"
    cells: tuple[str, ...] = ()
    incarnation: int = 0
    sink: bool = False
    peers: Places = field(default_factory=dict)
    start_ns: int = 0
    kill_ns: int | None = None
    clock: Plain = field(default_factory=dict)
    power: Plain = field(default_factory=dict)
    freezes: tuple[tuple[int, int], ...] = ()
    jumps: tuple[tuple[int, int], ...] = ()
    faults: tuple[Plain, ...] = ()

    @property
    def name(self) -> str:
        """The process's own name: its id, and which life of it this is if it is not the first."""
        return self.id if not self.incarnation else f"{self.id}~{self.incarnation}"

    def plain(self) -> Plain:
        """The form that travels."""
        return asdict(self)

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of ``plain``."""
        tuples = {name: tuple(plain[name]) for name in ("media", "cells", "faults")}
        pairs = {name: tuple((a, b) for a, b in plain[name]) for name in ("freezes", "jumps")}
        peers = {id: (x, y) for id, (x, y) in plain["peers"].items()}
        return cls(**{**plain, **tuples, **pairs, "peers": peers})

    @property
    def places(self) -> Places:
        """Where it and its peers stand."""
        return {**self.peers, self.id: (self.x, self.y)}

    def hears(self, medium: str, to: tuple[str, ...] | None, src: str, cell: str) -> bool:
        """Whether a frame from ``src`` to these ids (None: a broadcast into ``cell``) comes to this process."""
        if medium not in self.media:
            return False
        if to is not None:
            return self.id in to
        return src != self.id and cell in self.cells


def places_of(processes: Iterable[ProcessSpec]) -> Places:
    """Where all of these stand."""
    return {p.id: (p.x, p.y) for p in processes}


def role_factory(place: str) -> Callable[..., Role[Any]]:
    """What makes roles, from ``module:attribute``; loading it registers the message kinds that its module defines."""
    module, _, attribute = place.partition(":")
    factory: Callable[..., Role[Any]] = getattr(import_module(module), attribute)
    return factory


def build_core(run: RunSpec, spec: ProcessSpec, *, horizon_ns: int = 0) -> Core:
    """A process's engine with its sensors and clock."""
    clock = Clock()
    return Core(
        role_factory(spec.factory)(**spec.config),
        owner=spec.id,
        clock=clock,
        sense=_senses(run, spec, clock),
        incarnation=spec.incarnation,
        horizon_ns=horizon_ns,
    )


def _senses(run: RunSpec, spec: ProcessSpec, clock: Clock) -> Sense:
    """``sound`` reads the microphone array; ``wake-up`` answers when (local time) it will next hear something."""
    sensor = AcousticSensor.from_plain(spec.sound) if spec.sound else None

    def sense(name: str, t_ns: int) -> Any:
        if sensor is None:
            raise LookupError(f"{spec.id} has no sensor {name!r}")
        if name == "sound":
            return sensor.sample(t_ns)
        at = sensor.next_window(t_ns)
        return None if at is None else clock.local(at)

    return sense
