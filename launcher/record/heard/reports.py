"""The reports of events, as the frames of a run tell them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from launcher.heard import Report
from launcher.records import SENSES, MessageRow, Plan
from trackfield.role import NS
from trackfield.wire.codec import decoded
from trackfield.wire.interests import Data
from trackfield.wire.passes import CpaReport, CpaReportSds, FixReport
from trackfield.wire.raw import unpack

KINDS = frozenset({"data", "fix", "cpa-report", "cpa-report-sds"})
"""The kinds of message that carry reports, or fixes."""


class Told(NamedTuple):
    """What frames say: the reports in each fix, by its head and step; and those that were sent to each process."""

    fixes: dict[tuple[str, int], tuple[Report, ...]]
    sent: dict[str, list[Report]]

    def of(self, head: str, step: int, sensors: Iterable[str], event_ns: int, apart_ns: int) -> tuple[Report, ...]:
        """The reports of an event that ended at a head: those in its fix, or else those that came from its sensors."""
        if found := self.fixes.get((head, step)):
            return found
        known = set(sensors)
        near = [one for one in self.sent.get(head, ()) if one.sensor in known and abs(one.at_ns - event_ns) <= apart_ns]
        return tuple(sorted(set(near), key=lambda one: one.at_ns))


def told(plan: Plan, frames: Iterable[MessageRow]) -> Told:
    """What the frames of a run say of passes, each once."""
    found = Told({}, defaultdict(list))
    ids = [place.id for place in plan.info.tagged(SENSES)]
    for src, dst, message in _messages(frames):
        match message:
            case FixReport(step=step, raw=raw):
                found.fixes[src, step] = tuple(_raw(plan, ids, step, raw))
            case CpaReport() | CpaReportSds():
                at_ns = plan.origin_ns + message.step * plan.step_ns - round(message.early_s * NS)
                found.sent[dst].append(Report(src, at_ns, message.strength_db, message.width_s))
    return found


def _messages(frames: Iterable[MessageRow]) -> Iterator[tuple[str, str, Any]]:
    """(origin, for whom, message) of each; of what goes over several hops, whoever it is for."""
    seen = set[tuple[str, bytes]]()
    for row in frames:
        if row.kind not in KINDS or (row.dst, row.payload) in seen:
            continue
        seen.add((row.dst, row.payload))
        message = decoded(row.payload)
        if isinstance(message, Data):
            yield _text(message.origin), _text(message.sink), decoded(message.message)
        elif row.delivered:
            yield row.src, row.dst, message


def _raw(plan: Plan, ids: list[str], step: int, data: bytes) -> Iterator[Report]:
    """The reports in a fix, in the order of their times."""
    at_ns = plan.origin_ns + step * plan.step_ns
    try:
        rows = unpack(data)
    except ValueError:
        return
    for one in sorted(rows, key=lambda one: -one.early_s):
        if one.number < len(ids):
            yield Report(ids[one.number], at_ns - round(one.early_s * NS), one.strength_db, one.width_s)


def _text(id: bytes) -> str:
    return id.decode("ascii", "replace")
