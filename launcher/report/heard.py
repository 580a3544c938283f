"""What a finished run in which sensors report passes heard: its events, beside the truth, read from its tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self

import pyarrow as pa
import pyarrow.compute as pc

from launcher.files import MESSAGES_TABLE, TRACKS_TABLE
from launcher.heard import Event, Outcome, Sound
from launcher.plan.prepare import planned
from launcher.record.figures.passes.ended import ended
from launcher.record.figures.passes.found import Fix, Truth
from launcher.record.figures.passes.metrics import base_of
from launcher.record.heard.events import events_of_run
from launcher.record.heard.reports import KINDS
from launcher.record.heard.sounds import loudest_and_weakest, sounds
from launcher.record.reading import files as reading
from launcher.record.tables import STATE, TrackRow
from launcher.records import MessageRow, Plan
from trackfield.role import TrackPoint
from trackfield.scenario import Scenario

_POINT: Final = ("tracker", "target", "at_ns", "status", "source", "step", "term", "lag", "origin")
_COLUMNS: Final = (*_POINT, *STATE, "covariance", "sensors", "told_ns", "incarnation", "event_ns", "refused")
_FRAME: Final = tuple(one.name for one in fields(MessageRow))
Of = tuple[str, str, int]
"""Whose outcome it is: head, tracker, instant (ns)."""


@dataclass(frozen=True)
class Heard:
    """The ``events`` of a run, and its ``fixes`` beside the truth; none where sensors report no passes."""

    plan: Plan | None
    events: tuple[Event, ...]
    fixes: Mapping[Of, Fix]

    @classmethod
    def of(cls, folder: Path, scenario: Scenario) -> Self:
        """Of the run of a scenario whose sensors report passes, from its folder."""
        plan = planned(scenario)
        points = [_row(row) for row in reading.read_table(folder, TRACKS_TABLE, _COLUMNS).to_pylist()]
        frames = reading.read_table(folder, MESSAGES_TABLE, _FRAME)
        frames = frames.filter(pc.is_in(frames["kind"].cast(pa.string()), pa.array(sorted(KINDS))))
        events = events_of_run(plan, points, [MessageRow(**row) for row in frames.to_pylist()])
        truth, base = Truth(plan), base_of(plan)
        told = [row for row in points if row.point.source == base]
        ends = [one for one in ended(points, base) if not one.refused]
        fixes = {(one.row.point.source, one.row.point.tracker, one.row.t_ns): truth.fix(one, told) for one in ends}
        return cls(plan, tuple(events), fixes)

    def fix(self, event: Event, outcome: Outcome) -> Fix | None:
        """A fix beside the truth; None if the event ended without one."""
        return self.fixes.get((event.head, outcome.tracker, outcome.at_ns))

    @cached_property
    def loudest(self) -> Event | None:
        """Of the events with the most reports the first, whose sounds are played; None without any report."""
        return max((one for one in self.events if one.reports), key=lambda one: len(one.reports), default=None)

    @cached_property
    def sounds(self) -> tuple[Sound, ...]:
        """What the loudest and the weakest of its sensors heard, if sensors listen."""
        if self.plan is None or self.loudest is None:
            return ()
        which = loudest_and_weakest(self.loudest)
        found = {sound.sensor: sound for sound in sounds(self.plan, self.loudest, which)}
        return tuple(found[id] for id in which if id in found)


def _row(row: dict[str, Any]) -> TrackRow:
    """A row of tracks.parquet as what it was written from, without the truth."""
    mean = tuple(row[name] for name in STATE) if row["x"] is not None else ()
    point = TrackPoint(
        **{name: row[name] for name in _POINT},
        mean=mean,
        covariance=tuple(row["covariance"] or ()),
        sensors=tuple(row["sensors"]),
        event_ns=row["event_ns"],
        refused=row["refused"],
    )
    return TrackRow(row["told_ns"], point, incarnation=row["incarnation"])
