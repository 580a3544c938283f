"""What nodes of which any may lead will send: in a step, at intervals, and during the setup.

Instants are those of the protocols, without what is lost: no poll is missed and no head dies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from launcher.plan.forecast.heads.polled import Polled
from launcher.plan.forecast.heads.turns import Turn
from launcher.plan.forecast.masters.scheduled import TOLD
from launcher.plan.forecast.sent import Again, Sent, of_trees, repeated, trees_again
from launcher.plan.forecast.tree import ACK, HOP
from trackfield.draw import uniform
from trackfield.protocols.election import ROUNDS
from trackfield.role import NEIGHBOURHOOD, NS

JOIN_TURNS: Final = 8
"""Nodes tell a head in so many turns that they sense its target."""


@dataclass(frozen=True)
class Polling:
    """What is sent in such a field."""

    field: Polled

    # --- in a step -----------------------------------------------------------------------------------------------

    def of_step(self, step: int) -> Iterator[Sent]:
        """What a step takes: an election before it, the poll for it, reports, what the head says, a hand-over."""
        turn = self.field.turns.get(step)
        if turn is None:
            return
        yield from self._elected(turn)
        yield from self._poll(turn)
        yield from self._reports(turn)
        yield from self._after(turn, turn.t_ns + round(self.field.plan.deadline_s * NS))

    def _elected(self, turn: Turn) -> Iterator[Sent]:
        """The winner claims first, and all who take part hand its claim on."""
        if not turn.contenders:
            return
        polls, seed = self.field.schedule, self.field.plan.run.seed
        claimed_ns = turn.elected_ns + polls.backoff_ns // 2
        yield self._plain(claimed_ns, turn.leader, NEIGHBOURHOOD, "claim")
        for id in turn.contenders:
            for number in range(ROUNDS - (id == turn.leader)):
                wait_ns = round(polls.hop_ns * (number + uniform(seed, id, "forecast", "relay", number)))
                yield self._plain(claimed_ns + wait_ns, id, NEIGHBOURHOOD, "join-claim")

    def _poll(self, turn: Turn) -> Iterator[Sent]:
        polls, sizes = self.field.schedule, self.field.sizes
        at_ns = turn.t_ns - self.field.plan.step_ns + polls.beacon_ns
        size = sizes["poll"] - 2 * (polls.count - len(turn.polled))
        yield Sent(at_ns, turn.leader, NEIGHBOURHOOD, "poll", size, polls.preamble_ns)
        for id in turn.joins:
            later_ns = polls.turn_ns * (1 + self._numbers[id] % JOIN_TURNS)
            yield self._plain(at_ns + later_ns, id, turn.leader, "join-claim")

    def _reports(self, turn: Turn) -> Iterator[Sent]:
        """What sensors report, or that they sense no target."""
        for id, slot in turn.slots.items():
            if id != turn.leader and id not in turn.deaf:
                none = "no-target", self.field.sizes["no-target"]
                kind, size = self.field.reports[id] if id in turn.sensed else none
                yield Sent(turn.t_ns + slot * self.field.schedule.slot_ns, id, turn.leader, kind, size)

    def _after(self, turn: Turn, at_ns: int) -> Iterator[Sent]:
        """What follows the deadline."""
        polls, sizes = self.field.schedule, self.field.sizes
        if turn.lost:
            yield self._plain(at_ns, turn.leader, NEIGHBOURHOOD, "dissolve")
            return
        yield self._plain(at_ns, turn.leader, NEIGHBOURHOOD, self.field.word)
        if polls.always_on and turn.step % polls.base_every == 1 % polls.base_every:
            yield from self._hops(at_ns, turn.leader, polls.base, sizes[TOLD])
        if turn.heir:
            yield self._plain(at_ns, turn.leader, turn.heir, "hand-over")
            yield self._plain(at_ns + self._takes_ns(sizes["hand-over"]), turn.heir, turn.leader, "hand-over-ack")

    def _hops(self, at_ns: int, src: str, dst: str, size: int) -> Iterator[Sent]:
        """What goes over the tree, with its acknowledgements."""
        if self.field.tree is None:
            return
        ack = self.field.sizes[ACK]
        for a, b in self.field.tree.way(src, dst):
            yield Sent(at_ns, a, b, HOP, size)
            at_ns += self._takes_ns(size)
            yield Sent(at_ns, b, a, ACK, ack)
            at_ns += self._takes_ns(ack)

    def _takes_ns(self, size: int) -> int:
        """How long a frame takes, about."""
        radio = self.field.radio
        return 0 if radio is None else radio.airtime_ns(min(size, radio.payload_bytes) + radio.overhead_bytes)

    def _plain(self, t_ns: int, src: str, dst: str, kind: str) -> Sent:
        return Sent(t_ns, src, dst, kind, self.field.sizes[kind])

    @cached_property
    def _numbers(self) -> Mapping[str, int]:
        return {id: number for number, id in enumerate(self.field.heads.ids)}

    # --- at intervals --------------------------------------------------------------------------------------------

    def at_intervals(self, begin_ns: int, end_ns: int) -> Iterator[Sent]:
        """What leaves in this time by intervals alone: clocks that are set, beacons of the tree."""
        yield from repeated(self._again, begin_ns, end_ns)

    @cached_property
    def _again(self) -> list[Again]:
        polls, found = self.field.schedule, list[Again]()
        preamble_ns = 0 if polls.always_on else polls.preamble_ns
        for id, clock in self.field.clocks.items():
            every_ns = clock.lasts_ns + clock.sync["resync_ns"]
            again = tuple(self._round(id, clock.reference, clock.sync, preamble_ns=preamble_ns))
            found.append(Again(clock.rounds[-1][0] + every_ns, every_ns, again))
        return [*found, *trees_again(self.field.plan, self.field.sizes)]

    def _round(
        self, id: str, to: str, sync: Mapping[str, Any], *, answered: bool = True, preamble_ns: int = 0
    ) -> Iterator[Sent]:
        """A round of asking for the time."""
        for n in range(sync["exchanges"]):
            asks_ns = n * sync["timeout_ns"]
            yield self._plain(asks_ns, id, to, "sync-request")._replace(preamble_ns=preamble_ns)
            if answered:
                yield self._plain(asks_ns + sync["timeout_ns"] // 2, to, id, "sync-reply")

    # --- setup ---------------------------------------------------------------------------------------------------

    def of_setup(self) -> Iterator[Sent]:
        """What is sent before the first step: announcements, in turn; clocks; beacons of the tree."""
        polls, plan, ids = self.field.schedule, self.field.plan, self.field.heads.ids
        round_ns = polls.announce_ns // polls.announcements
        for number, id in enumerate((*ids, polls.base)):
            turn_ns = round_ns * number // (len(ids) + 1)
            for n in range(polls.announcements):
                yield self._plain(n * round_ns + turn_ns, id, NEIGHBOURHOOD, "announce")
        for id, clock in self.field.clocks.items():
            for begins_ns, to, answered in clock.rounds:
                sent = self._round(id, to, clock.sync, answered=answered)
                yield from (one._replace(t_ns=begins_ns + one.t_ns) for one in sent)
        yield from of_trees(plan, self.field.sizes)
