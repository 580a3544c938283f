"""A field in which leaders choose who measures: what is expected of it, and the links that it will use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, inf
from typing import Any, Final

import numpy as np

from head.beliefs import MOST_BYTES, packed_beliefs
from launcher.plan.forecast.masters.association import Association, associated
from launcher.plan.forecast.masters.turns import Turn, Turns
from launcher.plan.forecast.tree import Tree
from launcher.records import Flow, Plan, Schedule
from trackfield.drivers.spec import link_of
from trackfield.filters.belief import Belief
from trackfield.filters.measurement import STATE
from trackfield.filters.types import Gaussian
from trackfield.link.fate import FIELD, Link
from trackfield.link.radios import Radio
from trackfield.link.signals import Signals
from trackfield.role import NS
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.clusters import Aggregate, HandOver, LedTrack, Merge, Roster, Share, Wake
from trackfield.wire.codec import encode
from trackfield.wire.messages import Hop
from trackfield.wire.registry import kind_of

MOST_STEPS: Final = 2000
"""Of a run with more steps, only every n-th is looked at."""
BETWEEN: Final = frozenset({"merge", "aggregate", "hand-over", "hand-over-ack"})
"""What a leader and another master say to each other."""
_STEP: Final = 1000
_ID: Final = b"m00"
TOLD: Final = "told"
"""What goes over the tree when the base is told."""


@dataclass(frozen=True)
class Scheduled:
    """The ``plan`` with the links that will be used, and who measures when: ``turns`` at the steps looked at.

    ``sizes`` are the bytes of messages by kind, where they do not depend on how many sensors measure.
    """

    plan: Plan
    schedule: Schedule
    link: Link
    sizes: Mapping[str, int]
    association: Association
    turns: Mapping[int, Turn]
    every: int
    seen: Turns

    @classmethod
    def of(cls, plan: Plan) -> Scheduled | None:
        """What is expected of a plan; None if all sensors measure that have a target in reach."""
        schedule = plan.schedule
        if not isinstance(schedule, Schedule):
            return None
        link, samples = link_of(plan.run, plan.processes, cut=False), _samples(plan, schedule)
        plan = replace(plan, flows=tuple(replace(f, message=samples.get(_name(f), f.message)) for f in plan.flows))
        messages = {**{_name(flow): flow.message for flow in plan.flows}, **samples}
        sizes = {name: len(encode(message)) for name, message in messages.items()}
        sizes["report"] = max(len(encode(flow.message)) for flow in plan.reports)
        association = associated(plan, schedule, link, sizes)
        last = (plan.run.end_ns - 1 - plan.origin_ns) // plan.step_ns
        every = -(-last // MOST_STEPS) or 1
        seen, turns = Turns(plan, schedule, link, association), dict[int, Turn]()
        for step in range(1, last + 1, every):
            if every > 1:
                seen.at(step - 1)
            if (turn := seen.at(step)) is not None:
                turns[step] = turn
        between = {(id, turn.leader) for turn in turns.values() for id in turn.gathered}
        between |= {
            (turns[step - 1].leader, turn.leader)
            for step, turn in turns.items()
            if step - 1 in turns and turns[step - 1].leader != turn.leader
        }
        flows = tuple(flow for one in plan.flows if (flow := _used(one, association, between)).pairs)
        return cls(replace(plan, flows=flows), schedule, link, sizes, association, turns, every, seen)

    def after(self, step: int) -> Turn | None:
        """The turn of the step after this one."""
        return self.seen.at(step + 1)

    @property
    def each(self) -> Iterator[tuple[Turn, Mapping[str, int]]]:
        """The turns, each with the sensors that measure and have a target in reach, with the number of the nearest."""
        return ((turn, self.sensed(turn)) for turn in self.turns.values())

    def sensed(self, turn: Turn) -> dict[str, int]:
        """The sensors that measure then and have a target in reach, with the number of the nearest one."""
        found, plan = dict[str, int](), self.plan
        states = [path.at(turn.t_ns / NS) for path in plan.paths.values()]
        for id in turn.slots:
            x, y = self.seen.positions[id]
            away = [inf if state is None else hypot(state[0] - x, state[1] - y) for state in states]
            if min(away) <= plan.reaches[id]:
                found[id] = away.index(min(away))
        return found

    @cached_property
    def reports(self) -> Mapping[str, tuple[str, int]]:
        """The kind and the bytes of a report of each sensor that has a master."""
        return {src: (_name(flow), len(encode(flow.message))) for flow in self.plan.reports for src, _ in flow.pairs}

    @property
    def radio(self) -> Radio | None:
        """That of the field; None if it has none."""
        signals = Signals.of(self.link, FIELD)
        return None if signals is None else signals.radio

    @cached_property
    def tree(self) -> Tree | None:
        """The tree to the base."""
        return Tree.of(self.plan)


def aggregate_bytes(sensors: int, report: int) -> int:
    """The bytes of so many reports of such a length in one message."""
    return len(encode(Aggregate(10, _STEP, bytes(sensors * (report + 3)))))


def wake_bytes(sensors: int) -> int:
    """The bytes of a beacon for so many slaves."""
    return len(encode(Wake(10, _ID, _STEP, 10, 0, bytes(sensors))))


def merge_bytes(sensors: int) -> int:
    """The bytes of a request for so many sensors."""
    return len(encode(Merge(10, _STEP, 10, 5, bytes(2 * sensors))))


def _samples(plan: Plan, schedule: Schedule) -> dict[str, Any]:
    """Messages of ordinary length by kind, of kinds that may be much longer, and how a leader tells the base."""
    sensing = [make_sensor(**arguments) for arguments in plan.tracking["sensing"].values()]
    n = STATE + len({name for kind in sensing for name in kind.unknowns})
    beliefs: dict[str, Belief | None] = dict.fromkeys(plan.tracking["trackers"], Gaussian(np.zeros(n), np.eye(n)))
    belief = packed_beliefs(_STEP, beliefs, particles=False)
    cluster = bytes(2 * schedule.capacity)
    told = LedTrack(10, _STEP, cluster, belief)
    report = max(len(encode(flow.message)) for flow in plan.reports)
    return {
        "wake": Wake(10, _ID, _STEP, 10, 0, bytes(schedule.capacity)),
        "merge": Merge(10, _STEP, 10, 5, cluster),
        "aggregate": Aggregate(10, _STEP, bytes(schedule.capacity * (report + 3))),
        "hand-over": HandOver(10, _STEP, bytes(MOST_BYTES) if schedule.particles else belief),
        "share": Share(10, _STEP, _ID, belief),
        "roster": Roster(cluster),
        "led-track": told,
        TOLD: Hop(_ID, 1000, 3, 9.99, b"", encode(told)),
    }


def _name(flow: Flow) -> str:
    return kind_of(flow.message).name


def _used(flow: Flow, association: Association, between: set[tuple[str, str]]) -> Flow:
    """The links of this kind that will be used, in place of those that are declared."""
    name = _name(flow)
    if flow.near or flow.over_tree:
        return flow
    if name in BETWEEN:
        pairs = between if name in ("aggregate", "hand-over") else {(b, a) for a, b in between}
        return replace(flow, pairs=tuple(sorted(pairs)))
    known = {**association.masters, **association.references}
    if name == "sync-reply":
        return replace(flow, pairs=tuple((known[id], id) for _, id in flow.pairs if id in known))
    return replace(flow, pairs=tuple((id, known[id]) for id, _ in flow.pairs if id in known))
