"""What a field that hears targets pass will send: interests, reports and fixes on their ways, what sets clocks.

Instants are those of the protocols, without what is lost. Reports go the shortest ways; those by which sources say
where they are, and by which ways are reinforced, are left out: some messages at the start.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from launcher.plan.forecast.hearing.events import Event
from launcher.plan.forecast.hearing.passed import Fixed, Passed
from launcher.plan.forecast.sent import Again, Sent, repeated
from launcher.records import SENSES
from trackfield.draw import uniform
from trackfield.protocols.interest.interests import REFRESHES
from trackfield.role import NEIGHBOURHOOD, NS

DATA: Final = "data"


@dataclass(frozen=True)
class Diffusing:
    """What is sent in such a field."""

    field: Passed

    # --- events --------------------------------------------------------------------------------------------------

    def of_step(self, step: int) -> Iterator[Sent]:
        """The messages of the events whose last report is for this step."""
        for event in self._events.get(step, ()):
            yield from self._reported(event)
        for fixed in self._fixes.get(step, ()):
            yield from self._told(fixed)

    @property
    def busy(self) -> Set[int]:
        """The steps that have such messages."""
        return self._events.keys() | self._fixes.keys()

    @cached_property
    def _events(self) -> Mapping[int, list[Event]]:
        found: dict[int, list[Event]] = {}
        for event in self.field.events:
            found.setdefault(self.field.plan.step_of(event.last_ns) + 1, []).append(event)
        return found

    @cached_property
    def _fixes(self) -> Mapping[int, list[Fixed]]:
        found: dict[int, list[Fixed]] = {}
        for fixed in self.field.fixes:
            found.setdefault(self.field.plan.step_of(fixed.event.last_ns) + 1, []).append(fixed)
        return found

    def _reported(self, event: Event) -> Iterator[Sent]:
        """Each report to its head; if the loudest leads, all around hear it, and the head asks for it first."""
        loudest, size = self.field.schedule.loudest, self.field.sizes[DATA]
        begin_ns = event.last_ns + self.field.schedule.close_ns
        if loudest:
            yield from self._flood(begin_ns, event.head, self.field.schedule.most_hops)
        for id, at_ns in event.heard.items():
            if loudest:
                yield Sent(at_ns, id, NEIGHBOURHOOD, self._report_kind, self.field.sizes[self._report_kind])
            yield from self._carried(begin_ns if loudest else at_ns, id, event.head, size)

    @cached_property
    def _report_kind(self) -> str:
        return next(kind for kind in self.field.sizes if kind.startswith("cpa-report"))

    def _told(self, fixed: Fixed) -> Iterator[Sent]:
        """The fix to the base, and to heads that want it; of the loudest, to those around, too."""
        base, head = self.field.schedule.base, fixed.event.head
        if self.field.schedule.loudest:
            yield Sent(fixed.head_ns, head, NEIGHBOURHOOD, "fix", self.field.fix_bytes)
        for id in (base, *self.field.told(head)):
            yield from self._carried(fixed.head_ns, head, id, self.field.fix_bytes)

    def _carried(self, at_ns: int, src: str, dst: str, size: int) -> Iterator[Sent]:
        """A message from hop to hop, with its acknowledgements."""
        for a, b in self.field.reached.way(src, dst):
            yield Sent(at_ns, a, b, DATA, size)
            at_ns += self._takes_ns(size)
            yield Sent(at_ns, b, a, "data-ack", self.field.sizes["data-ack"])
            at_ns += self._takes_ns(self.field.sizes["data-ack"])

    def _takes_ns(self, size: int) -> int:
        radio = self.field.radio
        return 0 if radio is None else radio.airtime_ns(min(size, radio.payload_bytes) + radio.overhead_bytes)

    # --- interests and clocks ------------------------------------------------------------------------------------

    def at_intervals(self, begin_ns: int, end_ns: int) -> Iterator[Sent]:
        """What leaves in this time by intervals alone: interests that are spread anew, clocks that are set again."""
        yield from repeated(self._again, begin_ns, end_ns)

    @cached_property
    def _again(self) -> list[Again]:
        plan, every_ns = self.field.plan, self.every_ns
        found = [Again(plan.origin_ns, every_ns, tuple(self.refresh()))]
        for id, clock in self.field.clocks.items():
            again_ns = clock.lasts_ns + clock.sync["resync_ns"]
            found.append(
                Again(clock.rounds[-1][0] + again_ns, again_ns, tuple(self._round(id, clock.reference, clock.sync)))
            )
        return found

    @property
    def every_ns(self) -> int:
        """The time between two refreshes of an interest."""
        return round(self.field.schedule.interest_s * NS / REFRESHES)

    def refresh(self) -> Iterator[Sent]:
        """One round of all interests that are always wanted: in fixes, and of fixed heads in passes."""
        schedule = self.field.schedule
        yield from self._flood(0, schedule.base, len(self.field.reached.near))
        for group in schedule.clusters:
            for _ in range(1 if len(schedule.clusters) == 1 else 2):  # in fixes of other heads, too
                yield from self._flood(0, group[0], schedule.most_hops)

    def _flood(self, at_ns: int, sink: str, most_hops: int) -> Iterator[Sent]:
        """The interest of a sink, as each one in reach hands it on once."""
        seed, jitter_ns = self.field.plan.run.seed, self.field.schedule.hop_ns
        for id, hops in self.field.reached.hops(sink).items():
            if hops < most_hops:
                later_ns = hops * jitter_ns // 2 + int(jitter_ns * uniform(seed, id, "forecast", "flood")) * (hops > 0)
                yield Sent(at_ns + later_ns, id, NEIGHBOURHOOD, "interest", self.field.sizes["interest"])

    def _round(self, id: str, to: str, sync: Mapping[str, Any], *, answered: bool = True) -> Iterator[Sent]:
        """A round of asking for the time."""
        for n in range(sync["exchanges"]):
            asks_ns = n * sync["timeout_ns"]
            yield Sent(asks_ns, id, to, "sync-request", self.field.sizes["sync-request"])
            if answered:
                yield Sent(asks_ns + sync["timeout_ns"] // 2, to, id, "sync-reply", self.field.sizes["sync-reply"])

    # --- setup ---------------------------------------------------------------------------------------------------

    def of_setup(self) -> Iterator[Sent]:
        """What is sent before the first step: announcements, in turn, and what sets clocks."""
        schedule, ids = self.field.schedule, [place.id for place in self.field.plan.info.tagged(SENSES)]
        round_ns = schedule.announce_ns // schedule.announcements
        for number, id in enumerate((*ids, schedule.base)):
            turn_ns = round_ns * number // (len(ids) + 1)
            for n in range(schedule.announcements):
                yield Sent(n * round_ns + turn_ns, id, NEIGHBOURHOOD, "announce", self.field.sizes["announce"])
        for id, clock in self.field.clocks.items():
            for begins_ns, to, answered in clock.rounds:
                sent = self._round(id, to, clock.sync, answered=answered)
                yield from (one._replace(t_ns=begins_ns + one.t_ns) for one in sent)
