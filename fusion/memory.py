"""The state of a fusion centre, and its phases."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from trackfield.protocols.timesync import Timekeeping
from trackfield.role import ClockSet, Received, Started, Timer, Transitions
from trackfield.tracking.steps import Progress


class Phase(Enum):
    """The phase of the first tracker: no track yet, tracking, or tracking without any report."""

    NEW = "new"
    WAITING = "waiting"
    TRACKING = "tracking"
    COASTING = "coasting"


_RUNNING: Final = frozenset({Phase.WAITING, Phase.TRACKING, Phase.COASTING})

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): frozenset({Phase.WAITING, Phase.COASTING}),
    **{(phase, event): _RUNNING for phase in _RUNNING for event in (Timer, ClockSet)},
    **{(phase, Received): frozenset({phase}) for phase in _RUNNING},
}


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The centre's state: how far its trackers are, and the sensors' threshold in dB, if the centre sets it.

    ``early`` is what waits for the end of its first round of asking for the time: its start, and reports.
    """

    phase: Phase
    progress: Progress
    threshold_db: float | None = None
    time: Timekeeping = field(default_factory=Timekeeping)
    early: tuple[Started | Received, ...] = ()
