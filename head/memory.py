"""The state of a master, and its phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

from immutables import Map

from trackfield.protocols.association.admitting import Members
from trackfield.protocols.lease import Held
from trackfield.protocols.timesync import Timekeeping
from trackfield.role import Received, Started, Timer, Transitions
from trackfield.tracking.selection import Choice
from trackfield.tracking.steps import Progress


class Phase(Enum):
    """The phase of a master: ``HELPING``, its slaves measure for another leader."""

    NEW = "new"
    IDLE = "idle"
    FOLLOWING = "following"
    HELPING = "helping"
    LEADING = "leading"


_LIVING: Final = frozenset(Phase) - {Phase.NEW}

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, event): _LIVING for phase in _LIVING for event in (Timer, Received)},
}


@dataclass(frozen=True, slots=True)
class Wanted:
    """The ``sensors`` that measure for the ``leader``, the first of them in ``slot``, up to step ``last``."""

    leader: str = ""
    sensors: tuple[str, ...] = ()
    slot: int = 0
    last: int = -1

    def at(self, step: int) -> tuple[str, ...]:
        """Those that measure at a step."""
        return self.sensors if step <= self.last else ()

    def same(self, other: Wanted) -> bool:
        """Whether both are the same sensors in the same slots."""
        return self.sensors == other.sensors and (self.slot == other.slot or not self.sensors)


@dataclass(frozen=True, slots=True)
class Asked:
    """What the leader asked of another master, and for how many steps in a row that has not sent anything."""

    wanted: Wanted
    silent: int = 0


@dataclass(frozen=True, slots=True)
class Known:
    """The ``beliefs`` (bytes) of the trackers after ``step``, and who takes over first with them."""

    step: int
    beliefs: bytes
    heir: str = ""


@dataclass(frozen=True, slots=True)
class Offer:
    """A hand-over that waits for its acknowledgement: the term's ``number``, and to whom: the first of ``nominees``."""

    number: int
    nominees: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Leadership:
    """What a master has while it leads: its trackers' ``progress``, the ``choice`` for the coming step, whom it asked.

    ``came`` are those of them that sent what they have of the coming step. ``blind`` counts the steps without a track,
    ``offer`` is a hand-over that waits. ``avoided`` are masters that did not answer, and up to which step they are left
    alone.
    """

    progress: Progress
    choice: Choice
    asked: Mapping[str, Asked] = field(default_factory=dict)
    came: frozenset[str] = frozenset()
    offer: Offer | None = None
    blind: int = 0
    avoided: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The state of a master.

    ``rosters`` are the slaves of the masters in reach; ``wanted`` are its own that measure, and ``told`` is what their
    last beacon said. ``heard`` are the reports of its slaves by step. ``notices`` is how often it still says that
    another one leads, after a hand-over. ``known`` is what it would take over with, and it ``insists`` if it asked
    once more whether the leader is alive. ``near`` are announcements heard, by sender, and ``references`` those who may
    set its clock, the one that it asks first.
    """

    phase: Phase = Phase.NEW
    time: Timekeeping = field(default_factory=Timekeeping)
    members: Members = field(default_factory=Members)
    held: Held = field(default_factory=Held)
    rosters: Map[str, tuple[str, ...]] = field(default_factory=Map)
    wanted: Wanted = field(default_factory=Wanted)
    told: Wanted = field(default_factory=Wanted)
    heard: Map[int, Map[str, Any]] = field(default_factory=Map)
    leads: Leadership | None = None
    known: Known | None = None
    notices: int = 0
    insists: bool = False
    near: Mapping[str, int] = field(default_factory=dict)
    references: tuple[str, ...] = ()

    @property
    def kept(self) -> tuple[Any, ...]:
        """When this changes, what the next life needs is stored."""
        return self.members.list.keys(), self.held.term.number, self.rosters
