"""The share of the messages between a plan's processes that the radio delivers."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from launcher.records import Flow, Plan
from trackfield.drivers.spec import places_of
from trackfield.link.models import make_link
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

INSTANTS: Final = 50
"""The number of instants of a run at which links are evaluated, if any process moves."""

Shares = dict[tuple[str, str], float]
"""By sender and receiver."""


def receptions(plan: Plan, ends: Collection[str] | None = None) -> dict[str, Shares]:
    """The share of its messages that each link in use is expected to deliver, by kind of message, reports first.

    If any process moves, it is the mean over the run. ``ends`` are the places whose links are asked for; None: all.
    """
    return {kind_of(flow.message).name: _shares(plan, flow, ends) for flow in plan.flows}


def _shares(plan: Plan, flow: Flow, ends: Collection[str] | None) -> Shares:
    link = make_link(plan.run.link, plan.run.seed, places_of(plan.processes))
    kind, size = kind_of(flow.message).name, len(encode(flow.message))
    moving = any(p.legs for p in plan.processes)
    times = [plan.run.end_ns * k // INSTANTS for k in range(INSTANTS)] if moving else [0]
    return {
        (src, dst): sum(link.reception(src, dst, size, kind, at) for at in times) / len(times)
        for src, dst in flow.pairs
        if ends is None or src in ends or dst in ends
    }
