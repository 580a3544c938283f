"""What the head of a cluster does: it asks for passes, gathers reports, takes its trackers on, and tells of fixes.

While it gathers, reports only wait: those of the last seconds, which its new interest makes nodes send again. Then its
trackers take all steps since the first of them at once, and go on step by step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot
from typing import Final

from immutables import Map

from head.hearing.choice import EVENT_NS
from head.hearing.memory import NUMBERS, Leadership, Memory, Pass, Step, recent
from head.hearing.settings import Settings
from head.hearing.told import fix_report
from trackfield.filters.belief import Belief, moments
from trackfield.filters.passes.types import FEW, REASONS
from trackfield.filters.solving.solver import Closed
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Ignored,
    Note,
    Publish,
    Send,
    SetTimer,
    TrackPoint,
)
from trackfield.tracking.bank import Bank
from trackfield.tracking.collecting import Collected
from trackfield.tracking.plausible import plausible
from trackfield.tracking.steps import Progress, Steps, Taken
from trackfield.tracking.stored import unpack
from trackfield.wire.interests import Interest
from trackfield.wire.passes import FIXES, PASSES, FixReport

GATHERED: Final = "gathered"
LAST_STEP: Final = 65535
MOST_OFFERED: Final = 8
SAME_NS: Final = NS // 1000
"""Two times of one report differ by less."""


@dataclass(frozen=True)
class Leading:
    """The part of the head's half that leads; ``middle`` is the centre of its cluster (m)."""

    settings: Settings
    bank: Bank
    steps: Steps
    middle: tuple[float, float]
    solves: bool
    """Whether its trackers say themselves when an event is over."""

    # --- beginning and end ---------------------------------------------------------------------------------------

    def begin(self, memory: Memory, now: int, why: str) -> Step:
        """Lead from now on: spread an interest, and wait for reports."""
        leads = Leadership(max(self.bank.step_at(memory.time.corrected(now)), 0))
        after = replace(memory, leads=leads, waits=False)
        gathered = SetTimer(GATHERED, now + self.settings.times.gather_ns)
        note = Note(f"{self.settings.id} leads: {why}")
        return after, (note, CancelTimer("lead"), *self._asks(leads.number, self.settings.interest_s), gathered)

    def end(self, memory: Memory, why: str) -> Step:
        """Lead no more."""
        assert memory.leads is not None
        withdrawn = self._asks(memory.leads.number, 0.0)
        stops = (CancelTimer(GATHERED), CancelTimer(self.steps.timer))
        return replace(memory, leads=None), (*stops, *withdrawn, Note(f"{self.settings.id} leads no more: {why}"))

    def withdraw(self, memory: Memory) -> tuple[Effect, ...]:
        """Want no more reports."""
        return () if memory.leads is None else self._asks(memory.leads.number, 0.0)

    def _asks(self, number: int, lasts_s: float) -> tuple[Send, ...]:
        """The interest in passes, and that in fixes of other heads; what lasts 0 s is withdrawn."""
        passes = self._interest(number, PASSES, self.settings.radius_m, lasts_s)
        if not self.settings.hand_m:
            return (passes,)
        return (passes, self._interest(number + 1, FIXES, self.settings.hand_m, lasts_s))

    def _interest(self, number: int, task: int, radius_m: float, lasts_s: float) -> Send:
        own, (x, y) = self.settings.id, self.middle
        return Send(
            Interest(own.encode(), number, 0, task, x, y, radius_m, 0.0, lasts_s, 0, self.settings.most_hops), own
        )

    # --- reports -------------------------------------------------------------------------------------------------

    def gathered(self, memory: Memory, now: int, passes: Sequence[Pass], how: str) -> Step:
        """The trackers begin before the first of these ``passes``, and take them all; at the start, with the prior."""
        leads, at = memory.leads, memory.time.corrected(now)
        assert leads is not None
        last = max(self.bank.step_at(at - self.steps.deadline_ns), 0)
        first = max(min((one.report.step - 1 for one in passes), default=last), 0)
        closed = min(last, first) if leads.since else 0
        progress = Progress(self.bank.begin(prior=closed == 0), Collected(closed))
        after = replace(memory, leads=replace(leads, progress=progress))
        for one in passes:
            after, _ = self.collect(after, now, one)
        note = (Note(f"{self.settings.id} uses {how}: {', '.join(one.sensor for one in passes)}"),) if passes else ()
        after, effects = self.fuse(after, now)
        for origin, fix in leads.offered:
            after, more = self.handed(after, now, fix, origin)
            effects = (*effects, *more)
        return after, (*note, *effects)

    def collect(self, memory: Memory, now: int, one: Pass) -> Step:
        """A report for the trackers."""
        leads = memory.leads
        assert leads is not None
        assert leads.progress is not None
        at, report = memory.time.corrected(now), one.report
        progress, effects = self.steps.collect(leads.progress, at, report.step, report, one.sensor)
        if progress is leads.progress:
            return memory, effects
        used = recent((*leads.used, one), at)
        return replace(memory, leads=replace(leads, progress=progress, used=used, open=True)), effects

    # --- steps ---------------------------------------------------------------------------------------------------

    def timer(self, memory: Memory) -> tuple[SetTimer, ...]:
        """That of the coming deadline, by its own clock."""
        progress = None if memory.leads is None else memory.leads.progress
        if progress is None or progress.step >= LAST_STEP:
            return ()
        deadline = self.steps.deadline(progress)
        return (replace(deadline, at=memory.time.local(deadline.at)),)

    def fuse(self, memory: Memory, now: int) -> Step:
        """Take all steps whose deadline has passed."""
        at, effects = memory.time.corrected(now), list[Effect]()
        while memory.leads is not None and memory.leads.progress is not None:
            progress = memory.leads.progress
            if progress.step >= LAST_STEP or self.steps.deadline(progress).at > at:
                break
            memory, more = self._take(memory, memory.leads, progress, at)
            effects += more
        return memory, (*effects, *self.timer(memory))

    def concluded(self, memory: Memory) -> Step:
        """No more reports come: an event that the trackers have not ended has too few of them."""
        leads = memory.leads
        if leads is None or leads.progress is None or not leads.open:
            return memory, ()
        step, last = leads.progress.step, max(one.report.step for one in leads.used)
        if (step - last) * self.bank.step_ns <= self.settings.times.close_ns:
            return memory, ()
        ns = [one.at_ns for one in leads.used]
        point = TrackPoint("", self.bank.target, self.bank.at_ns(step), "waiting", step=step)
        ended = replace(point, event_ns=sum(ns) // len(ns), refused=REASONS[FEW])
        points = [replace(ended, tracker=name) for name in self.bank.trackers]
        after, told = self._tell(memory, leads, points)
        return after, (*map(Publish, points), *told)

    def lost(self, memory: Memory) -> bool:
        """Whether it leads without a track, and without a report that may begin one."""
        leads = memory.leads
        if leads is None or leads.progress is None or leads.open:
            return False
        return all(one is None for one in self.bank.beliefs(leads.progress.tracks).values())

    def _take(self, memory: Memory, leads: Leadership, progress: Progress, at_ns: int) -> Step:
        """The next step; if an event is over with it, those that want fixes are told."""
        taken = self.steps.take(progress, at_ns)
        closed = [point for point in taken.all if point.event_ns is not None]
        over = bool(closed) or (not self.solves and self._quiet(leads, taken))
        found = over and any(point.mean and not point.refused for point in closed or taken.points.values())
        leads = replace(leads, progress=taken.state, fixed=taken.state.step if found else leads.fixed)
        published = tuple(Publish(replace(point, term=leads.fixed)) for point in taken.all)
        after = replace(memory, leads=leads)
        if not over:
            return after, published
        after, told = self._tell(after, leads, closed, self.bank.closed(taken.state.tracks).values())
        return after, (*published, *told)

    def _quiet(self, leads: Leadership, taken: Taken) -> bool:
        """Whether an event is over, by its last report."""
        last = max((one.at_ns for one in leads.used), default=0)
        return leads.open and self.bank.at_ns(taken.state.step) - last >= self.settings.times.close_ns

    def _tell(
        self, memory: Memory, leads: Leadership, closed: Sequence[TrackPoint], ended: Iterable[Closed] = ()
    ) -> Step:
        """Tell all that want fixes what the event says; of the loudest, the neighbours, too: it is over."""
        assert leads.progress is not None
        step, used = leads.progress.step, self._used(leads, closed, ended)
        raw = [(self.settings.numbers[one.sensor], one) for one in used]
        beliefs = self.bank.beliefs(leads.progress.tracks)
        fix = fix_report(memory.events % NUMBERS, step, self.bank.at_ns(step), beliefs, closed, raw)
        ends = [(one.tracker, f"no fix: {one.refused}" if one.refused else "a fix") for one in closed]
        what = "; ".join(f"{name} {end}" for name, end in ends) or "the event is over"
        note = Note(f"{self.settings.id}, of {len(used)} reports: {what}")
        sends = [Send(fix, self.settings.id)] + ([] if self.settings.fixed else [Send(fix, NEIGHBOURHOOD)])
        after = replace(memory, events=memory.events + 1, leads=replace(leads, open=False))
        return after, (note, *sends)

    def _used(self, leads: Leadership, closed: Sequence[TrackPoint], ended: Iterable[Closed]) -> list[Pass]:
        """The reports of an event: those around it that the trackers got, and did not drop if they solve for it."""
        assert leads.progress is not None
        now_ns = self.bank.at_ns(leads.progress.step)
        kept = {(one.sensor, now_ns + one.time_s * NS) for event in ended for one in event.passes}
        last = max((one.at_ns for one in leads.used), default=0)
        around = next((point.event_ns for point in closed if point.event_ns is not None), last)
        near = [
            one for one in leads.used if abs(one.at_ns - around) <= EVENT_NS and one.sensor in self.settings.numbers
        ]
        solved = [one for one in near if any(id == one.sensor and abs(ns - one.at_ns) < SAME_NS for id, ns in kept)]
        return solved or near

    # --- other heads ---------------------------------------------------------------------------------------------

    def handed(self, memory: Memory, now: int, fix: FixReport, origin: str) -> Step:
        """Another head has a fix: if the target comes here, the trackers go on with that."""
        leads, at = memory.leads, memory.time.corrected(now)
        if leads is None or leads.busy(at) or fix.step <= leads.fixed:
            return memory, ()
        if fix.step > self.bank.step_at(at) + 1:
            return memory, (Ignored("from the future"),)
        if leads.progress is None:
            offered = (*leads.offered, (origin, fix))[-MOST_OFFERED:]
            return replace(memory, leads=replace(leads, offered=offered)), ()
        return self._taken_over(memory, leads, leads.progress, fix, origin)

    def _taken_over(self, memory: Memory, leads: Leadership, progress: Progress, fix: FixReport, origin: str) -> Step:
        """Go on with the fix of another head, if that is of a target that comes here."""
        try:
            beliefs = unpack(fix.belief).beliefs if fix.belief else {}
        except ValueError:
            return memory, (Ignored("unusable belief"),)
        if not plausible(beliefs, self.bank.model):
            return memory, (Ignored("unusable belief"),)
        if not self._comes(beliefs):
            return memory, ()
        step = max(progress.step, fix.step)
        tracks = self.bank.resume(beliefs, fix.step, step).tracks
        collected = replace(progress.collected, closed=step, recent=Map(), stale=None)
        leads = replace(leads, progress=Progress(tracks, collected), fixed=fix.step)
        after = replace(memory, leads=leads)
        return after, (Note(f"{self.settings.id} goes on with the fix of {origin}"), *self.timer(after))

    def _comes(self, beliefs: Mapping[str, Belief | None]) -> bool:
        """Whether the first tracker's path comes to this cluster, and has not passed it."""
        known = next((one for one in beliefs.values() if one is not None), None)
        if known is None:
            return False
        x, y, vx, vy = (float(one) for one in moments(known).mean[:4])
        dx, dy, speed = self.middle[0] - x, self.middle[1] - y, hypot(vx, vy)
        ahead = dx * vx + dy * vy > 0
        return ahead and abs(dx * vy - dy * vx) <= self.settings.comes_m * speed
