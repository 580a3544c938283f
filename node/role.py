"""A sensor node: sleeps until something can be heard, listens once a step, and reports what is loud enough.

Zhai et al., section III-A: a node is active while the level it receives exceeds its threshold, and sends level
and direction of arrival to the fusion centre.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
    Transitions,
    check_transition,
)
from trackfield.wire.messages import Doa
from trackfield.world.acoustic import Heard


class Phase(Enum):
    """What a node is doing; ``AWAKE`` is hearing the target, but below the threshold."""

    NEW = "new"
    ASLEEP = "asleep"
    AWAKE = "awake"
    REPORTING = "reporting"


_LISTENED: Final = frozenset({Phase.ASLEEP, Phase.AWAKE, Phase.REPORTING})

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): frozenset({Phase.ASLEEP}),
    **{(phase, Sampled): _LISTENED for phase in _LISTENED},
    **{(phase, event): frozenset({phase}) for phase in _LISTENED for event in (Timer, Received)},
}


class Node:
    """Reports to ``centre`` in each step of ``step_ns`` in which it hears at least ``threshold_db``.

    Times are local; a step is numbered by the local time it begins at.
    """

    kinds: frozenset[str] = frozenset()

    def __init__(self, *, step_ns: int, threshold_db: float, centre: str) -> None:
        self.step_ns, self.threshold_db, self.centre = step_ns, threshold_db, centre

    def begin(self) -> Phase:
        """The phase is all that a node remembers."""
        return Phase.NEW

    def handle(self, state: Phase, event: Event) -> tuple[Phase, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state, event, after)
        if after is not state:
            effects = (State(after.value), *effects)
        return after, effects

    def _react(self, phase: Phase, event: Event) -> tuple[Phase, tuple[Effect, ...]]:
        match event:
            case Started():
                return Phase.ASLEEP, (Radio(False), Sample("wake-up"))
            case Sampled(now, "wake-up", at):
                return phase, () if at is None else (self._listen_at(max(at, now + 1)),)
            case Timer():
                return phase, (Sample("sound"),)
            case Sampled(_, _, None):
                return Phase.ASLEEP, (Sample("wake-up"),)
            case Sampled(now, _, heard):
                return self._hear(now, heard)
            case Received():
                return phase, (Ignored("unexpected"),)
        raise IllegalEvent(f"a node has no use for {event}")

    def _hear(self, now: int, heard: Heard) -> tuple[Phase, tuple[Effect, ...]]:
        again = self._listen_at(now + 1)
        if heard.level_db < self.threshold_db:
            return Phase.AWAKE, (again,)
        report = Doa(round(now / self.step_ns), heard.bearing_deg, heard.level_db)
        return Phase.REPORTING, (Send(report, self.centre), again)

    def _listen_at(self, earliest_ns: int) -> SetTimer:
        """At the first step from then on; step 0 is the start itself, where nothing was heard yet."""
        step = max(-(-earliest_ns // self.step_ns), 1)
        return SetTimer("step", step * self.step_ns)
