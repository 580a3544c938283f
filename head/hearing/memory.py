"""The state of the head's half of a node that hears, and its phases."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, NamedTuple

from head.hearing.choice import EVENT_NS
from trackfield.protocols.timesync import Timekeeping
from trackfield.role import NS, ClockSet, Effect, Received, Started, Timer, Transitions
from trackfield.tracking.steps import Progress
from trackfield.wire.passes import FixReport


class Phase(Enum):
    """The phase: it does not lead; it will if nobody else does; it waits for reports; it leads a cluster."""

    NEW = "new"
    FOLLOWING = "following"
    CONTENDING = "contending"
    GATHERING = "gathering"
    LEADING = "leading"


_LIVING: Final = frozenset(Phase) - {Phase.NEW}

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): _LIVING,
    **{(phase, event): _LIVING for phase in _LIVING for event in (Timer, Received, ClockSet)},
}


KEPT_NS: Final = 15 * NS
"""Reports are kept for so long, for a head that begins to lead."""
MOST_PASSES: Final = 64
NUMBERS: Final = 1 << 16


class Pass(NamedTuple):
    """A ``report`` of ``sensor``: the target was closest to it ``at_ns``, by the time of the base."""

    sensor: str
    report: Any
    at_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class Leadership:
    """What a head has: it leads ``since`` that step, its trackers made ``progress``, None while it gathers reports.

    ``used`` are the last reports that its trackers got; ``open``: there is one since it last told of an event. Its last
    fix was of the step ``fixed``. ``offered`` is what other heads told while it gathered.
    """

    since: int
    progress: Progress | None = None
    used: tuple[Pass, ...] = ()
    open: bool = False
    fixed: int = 0
    offered: tuple[tuple[str, FixReport], ...] = ()

    def busy(self, at_ns: int) -> bool:
        """Whether an event may be under way at this time."""
        return self.open and any(at_ns - one.at_ns < 2 * EVENT_NS for one in self.used)

    @property
    def number(self) -> int:
        """That of its interest in passes; the one in fixes has the next. No other life of the node has it."""
        return 2 * self.since % NUMBERS


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The state of the head's half.

    ``passes`` are the last reports that it got; ``events`` counts those that it told of. Of a fixed cluster, another
    head was heard last at local time ``heard_ns``, if one was. Where the loudest node leads,
    it ``waits`` to do so, passes up to ``spent_ns`` are of events that are over, and up to local time ``hold_ns`` it
    leaves an event to the head ``holder``.
    """

    phase: Phase = Phase.NEW
    time: Timekeeping = field(default_factory=Timekeeping)
    passes: tuple[Pass, ...] = ()
    leads: Leadership | None = None
    heard_ns: int | None = None
    waits: bool = False
    spent_ns: int = -1
    hold_ns: int = 0
    holder: str = ""
    events: int = 0


def recent(passes: tuple[Pass, ...], at_ns: int) -> tuple[Pass, ...]:
    """Those that are not too old at this time."""
    return tuple(one for one in passes if at_ns - one.at_ns <= KEPT_NS)[-MOST_PASSES:]


Step = tuple[Memory, tuple[Effect, ...]]
