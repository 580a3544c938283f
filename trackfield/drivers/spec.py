"""What a driver must know of a run and of each of its processes: plain values that travel in a join answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from importlib import import_module
from typing import Any, Self

from trackfield.drivers.core import Core, Sense
from trackfield.link.clock import Clock
from trackfield.link.fate import Places
from trackfield.role import Role
from trackfield.wire.keys import Medium
from trackfield.world.acoustic import AcousticSensor

Plain = dict[str, Any]


@dataclass(frozen=True, slots=True)
class RunSpec:
    """What all processes of a run share. ``link`` is the scenario's section, ``end_ns`` the end of the run."""

    run: str
    seed: int
    end_ns: int
    link: Plain
    speed: float = 1.0


@dataclass(frozen=True, slots=True)
class ProcessSpec:
    """One process: the name of its role, the ``module:attribute`` and arguments that make it, and its surroundings.

    ``sound`` is the plain form of its acoustic sensor (empty: none). ``cell`` is where its broadcasts go, ``cells``
    those it listens to (none if no role of it consumes broadcasts). ``media`` are the radios and wires it has.
    ``peers`` says where those stand whose frames it may hear: (x, y) by id, not of the whole field.
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

    def plain(self) -> Plain:
        """The form that travels."""
        return asdict(self)

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of ``plain``."""
        peers = {id: (x, y) for id, (x, y) in plain["peers"].items()}
        return cls(**{**plain, "media": tuple(plain["media"]), "cells": tuple(plain["cells"]), "peers": peers})

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
