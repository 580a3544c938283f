"""How sensors report, and reports that are sent on trial: how long they take, on air and in all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import dist
from typing import Final

import numpy as np

from launcher.plan.forecast.heard import Array, Heard, Indices
from launcher.plan.forecast.tree import Tree
from launcher.records import Plan
from trackfield.drivers.spec import link_of
from trackfield.link.fate import Link, Transmission
from trackfield.role import NS
from trackfield.wire.codec import encode
from trackfield.wire.keys import Medium
from trackfield.wire.registry import kind_of

LOST: Final = float("nan")


@dataclass(frozen=True)
class Way:
    """How a sensor reports: to whom (of several the nearest), in messages of which kind and of how many bytes.

    ``tree`` is the one over which they go, if they do, ``medium`` their medium.
    """

    to: str
    kind: str
    size: int
    tree: Tree | None = None
    medium: Medium = "field"


@dataclass(frozen=True)
class Trial:
    """Frames sent on trial, one a row: ``delay_s`` (n,) until they arrive, NaN for those that are lost.

    ``air_s`` (n,) is how long they are on air with repeats, ``ack_s`` (n,) their acknowledgements, ``busy_s`` (n,) how
    long the sender's radio is taken; all of them are 0 for a link without a radio.
    """

    delay_s: Array
    air_s: Array
    ack_s: Array
    busy_s: Array

    def in_time(self, left_s: Array) -> Array:
        """(n,) the shares of the frames that arrive that take no longer than ``left_s`` (n,); 1 if none arrives."""
        arrived = np.sort(self.delay_s[np.isfinite(self.delay_s)])
        return np.searchsorted(arrived, left_s, side="right") / len(arrived) if len(arrived) else np.ones(len(left_s))


def ways_of(plan: Plan) -> dict[str, Way]:
    """How each sensor reports, by its id."""
    at = {place.id: (place.x, place.y) for place in plan.info.places}
    found: dict[str, Way] = {}
    tree = Tree.of(plan)
    for flow in plan.reports:
        over = tree if flow.over_tree else None
        kind, size = kind_of(flow.message).name, len(encode(flow.message))
        for src, dst in flow.pairs:
            if src not in found or dist(at[src], at[dst]) < dist(at[src], at[found[src].to]):
                found[src] = Way(dst, kind, size, over, flow.medium)
    return found


def sent_on_trial(plan: Plan, ids: list[str], heard: Heard, some: Indices, ways: Mapping[str, Way]) -> Trial:
    """The reports of ``some`` rows, as the link would treat them."""
    if not len(some):
        return Trial(*np.empty((4, 0)))
    link = link_of(plan.run, plan.processes, cut=False)
    sent = zip([ids[i] for i in heard.sensor[some].tolist()], heard.t_ns[some].tolist(), strict=True)
    return Trial(*(np.array([_sent(link, id, ways[id], t_ns) for id, t_ns in sent], np.float64).T / NS))


def _sent(link: Link, id: str, way: Way, t_ns: int) -> tuple[float, int, int, int]:
    """A row of a ``Trial``, in ns."""
    if way.tree is not None:
        trip = way.tree.trip(id, way.to, t_ns)
        return LOST if trip.delay_ns is None else trip.delay_ns, trip.air_ns, trip.ack_ns, trip.busy_ns
    fate = link.fate(Transmission(id, way.to, way.kind, t_ns, 0, way.size, medium=way.medium))
    return LOST if fate.cause is not None else fate.delay_ns, fate.air_ns, fate.ack_air_ns, fate.busy_ns
