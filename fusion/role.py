"""The fusion centre: collects the reports of a step until its deadline, fuses them, and publishes the track.

Several trackers may run side by side on the same reports (Zhai et al., Fig. 2: fusion at the centre).

A report that arrives after its deadline but is not too old is still used: at the next deadline the trackers go back
to their states before its step, and every step since is fused and published again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import dist
from typing import Any, Final

from immutables import Map

from fusion.memory import TRANSITIONS, Memory, Past, Phase
from trackfield.role import (
    NS,
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
from trackfield.tracking.stored import Stored, pack, unpack
from trackfield.tracking.threshold import Controller, expected_place, position_sd
from trackfield.wire.messages import SyncReply, SyncRequest, Threshold

_LAST_STEP: Final = 65535
"""The highest step that a message can hold."""


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
        self.deadline_ns, self.max_age_ns = deadline_ns, max_age_ns
        self.kinds = self.bank.messages | {"sync-request"}
        self.controller = None if threshold is None else Controller(**threshold)

    def begin(self) -> Memory:
        """Every tracker with its prior, or waiting for reports."""
        return self._waiting(prior=True)

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
                return self._collect(memory, now, report, sender)
            case Received(now, SyncRequest(exchange, sent_us), sender):
                return memory, (Send(SyncReply(exchange, sent_us, now // 1000, now // 1000), sender),)
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer(now):
                return self._fuse(memory, now)
        raise IllegalEvent(f"a fusion centre cannot handle {event}")

    def _deadline(self, step: int) -> SetTimer:
        return SetTimer("deadline", self.bank.at_ns(step) + self.deadline_ns)

    # --- the start of a life ---

    def _waiting(self, *, prior: bool) -> Memory:
        level = self.controller.start_db if self.controller else None
        return Memory(Phase.NEW, self.bank.begin(prior=prior), threshold_db=level)

    def _start(self, memory: Memory, now: int, kept: bytes) -> tuple[Memory, tuple[Effect, ...]]:
        fused = max(self.bank.step_at(now - self.deadline_ns), 0)
        begun = memory if fused == 0 else self._waiting(prior=False)  # a prior holds for the start of the run
        fresh = replace(begun, phase=Phase.WAITING, fused=fused)
        if not kept:
            return fresh, (self._deadline(fused + 1),)
        try:
            stored = unpack(kept)
            if stored.step > self.bank.step_at(now) + 1:
                raise ValueError(f"step {stored.step} is in the future")
        except ValueError as error:
            return fresh, (Note(f"What an earlier life stored cannot be used: {error}"), self._deadline(fused + 1))
        return self._resume(fresh, stored)

    def _resume(self, fresh: Memory, stored: Stored) -> tuple[Memory, tuple[Effect, ...]]:
        """Each tracker from its stored belief, predicted without reports over the missed steps."""
        fused = max(fresh.fused, stored.step)
        tracks, points = self.bank.resume(stored.beliefs, stored.step, fused)
        phase = Phase.WAITING if tracks[0].track is None else Phase.COASTING
        level = self._level(stored.threshold_db)
        resumed = replace(fresh, phase=phase, tracks=tracks, fused=fused, threshold_db=level)
        return resumed, (*map(Publish, points), self._deadline(fused + 1))

    def _level(self, stored_db: float | None) -> float | None:
        if self.controller is None:
            return None
        return self.controller.start_db if stored_db is None else self.controller.bounded(stored_db)

    # --- reports ---

    def _collect(self, memory: Memory, now: int, report: Any, sender: str) -> tuple[Memory, tuple[Effect, ...]]:
        step = report.step
        past = memory.past.get(step)
        late = step <= memory.fused
        if late and (past is None or now - self.bank.at_ns(step) > self.max_age_ns):
            return memory, (Ignored("late"),)
        if sender not in self.bank.positions:
            return memory, (Ignored("unknown sensor"),)
        if step > self.bank.step_at(now) + 1:
            return memory, (Ignored("from the future"),)
        reports = past.heard if past else memory.heard.get(step, Map())
        if sender in reports:
            return memory, (Ignored("repeated"),)
        reports = reports.set(sender, report)
        if past is None:
            return replace(memory, heard=memory.heard.set(step, reports)), ()
        stale = step if memory.stale is None else min(step, memory.stale)
        return replace(memory, past=memory.past.set(step, Past(past.tracks, reports)), stale=stale), (Late(),)

    # --- deadlines ---

    def _fuse(self, memory: Memory, now: int) -> tuple[Memory, tuple[Effect, ...]]:
        step = memory.fused + 1
        memory, published = self._replay(memory)
        heard = memory.heard.get(step, Map())
        past = self._recent(memory.past.set(step, Past(memory.tracks, heard)), now)
        tracks, points, earlier = self.bank.advance(memory.tracks, step, heard)
        first = next(iter(points.values()))
        level, command = self._command(memory.threshold_db, first)
        after = replace(
            memory,
            phase=Phase(first.status),
            tracks=tracks,
            fused=step,
            heard=memory.heard.delete(step) if step in memory.heard else memory.heard,
            past=past,
            threshold_db=level,
        )
        publish = map(Publish, (*published, *points.values(), *earlier))
        return after, (*publish, *command, Store(pack(step, level, points)), self._deadline(step + 1))

    def _replay(self, memory: Memory) -> tuple[Memory, list[TrackPoint]]:
        """Fuse all steps again since the oldest that got a late report; returns their points."""
        if memory.stale is None:
            return memory, []
        past, published = memory.past, list[TrackPoint]()
        tracks = past[memory.stale].tracks
        for step in range(memory.stale, memory.fused + 1):
            heard = past[step].heard
            past = past.set(step, Past(tracks, heard))
            tracks, points, earlier = self.bank.advance(tracks, step, heard)
            published += (*points.values(), *earlier)
        return replace(memory, tracks=tracks, past=past, stale=None), published

    def _recent(self, past: Map[int, Past], now: int) -> Map[int, Past]:
        for step in sorted(past):
            if now - self.bank.at_ns(step) <= self.max_age_ns:
                break
            past = past.delete(step)
        return past

    def _command(self, level_db: float | None, point: TrackPoint) -> tuple[float | None, tuple[Send, ...]]:
        """The threshold for the step after ``point``, and the message to the sensors that will soon hear the target."""
        if self.controller is None or level_db is None or not point.mean:
            return level_db, ()
        level = self.controller.adjusted(level_db, position_sd(point))
        place, reach = expected_place(point, self.bank.step_ns / NS), self.controller.reach_m
        near = frozenset(id for id, position in self.bank.positions.items() if dist(position, place) <= reach)
        step = self.bank.step_at(point.at_ns) + 1
        if not near or step > _LAST_STEP:
            return level, ()
        return level, (Send(Threshold(step, level), near),)
