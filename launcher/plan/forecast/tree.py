"""What a collection tree delivers: each message by the way of fewest expected transmissions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

from launcher.plan.forecast.ways import Pair, next_of
from launcher.records import Plan
from trackfield.drivers.spec import link_of
from trackfield.link.fate import FIELD, Link, Transmission
from trackfield.protocols.collection.links import LEAST
from trackfield.protocols.collection.traffic import MOST_TRIES
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

HOP, ACK = "hop", "hop-ack"
TURN: Final = 1.25
"""How long a process waits for an acknowledgement on average, in units of its patience."""


@dataclass(frozen=True)
class Trip:
    """A message sent on trial: ``delay_ns`` until it arrives, None if it is lost; the time on air of all its frames,
    of their acknowledgements, and for how long the radio of its origin is taken.
    """

    delay_ns: int | None
    air_ns: int
    ack_ns: int
    busy_ns: int


@dataclass(frozen=True)
class Tree:
    """The tree of a plan: the ``parents`` of all processes that have a way to the base, and their shares there.

    ``tries`` are the shares of single frames that arrive, by sender and receiver. Where places change, all is as at the
    start.
    """

    link: Link
    sizes: Mapping[str, int]
    patience_ns: int
    parents: Mapping[str, str]
    tries: Mapping[Pair, float]

    @classmethod
    def of(cls, plan: Plan) -> Self | None:
        """The tree of a plan; None if it has none."""
        trees = {process.id: process.tree for process in plan.processes if process.tree}
        base = next((id for id, tree in trees.items() if tree["base"] == id), None)
        if base is None:
            return None
        flows = {kind_of(flow.message).name: flow for flow in plan.flows if flow.near and flow.medium == FIELD}
        link = link_of(plan.run, plan.processes, cut=False)
        sizes = {kind: len(encode(flows[kind].message)) for kind in (HOP, ACK) if kind in flows}
        pairs = flows[HOP].pairs if HOP in flows else ()  # nobody is in reach of anybody
        tries = {pair: link.reception(*pair, sizes[HOP], HOP) for pair in pairs}
        acks = {pair: link.reception(*pair, sizes[ACK], ACK) for pair in pairs}
        success = {(a, b): share * acks.get((b, a), 0.0) for (a, b), share in tries.items()}
        parents = next_of({pair: 1 / share for pair, share in success.items() if share >= LEAST}, [base])
        return cls(link, sizes, trees[base]["patience_ns"], parents, tries)

    def way(self, src: str, dst: str) -> list[Pair]:
        """The hops of a message to or from the base; none if there is no way."""
        there = self._up(src)
        if there and there[-1][1] == dst:
            return there
        back = self._up(dst)
        return [(b, a) for a, b in reversed(back)] if back and back[-1][1] == src else []

    def share(self, src: str, dst: str) -> float:
        """The share of messages that arrive at the end, if none of their parents is replaced by another."""
        way, share = self.way(src, dst), 1.0
        for hop in way:
            share *= 1 - (1 - self.tries.get(hop, 0.0)) ** MOST_TRIES
        return share if way else 0.0

    def trip(self, src: str, dst: str, t_ns: int) -> Trip:
        """A message sent then, hop by hop."""
        way, now, air, acks, busy = self.way(src, dst), t_ns, 0, 0, 0
        arrived = bool(way)
        for number, (a, b) in enumerate(way):
            arrived = False
            for attempt in range(MOST_TRIES):
                fate = self.link.fate(Transmission(a, b, HOP, now, attempt, self.sizes[HOP]))
                air, busy = air + fate.air_ns, busy + (fate.busy_ns if number == 0 else 0)
                if fate.cause is None:
                    arrived, now = True, now + fate.delay_ns
                    acks += self.link.fate(Transmission(b, a, ACK, now, 0, self.sizes[ACK])).air_ns
                    break
                now += round(TURN * self.patience_ns)
            if not arrived:
                break
        return Trip(now - t_ns if arrived else None, air, acks, busy)

    def _up(self, id: str) -> list[Pair]:
        hops = list[Pair]()
        while (parent := self.parents.get(id)) is not None:
            hops.append((id, parent))
            id = parent
        return hops
