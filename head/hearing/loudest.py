"""Clusters that form around the node that heard a pass loudest: it leads until the target is lost.

Each node that heard the pass hears of its neighbours' reports, too. When no report was added for a while, the loudest
of those that it knows (of equal ones the lower id) spreads an interest over two hops, gathers what is known of the
pass, and says what it makes of it. If it does not, the second loudest does the same, and so on. A path through a large
field makes a chain of events. Reports may be used in two of them, but no node leads twice for the same pass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import dist

from head.hearing.choice import EVENT_NS, Heard, chosen, event_begins
from head.hearing.fixed import LEAD
from head.hearing.leading import Leading
from head.hearing.memory import Memory, Pass, Step
from head.hearing.settings import Settings
from trackfield.role import NS, CancelTimer, Effect, Ignored, SetTimer
from trackfield.wire.interests import Interest
from trackfield.wire.passes import MOST_EARLY_S, FixReport
from trackfield.wire.raw import unpack


@dataclass(frozen=True)
class Loudest:
    """The part of the head's half that settles who leads."""

    settings: Settings
    leading: Leading

    def start(self, memory: Memory, now: int) -> Step:
        """Nobody leads until a target passes."""
        return memory, ()

    def event(self, memory: Memory) -> tuple[Pass, ...]:
        """The reports of the ``EVENT_NS`` with its own last pass in which most are, the loudest first.

        They may be of any event. There are none if the own one is over, or it has none. Of a sensor that reported twice
        the later pass counts.
        """
        own = next((one for one in reversed(memory.passes) if one.sensor == self.settings.id), None)
        if own is None or own.at_ns <= memory.spent_ns:
            return ()
        since_ns = event_begins(own.at_ns, [one.at_ns for one in memory.passes])
        near = {one.sensor: one for one in memory.passes if 0 <= one.at_ns - since_ns <= EVENT_NS}
        return tuple(sorted({**near, own.sensor: own}.values(), key=lambda one: (-one.report.strength_db, one.sensor)))

    def _louder(self, memory: Memory, event: tuple[Pass, ...]) -> list[str]:
        """The sensors of the event that are louder than this node, without those whose event is over."""
        fresh = [one.sensor for one in event if one.at_ns > memory.spent_ns]
        return fresh[: fresh.index(self.settings.id)]

    def passed(self, memory: Memory, now: int, one: Pass) -> Step:
        """A report came: its own, or one of those around."""
        event = self.event(memory)
        if one not in event or (memory.leads is not None and memory.leads.progress is None):
            return memory, ()
        if now < memory.hold_ns and not _knows(memory, memory.holder):  # it goes to that head, too
            return self._over(memory, one.at_ns)
        return self._contend(memory, now, event)

    def _contend(self, memory: Memory, now: int, event: tuple[Pass, ...]) -> Step:
        """Lead if no report is added for a while, after those that are louder."""
        turn_ns = self.settings.times.turn_ns * len(self._louder(memory, event))
        due_ns = max(now + self.settings.times.close_ns, memory.hold_ns) + turn_ns
        return replace(memory, waits=True), (SetTimer(LEAD, due_ns),)

    def interest(self, memory: Memory, now: int, message: Interest, sink: str) -> Step:
        """Another node leads: if it wants this one's report, this one leaves the event to it.

        Those that heard that node's report also hear when it is done: if they do not, they take over.
        """
        place, times = self.leading.bank.positions[self.settings.id], self.settings.times
        if dist(place, (message.x_m, message.y_m)) > message.radius_m:
            return memory, ()
        near, gathers = _knows(memory, sink), memory.leads is not None and memory.leads.progress is None
        waits_ns = 2 * times.gather_ns + times.close_ns if near else times.gather_ns
        held, event = replace(memory, hold_ns=now + waits_ns, holder=sink), self.event(memory)
        if not event or (gathers and sink not in self._louder(memory, event)):
            return held, ()  # of two that gather the louder one goes on, when both know of each other
        if gathers:
            return self._yields(held, now, event)
        return self._contend(held, now, event) if near else self._over(held, max(one.at_ns for one in event))

    def _yields(self, memory: Memory, now: int, event: tuple[Pass, ...]) -> Step:
        """Leave the event to a head that is louder, as long as that may take."""
        after, effects = self.leading.end(memory, f"{memory.holder} is louder")
        after, more = self._contend(after, now, event)
        return after, (*effects, *more)

    def told(self, memory: Memory, now: int, fix: FixReport) -> Step:
        """A neighbour has told what it makes of an event: that is over."""
        bank = self.leading.bank
        try:
            early_s = min(one.early_s for one in unpack(fix.raw))
        except ValueError:  # also of no reports
            return memory, (Ignored("unusable fix"),)
        if fix.step > bank.step_at(memory.time.corrected(now)) + 1:
            return memory, (Ignored("from the future"),)
        return self._over(replace(memory, hold_ns=0), bank.at_ns(fix.step) - round(early_s * NS))

    def _over(self, memory: Memory, last_ns: int) -> Step:
        """The event with the last pass at this time is over."""
        after = replace(memory, spent_ns=max(memory.spent_ns, last_ns))
        if not after.waits or self.event(after):
            return after, ()
        return replace(after, waits=False), (CancelTimer(LEAD),)

    def due(self, memory: Memory, now: int) -> Step:
        """The loudest of those that are not silent leads, whatever it led before."""
        if not self.event(memory):
            return replace(memory, waits=False), ()
        effects: tuple[Effect, ...] = ()
        if memory.leads is not None:
            memory, effects = self.leading.end(memory, "the target passes again")
        after, more = self.leading.begin(memory, now, "the loudest that heard a pass")
        return after, (*effects, *more)

    def gathered(self, memory: Memory, now: int) -> Step:
        """Some of what was heard is used, all at once, and no more is wanted."""
        found, places = self.event(memory), self.leading.bank.positions
        if found and now < memory.hold_ns and memory.holder in self._louder(memory, found):
            return self._yields(memory, now, found)
        event = {one.sensor: one for one in found}
        ids = sorted(event)
        times, strengths = [event[id].at_ns / NS for id in ids], [event[id].report.strength_db for id in ids]
        choice = chosen(Heard(ids, [places[id] for id in ids], times, strengths), self.settings.reports)
        withdrawn = self.leading.withdraw(memory)
        memory, _ = self._over(memory, max((one.at_ns for one in event.values()), default=0))
        passes = self._at_once([event[id] for id in choice.ids])
        after, effects = self.leading.gathered(memory, now, passes, choice.words)
        after, more = self.fused(after)
        return after, (*withdrawn, *effects, *more)

    def fused(self, memory: Memory) -> Step:
        """After a step: who has no track, or too few reports for one, leads no more."""
        after, effects = self.leading.concluded(memory)
        if not self.leading.lost(after):
            return after, effects
        after, more = self.leading.end(after, "it has no track")
        return after, (*effects, *more)

    def _at_once(self, passes: list[Pass]) -> list[Pass]:
        """The reports as if all were of the step of the last one, so that trackers take them for one event."""
        last = max((one.report.step for one in passes), default=0)
        return [one for old in passes if (one := self._moved(old, last)) is not None]

    def _moved(self, one: Pass, step: int) -> Pass | None:
        early_s = one.report.early_s + self.leading.bank.step_ns * (step - one.report.step) / NS
        if early_s > MOST_EARLY_S:
            return None
        return one._replace(report=replace(one.report, step=step, early_s=early_s))


def _knows(memory: Memory, head: str) -> bool:
    """Whether it has heard the report of a head itself: then it hears, too, when that is done."""
    return any(one.sensor == head for one in memory.passes)
