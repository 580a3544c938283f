"""A field whose sensors hear targets pass: what is expected of it, and the links that it will use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from statistics import median
from typing import Final, NamedTuple

import numpy as np

from launcher.plan.forecast.heads.clocks import SYNCS, Clock, Clocks, asking, cast_of
from launcher.plan.forecast.hearing.events import Event, events_of
from launcher.plan.forecast.hearing.reached import Reached
from launcher.plan.payloads import payloads
from launcher.records import Flow, Passing, Plan
from trackfield.drivers.spec import link_of
from trackfield.link.fate import FIELD, Link, Transmission
from trackfield.link.radios import Radio
from trackfield.link.signals import Signals
from trackfield.role import NS
from trackfield.sensing.cpa import KNOWN_NS, LATER_NS
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.codec import encode
from trackfield.wire.interests import Data, DataAck, Interest
from trackfield.wire.registry import kind_of
from trackfield.world.events import ENOUGH

TRIALS: Final = 100
"""Messages that are sent on trial, at most."""
TO_ALL: Final = ("announce", "interest")
"""What is sent to all in reach, once, without acknowledgements."""
_ID: Final = b"n000"


class Fixed(NamedTuple):
    """An event from whose reports there is a fix: when (ns) its head has it, and the base, if that is in reach."""

    event: Event
    head_ns: int
    base_ns: int | None

    @property
    def after_s(self) -> float:
        """How long after the last pass its head has the fix."""
        return (self.head_ns - self.event.last_ns + KNOWN_NS) / NS


@dataclass(frozen=True)
class Passed:
    """The ``plan`` with the links by which clocks are set, and the ``events`` to come.

    ``clocks`` are those that are set, by node. ``sizes`` are the bytes of messages by kind; of data with a report, and
    ``fix_bytes`` of data with a fix. ``cast`` are the links for what is sent to all in reach.
    """

    plan: Plan
    schedule: Passing
    link: Link
    sizes: Mapping[str, int]
    fix_bytes: int
    events: Sequence[Event]
    reached: Reached
    clocks: Mapping[str, Clock]
    every: int = 1

    @classmethod
    def of(cls, plan: Plan, schedule: Passing) -> Passed:
        """What is expected of a plan."""
        link = link_of(plan.run, plan.processes, cut=False)
        report, fix = payloads(plan.tracking)
        sizes = {kind_of(flow.message).name: len(encode(flow.message)) for flow in plan.flows} | {
            "interest": len(encode(Interest(_ID, 1000, 1000, 1, 50.0, 50.0, 20.0, 0.0, schedule.interest_s, 2, 4))),
            "data": len(encode(Data(_ID, 1000, _ID, 1000, 2, 0, report))),
            "data-ack": len(encode(DataAck(_ID, 1000))),
        }
        clocks = Clocks(plan, schedule, link, cast_of(plan, TO_ALL), sizes).all()
        return cls(
            replace(plan, flows=tuple(_narrowed(plan, clocks))),
            schedule,
            link,
            sizes,
            len(encode(Data(_ID, 1000, _ID, 1000, 2, 0, fix))),
            events_of(plan, schedule),
            Reached.of(plan),
            clocks,
        )

    @property
    def radio(self) -> Radio | None:
        """That of the field; None if it has none."""
        signals = Signals.of(self.link, FIELD)
        return None if signals is None else signals.radio

    @property
    def reports(self) -> Mapping[str, tuple[str, int]]:
        """The kind and the bytes of the message that carries a report, of each sensor that will send some."""
        return {id: ("data", self.sizes["data"]) for event in self.events for id in event.heard}

    @property
    def heads(self) -> tuple[str, ...]:
        """Who leads at any time, by what is known before the run."""
        return tuple(dict.fromkeys((*(group[0] for group in self.schedule.clusters), *(e.head for e in self.events))))

    @cached_property
    def hop_s(self) -> float:
        """How long a message takes for a hop on an idle channel: the median of some that are sent on trial."""
        links = [(src, dst) for src, those in self.reached.near.items() for dst in those]
        some, size = links[:: -(-len(links) // TRIALS) or 1], self.sizes["data"]
        sent = (Transmission(*link, "data", self.plan.origin_ns, 0, size) for link in some)
        delays = [fate.delay_ns for fate in map(self.link.fate, sent) if fate.cause is None]
        return median(delays) / NS if delays else 0.0

    # --- events ------------------------------------------------------------------------------------------------------

    def hops(self, event: Event) -> Mapping[str, int]:
        """How many hops each report of an event goes, of those that reach its head."""
        hops = self.reached.hops(event.head)
        return {id: hops[id] for id in event.heard if id in hops and hops[id] <= self.schedule.most_hops}

    def told(self, head: str) -> tuple[str, ...]:
        """The heads whose interests in fixes reach this one, and cover it."""
        hops, most = self.reached.hops(head), self.schedule.most_hops
        return tuple(id for id in self.schedule.tells.get(head, ()) if id in hops and hops[id] <= most)

    def arrival(self, event: Event, id: str) -> float:
        """The probability that the report of this sensor is with its head: each hop is tried twice."""
        shares = [self.link.reception(src, dst, self.sizes["data"], "data") for src, dst in self._way(event, id)]
        return float(np.prod([1.0 - (1.0 - share) ** 2 for share in shares])) if id in self.hops(event) else 0.0

    def _way(self, event: Event, id: str) -> Sequence[tuple[str, str]]:
        return self.reached.way(id, event.head)

    @cached_property
    def fixes(self) -> Sequence[Fixed]:
        """The events from whose reports there will be a fix."""
        return [self._fixed(event) for event in self.events if len(self.hops(event)) >= ENOUGH]

    @cached_property
    def _later_ns(self) -> int:
        """How much later than modelled sensors know of passes: in sound."""
        kinds = (make_sensor(**given) for given in self.plan.tracking["sensing"].values())
        return LATER_NS if any(kind.hearing for kind in kinds) else 0

    def _fixed(self, event: Event) -> Fixed:
        """The head takes the last report at the deadline of its step, and solves when the event is over."""
        plan, schedule = self.plan, self.schedule
        group = next((group for group in schedule.clusters if event.head in group), ())
        step_ns, deadline_ns = plan.step_ns, round(plan.deadline_s * NS)
        last_ns = event.last_ns + self._later_ns
        if schedule.loudest:
            head_ns = last_ns + schedule.close_ns + schedule.gather_ns
        else:
            waits = 0 if len(self.hops(event)) == len(group) else ceil(schedule.close_ns / step_ns)
            steps = ceil((last_ns - plan.origin_ns) / step_ns) + waits
            head_ns = plan.origin_ns + steps * step_ns + deadline_ns
        hops = self.reached.hops(event.head).get(schedule.base)
        return Fixed(event, head_ns, None if hops is None else head_ns + round(hops * self.hop_s * NS))


def _narrowed(plan: Plan, clocks: Mapping[str, Clock]) -> Iterator[Flow]:
    """Of the links by which clocks may be set those that will be used; all others as they are."""
    for flow in plan.flows:
        sets = flow.medium == FIELD and kind_of(flow.message).name in SYNCS
        used = asking(flow, clocks) if sets else flow
        if used is not None:
            yield used
