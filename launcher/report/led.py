"""Who led when in a finished run, read from its tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from launcher.files import MESSAGES_TABLE
from launcher.record.figures import terms
from launcher.record.figures.elections import Election, elections
from launcher.record.figures.leaders import reports_asked
from launcher.record.figures.passes.reigns import reigns
from launcher.record.reading import files as reading
from launcher.records import MessageRow, Passing
from launcher.report.folder import Run
from trackfield.role import NS

_POINT: Final = ("source", "incarnation", "term", "told_ns")
_LIFE: Final = ("src", "incarnation")
_COLUMNS: Final = tuple(one.name for one in fields(MessageRow))


@dataclass(frozen=True)
class Led:
    """The terms of a run in their order, hand-overs that were lost, and how long each leader published in its term.

    ``until_ns`` is by (number, leader), and so is ``over``, when it said that its term is over. ``used`` and ``asked``
    are the reports of each step, and for how many its leader had asked.
    """

    turns: tuple[terms.Turn, ...] = ()
    lost: tuple[terms.Lost, ...] = ()
    until_ns: Mapping[terms.Key, int] | None = None
    used: Mapping[int, int] | None = None
    asked: Mapping[int, int] | None = None
    elections: tuple[Election, ...] = ()
    over: Mapping[terms.Key, int] | None = None


def read_led(run: Run) -> Led:
    """As metrics.json counts it; empty where nobody takes turns."""
    view = run.field.views[0]
    own = run.points.filter(pc.is_in(run.points["source"], pa.array(view.sources, pa.string())))
    own = own.filter(pc.equal(own["origin"], ""))
    if isinstance(run.field.schedule, Passing):
        return _of_passes(run, own, run.field.schedule)
    own = own.filter(pc.greater(own["term"], 0))
    if not own.num_rows:
        return Led()
    points = [terms.Point(*row) for row in zip(*(own[name].to_pylist() for name in _POINT), strict=True)]
    table = reading.read_table(run.folder, MESSAGES_TABLE, _COLUMNS)
    table = table.filter(pc.is_in(table["kind"], pa.array(sorted(terms.KINDS))))
    frames = [MessageRow(**row) for row in table.to_pylist()]
    found = terms.seen(frames, points)
    _live(found, run)
    until_ns = dict[terms.Key, int]()
    for point in points:
        key = point.term, point.source
        until_ns[key] = max(until_ns.get(key, 0), point.told_ns)
    used, leaders = _used(run)
    asked = reports_asked(frames, leaders, run.site.origin_ns, run.site.step_ns)
    lost = tuple(terms.lost_hand_overs(found))
    votes = elections(found, run.site.step_ns)
    return Led(tuple(terms.turns(found)), lost, until_ns, used, asked, tuple(votes), found.over)


def _of_passes(run: Run, own: pa.Table, schedule: Passing) -> Led:
    """Who led clusters that hear passes."""
    points = [terms.Point(*row) for row in zip(*(own[name].to_pylist() for name in _POINT), strict=True)]
    found = terms.seen((), points)
    _live(found, run)
    ruled = reigns(points, schedule.clusters, found.last)
    until_ns = {(reign.turn.number, reign.turn.leader): reign.until_ns for reign in ruled}
    return Led(tuple(reign.turn for reign in ruled), until_ns=until_ns, used=_used(run)[0])


def _live(found: terms.Seen, run: Run) -> None:
    """All frames of a run are signs of life."""
    lives = run.frames.table.group_by(list(_LIFE)).aggregate([("sent_ns", "max")])
    for src, incarnation, sent_ns in zip(*(lives[name].to_pylist() for name in (*_LIFE, "sent_ns_max")), strict=True):
        found.lives(src, incarnation, sent_ns)


def _used(run: Run) -> tuple[dict[int, int], dict[int, str]]:
    """By step, how many reports the first tracker used, and who led."""
    first = run.points.filter(pc.equal(run.points["tracker"], run.trackers[0]))
    first = first.filter(pc.and_(pc.equal(first["lag"], 0), pc.is_valid(first["step"])))
    first = first.filter(pc.is_in(first["source"], pa.array(run.field.views[0].sources, pa.string())))
    first = first.sort_by([("step", "ascending"), ("term", "ascending"), ("told_ns", "descending")])
    rows = list(zip(*(first[name].to_pylist() for name in ("step", "reports", "source")), strict=True))
    return {step: reports for step, reports, _ in rows}, {step: source for step, _, source in rows}


def seconds(run: Run, t_ns: int) -> float:
    """Emulated time as seconds since the first step."""
    return float(np.float64(t_ns - run.site.origin_ns) / NS)
