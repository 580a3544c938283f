"""The state of a fusion centre, and its phases."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

from immutables import Map

from trackfield.role import Received, Started, Timer, Transitions


class Phase(Enum):
    """The phase of the first tracker: no track yet, tracking, or tracking without any report."""

    NEW = "new"
    WAITING = "waiting"
    TRACKING = "tracking"
    COASTING = "coasting"


_RUNNING: Final = frozenset({Phase.WAITING, Phase.TRACKING, Phase.COASTING})

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): frozenset({Phase.WAITING, Phase.COASTING}),
    **{(phase, Timer): _RUNNING for phase in _RUNNING},
    **{(phase, Received): frozenset({phase}) for phase in _RUNNING},
}

Heard = Map[str, Any]
"""The reports of one step (``Doa`` or ``Measurement``), by sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class Past:
    """A step that was fused and may be fused again: the trackers' states before it, and its reports."""

    tracks: tuple[Any, ...]
    heard: Heard


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The centre's state.

    ``heard`` maps a step to its reports, ``fused`` is the last step fused, ``past`` maps the steps up to it for which
    late reports still count, and ``stale`` is the oldest of them that got a late report since it was fused.
    ``threshold_db`` is the sensors' threshold, if the centre sets it.
    """

    phase: Phase
    tracks: tuple[Any, ...]
    fused: int = 0
    heard: Map[int, Heard] = field(default_factory=Map)
    past: Map[int, Past] = field(default_factory=Map)
    stale: int | None = None
    threshold_db: float | None = None
