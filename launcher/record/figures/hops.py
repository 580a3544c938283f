"""Messages that went over a tree, each as one from its origin to the base, and how long they took."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from launcher.records import MessageRow
from trackfield.protocols.collection.links import text_of
from trackfield.wire.codec import decoded, kind_name
from trackfield.wire.messages import Hop

USED: Final = ("delivered", "late")
"""The outcomes of a message that came to a base for the first time."""


def hop_latencies(bases: Iterable[str], rows: Sequence[MessageRow]) -> dict[str, dict[str, Any]]:
    """Of the messages that came to a base: how many (``n``), and their ``p50`` and ``p95`` in ms, by number of hops.

    From the first transmission by the origin to the arrival at the base.
    """
    took: dict[int, list[int]] = defaultdict(list)
    for hops, row in _journeys(set(bases), rows):
        if row.outcome in USED and row.due_ns is not None:
            took[hops].append(row.due_ns - row.sent_ns)
    return {str(hops): {"n": len(ns), **_quantiles(ns)} for hops, ns in sorted(took.items())}


def _quantiles(ns: Sequence[int]) -> dict[str, float]:
    p50, p95 = np.quantile(np.array(ns) / 1e6, [0.5, 0.95]).tolist()
    return {"p50": p50, "p95": p95}


def end_to_end(bases: Iterable[str], rows: Sequence[MessageRow]) -> list[MessageRow]:
    """The messages that went over a tree to one of these bases, as if each had gone there directly.

    Of one that never came, the outcome is what became of its last frame; if that was not lost, ``in_flight``.
    """
    return [row for _, row in _journeys(set(bases), rows)]


def _journeys(bases: set[str], rows: Iterable[MessageRow]) -> Iterator[tuple[int, MessageRow]]:
    """(hops, the message from its origin to the base) of each message that was sent over a tree."""
    found: dict[tuple[bytes, int], list[tuple[Hop, MessageRow]]] = {}
    for row in sorted((row for row in rows if row.kind == "hop"), key=lambda row: row.sent_ns):
        hop = decoded(row.payload)
        if isinstance(hop, Hop) and hop.message and not hop.to:
            found.setdefault((hop.origin, hop.number), []).append((hop, row))
    for frames in found.values():
        hop, first = frames[0]
        inner = decoded(hop.message)
        if hop.hops or inner is None or text_of(hop.origin) != first.src:
            continue
        last, end = next((one for one in frames if one[1].dst in bases and one[1].outcome in USED), frames[-1])
        outcome = "in_flight" if end.dst not in bases and end.delivered else end.outcome
        sent = replace(first, kind=kind_name(inner), payload=hop.message, bytes=len(hop.message))
        due_ns = end.due_ns if outcome in USED else None
        yield last.hops + 1, replace(sent, dst=end.dst, outcome=outcome, due_ns=due_ns)
