"""The state of a header, and its phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

from immutables import Map

from trackfield.protocols.election import Race
from trackfield.protocols.lease import Held
from trackfield.protocols.timesync import Timekeeping
from trackfield.role import ClockSet, Received, Started, Timer, Transitions
from trackfield.tracking.steps import Progress
from trackfield.wire.peers import Dissolve


class Phase(Enum):
    """The phase of a header: it knows of no head, contends to be one, follows one, measures for one, or leads."""

    NEW = "new"
    IDLE = "idle"
    ELECTING = "electing"
    FOLLOWING = "following"
    POLLED = "polled"
    LEADING = "leading"


_LIVING: Final = frozenset(Phase) - {Phase.NEW}

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, event): _LIVING for phase in _LIVING for event in (Timer, Received, ClockSet)},
}


@dataclass(frozen=True, slots=True)
class Known:
    """The ``beliefs`` (bytes) of a head's trackers after ``step``."""

    step: int
    beliefs: bytes


@dataclass(frozen=True, slots=True)
class Sensed:
    """Its own last reading of a target: of which ``step``, with which ``key`` of an election; the ``report``."""

    step: int = -1
    key: int = 0
    report: Any = None


@dataclass(frozen=True, slots=True)
class Polled:
    """Those that the head had measure at ``step``, in their order; ``awake``: this node is one of them, in ``slot``."""

    step: int = -1
    ids: tuple[str, ...] = ()
    awake: bool = False
    slot: int = 0


@dataclass(frozen=True, slots=True)
class Offer:
    """A hand-over that waits for its acknowledgement: the term's ``number``, and to whom: the first of ``nominees``."""

    number: int
    nominees: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Leadership:
    """What a header has while it leads: its trackers' ``progress``, and the sensors ``chosen`` for the coming step.

    ``asked`` are those of the present one, ``came`` those of them that reported, ``deaf`` those that sense no target.
    ``silent`` counts steps in a row without any report, ``blind`` those without a track. ``missing`` counts the polls
    in a row that a sensor did not answer; ``avoided`` are those left alone up to a step. ``offer`` is a hand-over that
    waits. ``concluded`` are beliefs about the present step that members found themselves.
    """

    progress: Progress
    chosen: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    came: frozenset[str] = frozenset()
    deaf: frozenset[str] = frozenset()
    silent: int = 0
    blind: int = 0
    missing: Mapping[str, int] = field(default_factory=dict)
    avoided: Mapping[str, int] = field(default_factory=dict)
    offer: Offer | None = None
    concluded: Map[str, bytes] = field(default_factory=Map)


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The state of a header.

    ``near`` counts the announcements that it heard, by sender; ``joined`` are those that sense the target, as they
    said, each up to which step. ``known`` is what it would go on with. ``over`` is the end of its own term that it has
    to say once more. Up to ``waits_ns`` it waits for the head that it joined.
    """

    phase: Phase = Phase.NEW
    time: Timekeeping = field(default_factory=Timekeeping)
    announced: int = 0
    near: Map[str, int] = field(default_factory=Map)
    held: Held = field(default_factory=Held)
    race: Race = field(default_factory=Race)
    sensed: Sensed = field(default_factory=Sensed)
    polled: Polled = field(default_factory=Polled)
    joined: Map[str, int] = field(default_factory=Map)
    known: Known | None = None
    leads: Leadership | None = None
    over: Dissolve | None = None
    waits_ns: int = 0
