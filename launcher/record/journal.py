"""What a run leaves behind while it goes on and when it ends: timeline, tables, metrics."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import islice
from math import hypot
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Final

from launcher.record.bounds import run_bound
from launcher.record.diary import Event
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics
from launcher.record.tables import nearest, track_rows, write_messages, write_tracks
from launcher.record.views import headline
from launcher.records import MessageRow, Plan
from trackfield.drivers.frames import Charge, Died, Queued
from trackfield.role import NS, Note, Publish, State

if TYPE_CHECKING:
    from launcher.timeline.timeline import Timeline

TIMELINE: Final = "run.rrd"
METRICS: Final = "metrics.json"

Unplanned = tuple[str, float | None, str]
"""An unplanned death: the process, when (s since the first step; None: unknown), and why."""


class Telling:
    """Hands on what the ledger has settled to a timeline."""

    def __init__(self, plan: Plan, ledger: Ledger, timeline: Timeline) -> None:
        self.plan, self.ledger, self.timeline = plan, ledger, timeline
        self.states: dict[str, str] = {}
        self.errors: dict[str, float | None] = {}
        self.outcomes: dict[str, int] = {}
        self._errors_told = 0

    def settle(self, until_ns: int) -> None:
        """Write what is settled up to this true time."""
        self._write(*self.ledger.settle(until_ns))
        self.timeline.flush()

    def take_over(self, rows: Sequence[MessageRow]) -> None:
        """Take over the outcome of each frame from an earlier run."""
        self.ledger.rows += rows
        self._write(rows, [])

    def end(self, deaths: Sequence[Unplanned] = ()) -> None:
        """Write the rest of it; the timeline is still to be closed."""
        self._write(*self.ledger.close(name for name, *_ in deaths))
        for name, t_s, why in deaths:
            if t_s is not None:
                self.timeline.death(self.plan.origin_ns + round(t_s * NS), name.partition("~")[0], why)

    def _write(self, rows: Sequence[MessageRow], events: Sequence[Event]) -> None:
        for row in rows:
            self.outcomes[row.outcome] = self.outcomes.get(row.outcome, 0) + 1
            if row.sent_ns < self.plan.run.end_ns:  # a foreign sender may put any time on its frames
                self.timeline.message(row)
        for event in events:
            self._tell(event)
        for (t_ns, process), error_ns in islice(self.ledger.clock_errors.items(), self._errors_told, None):
            self.timeline.clock_error(t_ns, process, error_ns / 1e6)
        self._errors_told = len(self.ledger.clock_errors)

    def _tell(self, event: Event) -> None:
        match event.effect:
            case State(name, lane):
                self.states[event.process] = name
                self.timeline.state(event.t_ns, event.process, name, lane)
            case Charge(share):
                self.timeline.battery(event.t_ns, event.process, share)
            case Died(why):
                self.states[event.process] = "dead"
                self.timeline.death(event.t_ns, event.process, why)
            case Queued(_, sent_ns, waited_ns, ahead):
                self.timeline.queue(sent_ns - waited_ns, event.process, ahead)
            case Note(text):
                self.timeline.note(event.t_ns, event.process, text)
            case Publish(point):
                truth, _ = nearest(self.plan.paths, point)
                late_ns = event.t_ns - point.at_ns - round(self.plan.deadline_s * NS)
                self.timeline.estimate(point, truth[:2] if truth else None, late_ns)
                error = hypot(point.mean[0] - truth[0], point.mean[1] - truth[1]) if truth and point.mean else None
                self.errors[point.tracker] = error


class Journal(Telling):
    """Writes the timeline of a run into its folder, and at the end tables and metrics."""

    def __init__(self, plan: Plan, ledger: Ledger, folder: FilePath) -> None:
        from launcher.timeline.timeline import Timeline  # loads Rerun

        super().__init__(plan, ledger, Timeline(folder / TIMELINE, plan.info))
        self.folder = folder

    def close(self, deaths: Sequence[Unplanned], *, messages: int) -> Metrics:
        """Write the rest, and the tables; returns the metrics that are known here."""
        self.end(deaths)
        tracks = track_rows(self.ledger.estimates(), self.plan.paths)
        bound = run_bound(self.plan, headline(self.plan, tracks))
        for t_ns in sorted({row.t_ns for row in tracks} & bound.keys()):
            self.timeline.bound(t_ns, bound[t_ns])
        self.timeline.close()
        write_messages(self.ledger.rows, self.folder / "messages.parquet")
        write_tracks(tracks, bound, self.folder / "tracks.parquet", self.plan.origin_ns)
        metrics = run_metrics(self.plan, self.ledger, tracks, bound)
        metrics["recorder"]["messages"] = messages
        return metrics


def summary(journal: Journal) -> dict[str, Any]:
    """What the live table shows: counts so far, states now, the latest error of each tracker (m)."""
    states: dict[str, int] = {}
    for name in journal.states.values():
        states[name] = states.get(name, 0) + 1
    return {
        "sent": sum(journal.ledger.sent_kinds.values()),
        "outcomes": dict(journal.outcomes),
        "states": states,
        "errors": dict(journal.errors),
    }


def write_json(value: object, file: FilePath) -> None:
    """Write JSON that is easy to read."""
    file.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n")
