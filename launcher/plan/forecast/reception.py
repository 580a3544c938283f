"""The share of the messages between a plan's processes that the radio delivers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from launcher.plan.forecast.tree import Tree
from launcher.records import SENSES, Flow, Plan
from trackfield.drivers.spec import link_of
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

INSTANTS: Final = 50
"""The number of instants of a run at which links are evaluated, of links that change over time."""

Shares = dict[tuple[str, str], float]
"""By sender and receiver."""


def receptions(plan: Plan, when: Mapping[str, Sequence[int]] | None = None) -> dict[str, Shares]:
    """The share of its messages that each link in use is expected to deliver, by kind of message, reports first.

    Of links that change over time, the mean; what goes over a tree, by its best way at the start. ``when`` are the
    instants (ns) that count for the links of each of its processes, and other links are left out; None: all links, over
    the run.
    """
    return _by_kind(plan, (flow for flow in plan.flows if not flow.near), when)


def hops(plan: Plan) -> dict[str, Shares]:
    """The same of the links between processes without sensors, over the run, by kind of message."""
    sensors = {place.id for place in plan.info.tagged(SENSES)}
    between = (
        replace(flow, pairs=tuple(pair for pair in flow.pairs if sensors.isdisjoint(pair)))
        for flow in plan.flows
        if not flow.near
    )
    return _by_kind(plan, (flow for flow in between if flow.pairs), None)


def _by_kind(plan: Plan, flows: Iterable[Flow], when: Mapping[str, Sequence[int]] | None) -> dict[str, Shares]:
    """What these deliver, by kind of message: some kinds go over several media."""
    found: dict[str, Shares] = {}
    for flow in flows:
        found.setdefault(kind_of(flow.message).name, {}).update(shares_of(plan, flow, when))
    return found


def varies(plan: Plan) -> bool:
    """Whether links change during the run: a process moves, or a trace is replayed."""
    return _replayed(plan) or any(p.legs for p in plan.processes)


def _replayed(plan: Plan) -> bool:
    return any(link["model"] == "trace" for link in [plan.run.link, *plan.run.media.values()])


def shares_of(plan: Plan, flow: Flow, when: Mapping[str, Sequence[int]] | None) -> Shares:
    """The share of its messages that each link of a flow is expected to deliver; see ``receptions``."""
    if flow.over_tree and (tree := Tree.of(plan)) is not None:
        concerned = (pair for pair in flow.pairs if when is None or when.get(pair[0]) or when.get(pair[1]))
        return {pair: tree.share(*pair) for pair in concerned}
    link = link_of(plan.run, plan.processes, cut=False)
    kind, size = kind_of(flow.message).name, len(encode(flow.message))
    replayed, moving = _replayed(plan), {process.id for process in plan.processes if process.legs}
    always = [plan.run.end_ns * k // INSTANTS for k in range(INSTANTS)]
    shares: Shares = {}
    for src, dst in flow.pairs:
        times = always if when is None else when.get(src, when.get(dst, ()))
        changes = replayed or src in moving or dst in moving
        some = times[:: -(-len(times) // INSTANTS) or 1] if changes else times[:1]
        if some:
            shares[src, dst] = sum(link.reception(src, dst, size, kind, at, flow.medium) for at in some) / len(some)
    return shares
