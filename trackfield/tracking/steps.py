"""Trackers taken from step to step: at each deadline they get the reports collected since the one before.

A report that arrives after its deadline but is not too old is still used: at the next deadline the trackers go back
to their states before its step, and take every step since again.

The piece belongs to no role. Whoever composes it hands it the events, and publishes, sends on or stores the points
that it returns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from immutables import Map

from trackfield.role import Effect, Ignored, SetTimer, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.collecting import Collected, Collecting
from trackfield.tracking.stored import Stored, pack, unpack


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """The ``tracks`` after the last closed step, the reports, and the tracks ``before`` each recent step."""

    tracks: tuple[Any, ...]
    collected: Collected = field(default_factory=Collected)
    before: Map[int, tuple[Any, ...]] = field(default_factory=Map)

    @property
    def step(self) -> int:
        """The last step that the trackers took."""
        return self.collected.closed


class Begun(NamedTuple):
    """The start of a life: what the one before it ``stored``, if that can be used, and the ``points`` that follow.

    ``unusable`` says why something stored is not used.
    """

    state: Progress
    stored: Stored | None = None
    points: tuple[TrackPoint, ...] = ()
    unusable: tuple[str, ...] = ()


class Taken(NamedTuple):
    """A step that the trackers took: its ``points`` by tracker, and ``all`` points to publish, in their order.

    These are the points of steps that were taken again, then those of this step, then smoothed ones.
    """

    state: Progress
    points: Mapping[str, TrackPoint]
    all: tuple[TrackPoint, ...]


class Steps:
    """Takes the trackers of ``bank`` through the steps, each ``deadline_ns`` after its instant.

    Late reports count up to an age of ``max_age_ns``. ``timer`` is the name of the timer of deadlines; it differs
    between the pieces of a role.
    """

    def __init__(self, bank: Bank, *, deadline_ns: int, max_age_ns: int = 0, timer: str = "deadline") -> None:
        self.bank, self.deadline_ns, self.timer = bank, deadline_ns, timer
        self.collecting = Collecting(bank, bank.positions, max_age_ns)

    def begin(self) -> Progress:
        """Before the start: every tracker with its prior, or waiting for reports."""
        return Progress(self.bank.begin(prior=True))

    def deadline(self, state: Progress) -> SetTimer:
        """The timer of the coming step."""
        return SetTimer(self.timer, self.bank.at_ns(state.step + 1) + self.deadline_ns)

    def start(self, state: Progress, now: int, kept: bytes) -> Begun:
        """A life starts at ``now`` (ns), with the step whose deadline is next.

        ``kept`` is what the life before it stored (``keep``), empty if nothing: from its beliefs the trackers are
        predicted without reports over the steps missed. A prior holds for the start of the run only.
        """
        last = max(self.bank.step_at(now - self.deadline_ns), 0)
        begun = state if last == 0 else Progress(self.bank.begin(prior=False), Collected(last))
        if not kept:
            return Begun(begun)
        try:
            stored = unpack(kept)
            if stored.step > self.bank.step_at(now) + 1:
                raise ValueError(f"step {stored.step} is in the future")
        except ValueError as error:
            return Begun(begun, unusable=(str(error),))
        last = max(last, stored.step)
        tracks, points, unusable = self.bank.resume(stored.beliefs, stored.step, last)
        return Begun(Progress(tracks, Collected(last)), stored, tuple(points), tuple(unusable))

    def collect(
        self, state: Progress, now: int, step: int, report: Any, sender: str
    ) -> tuple[Progress, tuple[Effect, ...]]:
        """A report on ``step`` that the bank takes, received at ``now`` (ns): kept, or ignored for a reason."""
        collected, effects = self.collecting.take(state.collected, now, step, report, sender)
        if collected is state.collected:
            return state, effects
        if not self.bank.possible(report, sender):
            return state, (Ignored("impossible"),)
        return replace(state, collected=collected), effects

    def take(self, state: Progress, now: int) -> Taken:
        """The next step, whose deadline is ``now`` (ns), after all steps since the oldest that got a late report."""
        state, again = self._retaken(state)
        collected, heard = self.collecting.close(state.collected, now)
        before = state.before.set(collected.closed, state.tracks)
        tracks, points, earlier = self.bank.advance(state.tracks, collected.closed, heard)
        recent = Map({step: before[step] for step in collected.recent})
        return Taken(Progress(tracks, collected, recent), points, (*again, *points.values(), *earlier))

    def keep(self, state: Progress, threshold_db: float | None = None) -> bytes:
        """The bytes from which the next life starts, if this one ends before it has stored others."""
        return pack(state.step, threshold_db, self.bank.beliefs(state.tracks))

    def _retaken(self, state: Progress) -> tuple[Progress, list[TrackPoint]]:
        stale = state.collected.stale
        if stale is None:
            return state, []
        tracks, before, published = state.before[stale], state.before, list[TrackPoint]()
        for step in range(stale, state.step + 1):
            before = before.set(step, tracks)
            tracks, points, earlier = self.bank.advance(tracks, step, state.collected.recent[step])
            published += (*points.values(), *earlier)
        return replace(state, tracks=tracks, before=before), published
