"""Processes that answer each other: whether their messages are faster in the field than on the machine.

Each then handles events before it knows of all messages that come first, and goes back, again and again. Where messages
only go on, from sensors to those who track and further, this ends with the last one. Where they go round it need not.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Final, NamedTuple

from launcher.records import Flow, Plan
from trackfield.drivers.spec import link_of
from trackfield.link.fate import Transmission
from trackfield.role import NS
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

HOST_S: Final = 0.008
"""What 99 of 100 frames do not exceed from their put to their hearer, on a machine with other things to do
(``python -m bench.latency``)."""
STEADY: Final = frozenset({"sync-request", "sync-reply", "threshold", "no-target"})
"""Messages that are no answers in this sense: they leave at instants that do not depend on when others come."""
TRIALS: Final = 200
"""Frames that are sent on trial, at most, of each kind."""

Pairs = frozenset[tuple[str, str]]


class Answers(NamedTuple):
    """The ``kinds`` of messages that go round among processes on a medium, and how long (s, emulated) one takes."""

    kinds: tuple[str, ...]
    delay_s: float


def answers(plan: Plan) -> Answers | None:
    """Those of a plan, on the medium where they take the shortest time, as each medium has delays of its own.

    None if nobody answers an answer, or nothing of it arrives.
    """
    flows = [flow for flow in plan.flows if not flow.reports and kind_of(flow.message).name not in STEADY]
    circles = _circles(frozenset(pair for flow in flows for pair in flow.pairs))
    by_medium = defaultdict[str, list[Flow]](list)
    for flow in flows:
        if not circles.isdisjoint(flow.pairs):
            by_medium[flow.medium].append(flow)
    found = [one for round_ in by_medium.values() if (one := _among(plan, round_, circles))]
    return min(found, key=lambda one: one.delay_s, default=None)


def _among(plan: Plan, flows: Sequence[Flow], circles: Pairs) -> Answers | None:
    """Those on one medium."""
    delays = [delay for flow in flows for delay in _delays(plan, flow, circles)]
    kinds = dict.fromkeys(kind_of(flow.message).name for flow in flows)
    return Answers(tuple(kinds), median(delays) / NS) if delays else None


def _circles(pairs: Pairs) -> Pairs:
    """Without the pairs of whom one only speaks or only hears, as long as there are such."""
    while True:
        senders, hearers = {src for src, _ in pairs}, {dst for _, dst in pairs}
        kept = frozenset((src, dst) for src, dst in pairs if src in hearers and dst in senders)
        if len(kept) == len(pairs):
            return pairs
        pairs = kept


def _delays(plan: Plan, flow: Flow, circles: Pairs) -> Iterator[int]:
    """How long (ns) some of these messages take."""
    link = link_of(plan.run, plan.processes, cut=False)
    kind, size = kind_of(flow.message).name, len(encode(flow.message))
    pairs = [pair for pair in flow.pairs if pair in circles]
    for n in range(TRIALS):
        src, dst = pairs[n % len(pairs)]
        fate = link.fate(Transmission(src, dst, kind, plan.run.end_ns * n // TRIALS, 0, size, medium=flow.medium))
        if fate.cause is None:
            yield fate.delay_ns
