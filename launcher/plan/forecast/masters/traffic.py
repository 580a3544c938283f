"""What masters and slaves will send: in a step, at intervals, and during the setup.

Instants are those of the protocols, without what is lost: no report is missed and no leader dies. A slave whose master
does not answer asks as often as may be expected.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from head.leading import NOTICES
from launcher.plan.forecast.masters.scheduled import TOLD, Scheduled, aggregate_bytes, merge_bytes, wake_bytes
from launcher.plan.forecast.masters.turns import Turn
from launcher.plan.forecast.sent import Again, Sent, of_trees, repeated, trees_again
from launcher.plan.forecast.tree import ACK, HOP
from launcher.records import SENSES
from trackfield.draw import uniform
from trackfield.protocols.association.admitting import TOLD as ROSTERS
from trackfield.protocols.timesync import SPREAD_NS
from trackfield.role import NEIGHBOURHOOD, NS

PAUSES: Final = 3
"""Rounds of asking for the time that fail begin after so many times their length, on average."""


@dataclass(frozen=True)
class Traffic:
    """What is sent in a field with a schedule."""

    field: Scheduled

    # --- in a step -----------------------------------------------------------------------------------------------

    def of_step(self, step: int) -> Iterator[Sent]:
        """What is sent from the instant of a step on to that of the next one."""
        turn = self.field.turns.get(step)
        if turn is None:
            return
        after = self.field.after(step) or turn
        yield from self._reports(turn)
        yield from self._gathered(turn)
        at_ns = turn.t_ns + round(self.field.plan.deadline_s * NS)
        yield from self._told(turn, at_ns)
        yield from self._handed(turn, after, at_ns)
        yield from self._asked(turn, after, at_ns)
        yield from self._beacons(step, turn, after)

    def _reports(self, turn: Turn) -> Iterator[Sent]:
        """What sensors report, or that they sense no target."""
        sensed, slot_ns = self.field.sensed(turn), self.field.schedule.slot_ns
        for id, slot in turn.slots.items():
            master = self.field.association.masters[id]
            kind, size = self.field.reports[id] if id in sensed else ("no-target", self.field.sizes["no-target"])
            yield Sent(turn.t_ns + slot * slot_ns, id, master, kind, size)

    def _gathered(self, turn: Turn) -> Iterator[Sent]:
        """What other masters send the leader of their slaves' reports."""
        for id, slot in turn.gathered.items():
            size = aggregate_bytes(len(turn.sensors[id]), self.field.sizes["report"])
            yield Sent(turn.t_ns + slot * self.field.schedule.slot_ns, id, turn.leader, "aggregate", size)

    def _told(self, turn: Turn, at_ns: int) -> Iterator[Sent]:
        """The belief: to those in reach, and hop by hop to the base."""
        schedule, sizes = self.field.schedule, self.field.sizes
        if turn.step % schedule.share_every == 0:
            yield Sent(at_ns, turn.leader, NEIGHBOURHOOD, "share", sizes["share"])
        if turn.step % schedule.base_every == 1 % schedule.base_every and self.field.tree is not None:
            for n, (src, dst) in enumerate(self.field.tree.way(turn.leader, schedule.base)):
                now = at_ns + n * (self._takes_ns(HOP, sizes[TOLD]) + self._takes_ns(ACK, sizes[ACK]))
                yield Sent(now, src, dst, HOP, sizes[TOLD])
                yield Sent(now + self._takes_ns(HOP, sizes[TOLD]), dst, src, ACK, sizes[ACK])

    def _handed(self, turn: Turn, after: Turn, at_ns: int) -> Iterator[Sent]:
        if after.leader != turn.leader:
            sizes = self.field.sizes
            yield Sent(at_ns, turn.leader, after.leader, "hand-over", sizes["hand-over"])
            back_ns = at_ns + self._takes_ns("hand-over", sizes["hand-over"])
            yield Sent(back_ns, after.leader, turn.leader, "hand-over-ack", sizes["hand-over-ack"])

    def _asked(self, turn: Turn, after: Turn, at_ns: int) -> Iterator[Sent]:
        """Other masters are asked when what is wanted of them changes, and when their slaves would fall asleep."""
        handed, due = after.leader != turn.leader, turn.step % self.field.schedule.beacon_every == 0
        wanted = {id: after.sensors[id] for id in after.gathered}
        before = {} if handed else {id: turn.sensors[id] for id in turn.gathered}
        for id, sensors in wanted.items():
            if due or before.get(id) != sensors:
                yield Sent(at_ns, after.leader, id, "merge", merge_bytes(len(sensors)))
        for id in before.keys() - wanted.keys():
            yield Sent(at_ns, after.leader, id, "merge", merge_bytes(0))

    def _beacons(self, step: int, turn: Turn, after: Turn) -> Iterator[Sent]:
        """The leader's at every step; others say what changes, and for some steps who leads."""
        schedule, due = self.field.schedule, step % self.field.schedule.beacon_every == 0
        woken = {id for id in after.gathered if due or turn.sensors.get(id) != after.sensors[id]}
        notice = {one.leader for n in range(NOTICES) if (one := self.field.turns.get(step - n)) is not None}
        for id in sorted({after.leader, *woken, *notice, *(turn.sensors.keys() - after.sensors.keys())}):
            size = wake_bytes(len(after.sensors.get(id, ())))
            yield Sent(turn.t_ns + schedule.beacon_ns, id, NEIGHBOURHOOD, "wake", size, schedule.preamble_ns)

    def _takes_ns(self, kind: str, size: int) -> int:
        """How long a frame takes, about."""
        radio = self.field.radio
        return 0 if radio is None else radio.airtime_ns(min(size, radio.payload_bytes) + radio.overhead_bytes)

    # --- at intervals --------------------------------------------------------------------------------------------

    def at_intervals(self, begin_ns: int, end_ns: int) -> Iterator[Sent]:
        """What leaves in this time by intervals alone: clocks that are set, places renewed, beacons of the tree."""
        yield from repeated(self._again, begin_ns, end_ns)

    @cached_property
    def _again(self) -> list[Again]:
        schedule, found, seed = self.field.schedule, list[Again](), self.field.plan.run.seed
        for id, (known_ns, sync) in self._clocks.items():
            found.append(Again(known_ns + sync["resync_ns"], sync["resync_ns"], tuple(self._round(id, sync))))
        for number, (id, master) in enumerate(self.field.association.masters.items()):
            share = 0.9 + 0.2 * uniform(seed, id, "forecast", number)
            joined_ns = schedule.joins_ns + number * schedule.turn_ns
            sent = (self._plain(0, id, master, "join"), self._plain(0, master, id, "admit"))
            found.append(Again(joined_ns + round(share * schedule.renew_ns), round(share * schedule.renew_ns), sent))
        return [*found, *trees_again(self.field.plan, self.field.sizes)]

    def _plain(self, t_ns: int, src: str, dst: str, kind: str) -> Sent:
        return Sent(t_ns, src, dst, kind, self.field.sizes.get(kind, 0))

    # --- setup ---------------------------------------------------------------------------------------------------

    def of_setup(self) -> Iterator[Sent]:
        """What is sent before the first step."""
        plan, schedule = self.field.plan, self.field.schedule
        round_ns = schedule.announce_ns // schedule.announcements
        for rank, id in enumerate((schedule.base, *(id for id, _, _ in schedule.masters))):
            turn_ns = int(round_ns * rank / (len(schedule.masters) + 1))
            for number in range(schedule.announcements):
                yield self._plain(number * round_ns + turn_ns, id, NEIGHBOURHOOD, "announce")
        asked = self.field.association.asked
        for number, (id, tried) in enumerate(asked.items()):
            now = schedule.joins_ns + number * schedule.turn_ns
            for master, joins, answered in tried:
                yield from (self._plain(now + n * schedule.turn_ns, id, master, "join") for n in range(joins))
                if answered:
                    yield self._plain(now + schedule.turn_ns // 2, master, NEIGHBOURHOOD, "admit")
                now += joins * schedule.turn_ns
        told_ns = schedule.joins_ns + len(asked) * schedule.turn_ns
        for rank, (id, _, _) in enumerate(schedule.masters):
            turn_ns = told_ns + int(round_ns * (rank + 1) / (len(schedule.masters) + 1))
            for number in range(ROSTERS):
                yield self._plain(turn_ns + number * round_ns, id, NEIGHBOURHOOD, "roster")
        yield from self._first_rounds
        yield from of_trees(plan, self.field.sizes)

    def _round(self, id: str, sync: Mapping[str, Any], *, answered: bool = True) -> Iterator[Sent]:
        """A round of asking for the time."""
        to = self._reference(id)
        for n in range(sync["exchanges"]):
            yield self._plain(n * sync["timeout_ns"], id, to, "sync-request")
            if answered:
                half_ns = n * sync["timeout_ns"] + sync["timeout_ns"] // 2
                yield self._plain(half_ns, to, id, "sync-reply")

    def _reference(self, id: str) -> str:
        return {**self.field.association.references, **self.field.association.masters}[id]

    @cached_property
    def _rounds(self) -> tuple[dict[str, tuple[int, Mapping[str, Any]]], list[Sent]]:
        """When each clock is set first, and how; and all that is sent for that, also to those that do not know yet."""
        plan, schedule, known, sent = self.field.plan, self.field.schedule, dict[str, Any](), list[Sent]()
        syncs = {p.id: p.config["sync"] for p in plan.processes if p.config.get("sync") and not p.incarnation}
        numbers = {place.id: number for number, place in enumerate(plan.info.tagged(SENSES))}
        ranks = {id: rank for rank, id in enumerate(self.field.association.references)}
        clock_ns = (schedule.joins_ns - schedule.announce_ns) // len(ranks)
        for id in (*self.field.association.references, *self.field.association.masters):
            if id not in syncs:
                continue
            sync, reference = syncs[id], self._reference(id)
            if id in numbers:
                now = schedule.joins_ns + numbers[id] * schedule.turn_ns
            else:  # one after the other, from the base outwards
                now = schedule.announce_ns + ranks[id] * clock_ns
            now += round(SPREAD_NS * uniform(plan.run.seed, id, "sync", "start"))
            lasts_ns, ready_ns = sync["exchanges"] * sync["timeout_ns"], known.get(reference, (0,))[0]
            while now + lasts_ns - sync["timeout_ns"] < ready_ns:
                sent += (one._replace(t_ns=now + one.t_ns) for one in self._round(id, sync, answered=False))
                now += PAUSES * lasts_ns
            sent += (one._replace(t_ns=now + one.t_ns) for one in self._round(id, sync))
            known[id] = now + lasts_ns, sync
        return known, sent

    @property
    def _clocks(self) -> Mapping[str, tuple[int, Mapping[str, Any]]]:
        return self._rounds[0]

    @property
    def _first_rounds(self) -> list[Sent]:
        return self._rounds[1]
