"""A field in which any node may lead: what is expected of it, and the links that it will use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from head.beliefs import MOST_BYTES, packed_beliefs
from launcher.plan.forecast.heads.clocks import SYNCS, Clock, Clocks, asking, cast_of
from launcher.plan.forecast.heads.turns import Heads, Turn
from launcher.plan.forecast.masters.scheduled import MOST_STEPS, TOLD
from launcher.plan.forecast.reception import Shares
from launcher.plan.forecast.tree import Tree
from launcher.records import Flow, Plan, Polls
from trackfield.drivers.spec import link_of
from trackfield.filters.measurement import STATE
from trackfield.filters.types import Array, Gaussian
from trackfield.link.fate import FIELD, Link
from trackfield.link.radios import Radio
from trackfield.link.signals import Signals
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.bank import Bank
from trackfield.wire.clusters import Announce, HandOver, HandOverAck, NoTarget
from trackfield.wire.codec import encode
from trackfield.wire.messages import Hop
from trackfield.wire.peers import Claim, Dissolve, HeadEstimate, JoinClaim, LocalEstimate, Poll, Result
from trackfield.wire.registry import kind_of

TO_ALL: Final = ("announce", "claim", "poll", "result", "estimate", "dissolve")
"""What is sent to all in reach, once, without acknowledgements."""
LOCAL: Final = "local-estimate"
_ID: Final = b"n000"


@dataclass(frozen=True)
class Polled:
    """The ``plan`` with the links by which polled sensors report, and who is polled: ``turns`` at the steps looked at.

    ``clocks`` are those that are set, by node. ``sizes`` are the bytes of messages by kind. ``cast`` are the links
    for what is sent to all in reach.
    """

    plan: Plan
    schedule: Polls
    link: Link
    cast: Link
    sizes: Mapping[str, int]
    turns: Mapping[int, Turn]
    every: int
    heads: Heads
    clocks: Mapping[str, Clock]

    @classmethod
    def of(cls, plan: Plan, schedule: Polls) -> Polled:
        """What is expected of a plan."""
        link, cast, samples = (
            link_of(plan.run, plan.processes, cut=False),
            cast_of(plan, TO_ALL),
            _samples(plan, schedule),
        )
        sizes = {_name(flow.message): len(encode(flow.message)) for flow in plan.flows}
        sizes |= {name: len(encode(message)) for name, message in samples.items()}
        last = (plan.run.end_ns - 1 - plan.origin_ns) // plan.step_ns
        every = -(-last // MOST_STEPS) or 1
        heads = Heads(plan, schedule, cast, sizes["announce"], sizes["poll"])
        turns = {turn.step: turn for turn in heads.turns() if turn.step % every == 1 % every}
        clocks = Clocks(plan, schedule, link, cast, sizes).all()
        reports = samples[LOCAL] if schedule.local else None
        narrowed = replace(plan, flows=tuple(_narrowed(plan, turns, clocks, reports)))
        return cls(narrowed, schedule, link, cast, sizes, turns, every, heads, clocks)

    @property
    def each(self) -> Iterator[tuple[Turn, Mapping[str, int]]]:
        """The turns, each with the sensors that measure and have a target in reach, with the number of the nearest."""
        return ((turn, turn.sensed) for turn in self.turns.values())

    @cached_property
    def reports(self) -> Mapping[str, tuple[str, int]]:
        """The kind and the bytes of a report of each sensor."""
        sensing = {name: make_sensor(**given) for name, given in self.plan.tracking["sensing"].items()}
        known = {name: (_name(one.longest()), len(encode(one.longest()))) for name, one in sensing.items()}
        if self.schedule.local:
            known = dict.fromkeys(known, (LOCAL, self.sizes[LOCAL]))
        kinds: Mapping[str, Any] = self.plan.tracking.get("kinds") or {next(iter(known)): self.heads.ids}
        return {id: known[name] for name, ids in kinds.items() for id in ids}

    @property
    def radio(self) -> Radio | None:
        """That of the field; None if it has none."""
        signals = Signals.of(self.link, FIELD)
        return None if signals is None else signals.radio

    @property
    def word(self) -> str:
        """The kind of message in which a head says at each step what it knows."""
        return "result" if self.schedule.short else "estimate"

    @cached_property
    def tree(self) -> Tree | None:
        """The tree to the base."""
        return Tree.of(self.plan)

    # --- links -------------------------------------------------------------------------------------------------------

    @cached_property
    def receptions(self) -> Mapping[str, Shares]:
        """The share of polls and of hand-overs that arrives, on the links on which they are sent."""
        polls, handed = Shares(), Shares()
        for turn in self.turns.values():
            for id in turn.polled:
                if id != turn.leader:
                    polls[turn.leader, id] = self.cast.reception(turn.leader, id, self.sizes["poll"], "poll")
            if turn.heir:
                both = turn.leader, turn.heir
                handed[both] = self.link.reception(*both, self.sizes["hand-over"], "hand-over")
        return {kind: shares for kind, shares in (("poll", polls), ("hand-over", handed)) if shares}

    @cached_property
    def told(self) -> Mapping[int, float]:
        """The share of what the head says at a step that the base hears, by the steps looked at."""
        return {step: self._told(turn.leader, turn.t_ns) for step, turn in self.turns.items()}

    def _told(self, leader: str, t_ns: int) -> float:
        if self.schedule.always_on:
            return self.tree.share(leader, self.schedule.base) if self.tree is not None else 0.0
        return self.cast.reception(leader, self.schedule.base, self.sizes[self.word], self.word, t_ns)

    def chances(self, rows: Iterator[tuple[int, str]]) -> Array:
        """(n,) the probability that the head has the report of a sensor, made then (ns): it heard a poll, and reports.

        What the head measures itself it has.
        """
        turns = {turn.t_ns: turn for turn in self.turns.values()}
        return np.array([self._chance(turns[t_ns], id) for t_ns, id in rows], float)

    def _chance(self, turn: Turn, id: str) -> float:
        if id == turn.leader:
            return 1.0
        missed = 1.0 - self.receptions["poll"].get((turn.leader, id), 0.0)
        kind, size = self.reports[id]
        return (1.0 - missed ** turn.polls[id]) * self.link.reception(id, turn.leader, size, kind, turn.t_ns)


def _samples(plan: Plan, schedule: Polls) -> dict[str, Any]:
    """Messages of ordinary length by kind: those of a step in the middle of the run."""
    step = (plan.run.end_ns - plan.origin_ns) // plan.step_ns // 2
    bank = Bank(**plan.tracking)
    known = dict.fromkeys(bank.trackers, Gaussian(np.zeros(STATE), np.eye(STATE)))
    beliefs = bank.beliefs(bank.resume(known, 0, 0).tracks)
    handed = packed_beliefs(step, beliefs, particles=schedule.hands == "particles", modes=schedule.hands == "modes")
    short = Result(10, step, 500.0, 500.0, 5.0, 5.0, 5.0, 1.0)
    gaussian = packed_beliefs(step, beliefs)
    word = short if schedule.short else HeadEstimate(10, step, gaussian)
    return {
        "announce": Announce(2, 3, 0, 500.0, 500.0),
        "claim": Claim(10, 30_000, step),
        "join-claim": JoinClaim(10, 30_000, _ID, 30_000, step),
        "poll": Poll(10, step, bytes(2 * schedule.count)),
        "no-target": NoTarget(100),
        "hand-over": HandOver(10, step, handed[:MOST_BYTES]),
        "hand-over-ack": HandOverAck(10),
        "dissolve": Dissolve(10, step, 1),
        _name(word): word,
        LOCAL: LocalEstimate(10, step, gaussian),
        TOLD: Hop(_ID, 1000, 3, 9.99, b"", encode(word)),
    }


def _name(message: Any) -> str:
    return kind_of(message).name


def _narrowed(
    plan: Plan, turns: Mapping[int, Turn], clocks: Mapping[str, Clock], local: LocalEstimate | None
) -> Iterator[Flow]:
    """The links by which polled sensors report, in place of all on which they might, and by which clocks are set.

    If sensors filter, they report such ``local`` estimates.
    """
    used = {(id, turn.leader) for turn in turns.values() for id in turn.sensed if id != turn.leader}
    reports = LOCAL if local is not None else ""
    for flow in plan.flows:
        kind = _name(flow.message)
        if kind in SYNCS:
            yield from (one for one in (asking(flow, clocks),) if one)
        elif kind == reports or (flow.reports and not reports):
            if pairs := tuple(sorted(used.intersection(flow.pairs))):
                yield replace(flow, message=local or flow.message, pairs=pairs, near=False, reports=True)
        elif not flow.reports:
            yield flow
