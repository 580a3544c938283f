"""The fusion centre: collects the reports of a step until its deadline, fuses them, and publishes the track.

Several trackers may run side by side on the same reports (Zhai et al., Fig. 2: fusion at the centre).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fusion.memory import TRANSITIONS, Memory, Phase
from trackfield.role import (
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Publish,
    Received,
    Send,
    Started,
    State,
    Store,
    Timer,
    TrackPoint,
    check_transition,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.steps import Steps
from trackfield.tracking.threshold import Commander, Controller
from trackfield.wire.messages import SyncReply, SyncRequest


class Fusion:
    """Fuses the reports of each step ``deadline_ns`` after its instant, by the trackers of a ``Bank`` (its arguments).

    Late reports up to an age of ``max_age_ns`` are used too. With ``threshold`` (the fields of ``Controller``) the
    centre sets the sensors' threshold. Its clock is the reference for sensors that ask for the time.
    """

    def __init__(
        self,
        *,
        deadline_ns: int,
        max_age_ns: int = 0,
        threshold: Mapping[str, float] | None = None,
        **bank: Any,
    ) -> None:
        self.bank = Bank(**bank)
        self.steps = Steps(self.bank, deadline_ns=deadline_ns, max_age_ns=max_age_ns)
        self.commander = None if threshold is None else Commander(Controller(**threshold), self.bank)
        self.kinds = self.bank.messages | {"sync-request"}

    def begin(self) -> Memory:
        """Every tracker with its prior, or waiting for reports."""
        return Memory(Phase.NEW, self.steps.begin())

    def handle(self, state: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        match event:
            case Started(now, stored):
                return self._start(memory, now, stored)
            case Received(now, report, sender) if self.bank.takes(report, sender):
                progress, effects = self.steps.collect(memory.progress, now, report.step, report, sender)
                return (memory if progress is memory.progress else replace(memory, progress=progress)), effects
            case Received(now, SyncRequest(exchange, sent_us), sender):
                return memory, (Send(SyncReply(exchange, sent_us, now // 1000, now // 1000), sender),)
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer(now, self.steps.timer):
                return self._fuse(memory, now)
        raise IllegalEvent(f"a fusion centre cannot handle {event}")

    def _start(self, memory: Memory, now: int, kept: bytes) -> tuple[Memory, tuple[Effect, ...]]:
        progress, stored, points, unusable = self.steps.start(memory.progress, now, kept)
        tracks = stored is not None and progress.tracks[0].track is not None
        level = self.commander.begin(stored.threshold_db if stored else None) if self.commander else None
        after = Memory(Phase.COASTING if tracks else Phase.WAITING, progress, level)
        notes = (Note(f"What an earlier life stored cannot be used: {reason}") for reason in unusable)
        return after, (*notes, *map(Publish, points), self.steps.deadline(progress))

    def _fuse(self, memory: Memory, now: int) -> tuple[Memory, tuple[Effect, ...]]:
        taken = self.steps.take(memory.progress, now)
        first = next(iter(taken.points.values()))
        level, command = self._command(memory.threshold_db, first)
        after = Memory(Phase(first.status), taken.state, level)
        store, deadline = Store(self.steps.keep(taken.state, level)), self.steps.deadline(taken.state)
        return after, (*map(Publish, taken.all), *command, store, deadline)

    def _command(self, level_db: float | None, point: TrackPoint) -> tuple[float | None, tuple[Send, ...]]:
        if self.commander is None or level_db is None:
            return None, ()
        return self.commander.command(level_db, point)
