"""Messages that went over several hops, each as one from its origin to its end, and how long they took."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from launcher.records import MessageRow
from trackfield.protocols.collection.links import text_of
from trackfield.wire.codec import decoded, kind_name
from trackfield.wire.interests import Data
from trackfield.wire.messages import Hop
from trackfield.wire.outside import Carried as Parcel

USED: Final = ("delivered", "late")
"""The outcomes of a message that came to its end for the first time."""
CARRIERS: Final = ("hop", "data", "carried")
"""The kinds of message that carry another one: over a tree to a base, to the sink of an interest, over a backbone."""
COUNTED: Final = ("hop", "carried")
"""Those whose hops are counted: data goes to many sinks."""
REPORTS: Final = ("doa", "measurement", "range", "rss", "energy", "cpa-report", "cpa-report-sds")
"""The kinds of message that carry what a sensor measured."""


class _Carried(NamedTuple):
    """A frame that carries the ``number``-th ``message`` of ``origin`` to one of ``ends``, after so many ``hops``."""

    row: MessageRow
    origin: str
    number: int
    hops: int
    message: bytes
    ends: frozenset[str]


def hop_latencies(bases: Iterable[str], rows: Sequence[MessageRow]) -> dict[str, dict[str, Any]]:
    """Of those that came to a base over a tree, or to their end over a backbone, by number of hops: how many (``n``),
    their ``p50`` and ``p95`` in ms.

    From the first transmission by the origin to the arrival there.
    """
    took: dict[int, list[int]] = defaultdict(list)
    for hops, row in _journeys(bases, (row for row in rows if row.kind in COUNTED)):
        if row.outcome in USED and row.due_ns is not None:
            took[hops].append(row.due_ns - row.sent_ns)
    return {str(hops): {"n": len(ns), **_quantiles(ns)} for hops, ns in sorted(took.items())}


def _quantiles(ns: Sequence[int]) -> dict[str, float]:
    p50, p95 = np.quantile(np.array(ns) / 1e6, [0.5, 0.95]).tolist()
    return {"p50": p50, "p95": p95}


def end_to_end(bases: Iterable[str], rows: Iterable[MessageRow]) -> list[MessageRow]:
    """The messages that went to one of these bases, to a sink, or over a backbone, as if each had gone there directly.

    Of one that never came, the outcome is what became of its last frame; if that was not lost, ``in_flight``.
    """
    return [row for _, row in _journeys(bases, rows)]


def reports_end_to_end(bases: Iterable[str], rows: Iterable[MessageRow]) -> list[MessageRow]:
    """Of these, the reports of sensors."""
    return [row for row in end_to_end(bases, rows) if row.kind in REPORTS]


def _journeys(bases: Iterable[str], rows: Iterable[MessageRow]) -> Iterator[tuple[int, MessageRow]]:
    """(hops, the message from its origin to its end) of each message that was sent over several hops, or might be."""
    found: dict[tuple[str, str, int, frozenset[str]], list[_Carried]] = {}
    for one in _carried(frozenset(bases), rows):
        found.setdefault((one.row.kind, one.origin, one.number, one.ends), []).append(one)
    for frames in found.values():
        first = frames[0]
        inner = decoded(first.message)
        if first.hops or inner is None or first.origin != first.row.src:
            continue
        last = next((one for one in frames if one.row.dst in one.ends and one.row.outcome in USED), frames[-1])
        end = last.row
        outcome = "in_flight" if end.dst not in last.ends and end.delivered else end.outcome
        sent = replace(first.row, kind=kind_name(inner), payload=first.message, bytes=len(first.message))
        due_ns, step = end.due_ns if outcome in USED else None, getattr(inner, "step", None)
        yield last.hops + 1, replace(sent, dst=end.dst, outcome=outcome, due_ns=due_ns, step=step)


def _carried(bases: frozenset[str], rows: Iterable[MessageRow]) -> Iterator[_Carried]:
    """In the order in which they were sent, those that carry anything."""
    for row in sorted((row for row in rows if row.kind in CARRIERS), key=lambda row: row.sent_ns):
        match decoded(row.payload):
            case Hop(to=b"") as hop if hop.message:
                yield _Carried(row, text_of(hop.origin), hop.number, hop.hops, hop.message, bases)
            case Data() as data if data.message:
                sink = frozenset({text_of(data.sink)})
                yield _Carried(row, text_of(data.origin), data.serial, data.hops, data.message, sink)
            case Parcel() as parcel:
                end = frozenset({text_of(parcel.destination)})
                yield _Carried(row, text_of(parcel.origin), parcel.number, parcel.hops, parcel.message, end)
