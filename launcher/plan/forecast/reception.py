"""The share of the messages between a plan's processes that the radio delivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from launcher.records import SENSES, Flow, Plan
from trackfield.drivers.spec import places_of
from trackfield.link.models import make_link
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

INSTANTS: Final = 50
"""The number of instants of a run at which links are evaluated, of links that change over time."""

Shares = dict[tuple[str, str], float]
"""By sender and receiver."""


def receptions(plan: Plan, when: Mapping[str, Sequence[int]] | None = None) -> dict[str, Shares]:
    """The share of its messages that each link in use is expected to deliver, by kind of message, reports first.

    Of links that change over time, the mean. ``when`` are the instants (ns) that count for the links of each of its
    processes, and other links are left out; None: all links, over the run.
    """
    return {kind_of(flow.message).name: _shares(plan, flow, when) for flow in plan.flows}


def hops(plan: Plan) -> dict[str, Shares]:
    """The same of the links between processes without sensors, over the run, by kind of message."""
    sensors = {place.id for place in plan.info.tagged(SENSES)}
    between = ((flow, tuple(pair for pair in flow.pairs if sensors.isdisjoint(pair))) for flow in plan.flows)
    return {
        kind_of(flow.message).name: _shares(plan, Flow(flow.message, pairs), None) for flow, pairs in between if pairs
    }


def varies(plan: Plan) -> bool:
    """Whether links change during the run: a process moves, or a trace is replayed."""
    return plan.run.link["model"] == "trace" or any(p.legs for p in plan.processes)


def _shares(plan: Plan, flow: Flow, when: Mapping[str, Sequence[int]] | None) -> Shares:
    link = make_link(plan.run.link, plan.run.seed, places_of(plan.processes))
    kind, size = kind_of(flow.message).name, len(encode(flow.message))
    changing = varies(plan)  # looks at every process
    always = [plan.run.end_ns * k // INSTANTS for k in range(INSTANTS)] if changing else [0]
    shares: Shares = {}
    for src, dst in flow.pairs:
        times = always if when is None else when.get(src, when.get(dst, ()))
        some = times[:: -(-len(times) // INSTANTS) or 1] if changing else times[:1]
        if some:
            shares[src, dst] = sum(link.reception(src, dst, size, kind, at) for at in some) / len(some)
    return shares
