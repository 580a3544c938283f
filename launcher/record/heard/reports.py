"""The reports of events, as the frames of a run tell them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from launcher.heard import Report
from launcher.record.figures.hops import CARRIERS, end_to_end
from launcher.records import SENSES, MessageRow, Plan
from trackfield.role import NS
from trackfield.wire.codec import decoded
from trackfield.wire.passes import CpaReport, CpaReportSds, FixReport
from trackfield.wire.raw import unpack

KINDS = frozenset({*CARRIERS, "fix", "cpa-report", "cpa-report-sds"})
"""The kinds of message that carry reports, or fixes."""


class Told(NamedTuple):
    """What frames say: the reports in each fix, by its head and step; and those that came to each process."""

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
    rows = [row for row in frames if row.kind in KINDS]
    for row in (*rows, *end_to_end(plan.bases, rows)):
        match decoded(row.payload):
            case FixReport(step=step, raw=raw):
                found.fixes[row.src, step] = tuple(_raw(plan, ids, step, raw))
            case CpaReport() | CpaReportSds() as message if row.delivered:
                at_ns = plan.origin_ns + message.step * plan.step_ns - round(message.early_s * NS)
                found.sent[row.dst].append(Report(row.src, at_ns, message.strength_db, message.width_s))
    return found


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
