"""The fusion centre: collects the reports of a step until its deadline, fuses them, and publishes the track.

Several trackers may run side by side on the same reports (Zhai et al., Fig. 2: fusion at the centre).

A centre whose clock is off asks another process for the time (``trackfield/protocols/timesync.py``), and takes its
steps at corrected time. It begins when its first round is over; the reports that come before that wait. If the round
failed, it begins by its own clock. A correction moves its deadlines, not its place among the steps: if time jumps
ahead, it takes the overdue steps at once, one by one; if time goes back, it waits for the deadline of its next step.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from fusion.memory import TRANSITIONS, Memory, Phase
from trackfield.protocols.timesync import TimeSync
from trackfield.role import (
    ClockSet,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Note,
    Publish,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    TrackPoint,
    check_transition,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.forwarding import forwarding
from trackfield.tracking.steps import Steps
from trackfield.tracking.threshold import LAST_STEP, Commander, Controller
from trackfield.wire.messages import SyncReply, SyncRequest

Step = tuple[Memory, tuple[Effect, ...]]


class Fusion:
    """Fuses the reports of each step ``deadline_ns`` after its instant, by the trackers of a ``Bank`` (its arguments).

    Late reports up to an age of ``max_age_ns`` are used too. With ``threshold`` (the fields of ``Controller``) the
    centre sets the sensors' threshold. With ``forward`` (the arguments of ``forwarding`` but the bank) it hands its
    tracks on, as it publishes them, but not the smoothed ones. ``sync`` holds the fields of its ``Rounds`` or, if
    another role of its process sets the clock, of its ``Following``; None: its clock is right. It tells the time to
    whoever asks, unless it follows.
    """

    def __init__(
        self,
        *,
        deadline_ns: int,
        max_age_ns: int = 0,
        threshold: Mapping[str, float] | None = None,
        sync: Mapping[str, Any] | None = None,
        forward: Mapping[str, Any] | None = None,
        **bank: Any,
    ) -> None:
        self.bank = Bank(**bank)
        self.steps = Steps(self.bank, deadline_ns=deadline_ns, max_age_ns=max_age_ns)
        self.commander = None if threshold is None else Commander(Controller(**threshold), self.bank)
        self.sync = TimeSync.of(sync)
        self.follows = self.sync.follows
        self.forwarding = None if forward is None else forwarding(self.bank, **forward)
        self.kinds = self.bank.messages | self.sync.kinds

    def begin(self) -> Memory:
        """Every tracker with its prior, or waiting for reports."""
        return Memory(Phase.NEW, self.steps.begin())

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Received(_, report, sender) if self.bank.takes(report, sender):
                return self._collect(memory, event)
            case Received(_, SyncRequest() | SyncReply()) | Timer(_, "sync") | ClockSet():
                return self._keep_time(memory, event)
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer(now, self.steps.timer) if not memory.early:
                return self._fuse(memory, memory.time.corrected(now))
        raise IllegalEvent(f"a fusion centre cannot handle {event}")

    # --- time ---

    def _start(self, memory: Memory, start: Started) -> Step:
        time, effects = self.sync.handle(memory.time, start)
        waiting = replace(memory, phase=Phase.WAITING, time=time, early=(start,))
        return (waiting, effects) if self.sync.rounds or time.in_round else self._begin(waiting)

    def _keep_time(self, memory: Memory, event: Received | Timer | ClockSet) -> Step:
        """Ask for the time, or tell it; after a round the deadline is set anew, or the steps begin.

        If another role does that, the same after each correction.
        """
        time, effects = self.sync.handle(memory.time, event)
        if time is memory.time:
            return memory, effects
        after = replace(memory, time=time)
        if time.in_round or not (memory.time.in_round or self.follows):
            return after, effects
        after, more = self._begin(after) if after.early else (after, self._deadline(after))
        return after, (*effects, *more)

    def _begin(self, memory: Memory) -> Step:
        """What was early, as of its corrected time; reports among it that are of no use are not counted."""
        effects, early, memory = list[Effect](), memory.early, replace(memory, early=())
        for event in early:
            memory, asked = self._resume(memory, event) if isinstance(event, Started) else self._collect(memory, event)
            effects += (effect for effect in asked if not isinstance(effect, Ignored | Late))
        return memory, tuple(effects)

    def _deadline(self, memory: Memory) -> tuple[SetTimer, ...]:
        """The timer of the coming step, by its own clock."""
        if memory.progress.step >= LAST_STEP:
            return ()
        timer = self.steps.deadline(memory.progress)
        return (replace(timer, at=memory.time.local(timer.at)),)

    # --- steps ---

    def _resume(self, memory: Memory, start: Started) -> Step:
        now = memory.time.corrected(start.now)
        progress, stored, points, unusable = self.steps.start(memory.progress, now, start.stored)
        tracks = stored is not None and progress.tracks[0].known
        level = self.commander.begin(stored.threshold_db if stored else None) if self.commander else None
        phase = Phase.COASTING if tracks else Phase.WAITING
        after = replace(memory, phase=phase, progress=progress, threshold_db=level)
        notes = (Note(f"What an earlier life stored cannot be used: {reason}") for reason in unusable)
        return after, (*notes, *self._told(points, now), *self._deadline(after))

    def _collect(self, memory: Memory, received: Received) -> Step:
        if memory.early:
            return replace(memory, early=(*memory.early, received)), ()
        now, report = memory.time.corrected(received.now), received.message
        progress, effects = self.steps.collect(memory.progress, now, report.step, report, received.sender)
        return (memory if progress is memory.progress else replace(memory, progress=progress)), effects

    def _fuse(self, memory: Memory, now: int) -> Step:
        taken = self.steps.take(memory.progress, now)
        first = next(iter(taken.points.values()))
        level, command = self._command(memory.threshold_db, first)
        after = replace(memory, phase=Phase(first.status), progress=taken.state, threshold_db=level)
        store = Store(self.steps.keep(taken.state, level))
        return after, (*self._told(taken.all, now), *command, store, *self._deadline(after))

    def _told(self, points: Collection[TrackPoint], now: int) -> tuple[Effect, ...]:
        """Publishes points, and hands them on."""
        sends = self.forwarding.sends(points, now) if self.forwarding else ()
        return (*map(Publish, points), *sends)

    def _command(self, level_db: float | None, point: TrackPoint) -> tuple[float | None, tuple[Send, ...]]:
        if self.commander is None or level_db is None:
            return None, ()
        return self.commander.command(level_db, point)
