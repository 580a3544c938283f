"""What a run leaves behind while it goes on and when it ends: timeline, tables, metrics."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from errno import ENOSPC
from functools import cache, partial
from itertools import islice
from math import hypot
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Final

from launcher.files import CAMERA, MESSAGES_TABLE, TRACKS_TABLE, patiently, reason, write_whole
from launcher.heard import RANKS, Sound
from launcher.outside import Outside
from launcher.record.diary import Event
from launcher.record.figures.bounds import headline_bound, run_bounds
from launcher.record.heard.events import events_of_run
from launcher.record.heard.sounds import loudest_and_weakest, sounds
from launcher.record.heard.wav import wav
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics
from launcher.record.outside.filmed import VIDEO_FAILED, film_run
from launcher.record.outside.kept import write_camera
from launcher.record.outside.told import outside_of
from launcher.record.tables import Bounds, TrackRow, nearest, track_rows, write_messages, write_tracks
from launcher.records import TRACKS, MessageRow, Plan
from trackfield.drivers.engine.frames import Charge, Died, Queued
from trackfield.errors import RunFailed
from trackfield.role import NS, Note, Publish, State, TrackPoint, Write
from trackfield.words import plain, quoted, shortened

if TYPE_CHECKING:
    from launcher.timeline.timeline import Timeline

TIMELINE: Final = "run.rrd"
METRICS: Final = "metrics.json"
SOUNDED: Final = 12
"""Of more events what the first ones sounded like is shown."""
SHOWN: Final = 32
"""Of bytes at a port so many are shown."""
TIMELINE_FAILED: Final = "the timeline failed: "

Unplanned = tuple[str, float | None, str]
"""An unplanned death: the process, when (s since the first step; None: unknown), and why."""


class Telling:
    """Hands on what the ledger has settled to a timeline.

    ``make`` makes the timeline, when there is first something to show. ``error`` is why that failed (None: it did
    not); it is left alone from then on.
    """

    def __init__(self, plan: Plan, ledger: Ledger, make: Callable[[], Timeline]) -> None:
        self.plan, self.ledger = plan, ledger
        self.error: Exception | None = None
        self._make = cache(make)
        self.states: dict[str, str] = {}
        self.points: dict[str, TrackPoint] = {}
        self.outcomes: dict[str, int] = {}
        self._errors_told = 0
        self._tracking = frozenset(place.id for place in plan.info.tagged(TRACKS))

    def stray(self, point: TrackPoint) -> str:
        """Why a point belongs to no track of the run; empty if it does."""
        if point.tracker not in self.plan.info.trackers:
            return f"{point.source} published points of {quoted(point.tracker)}, which is no tracker of this run"
        return "" if point.source in self._tracking else f"{point.source} published points without the tag '{TRACKS}'"

    def leads(self, point: TrackPoint) -> bool:
        """Whether a point is of the first view, whose error a table shows while the run goes on."""
        return not self.stray(point) and any(point.source in view.sources for view in self.plan.views[:1])

    def settle(self, until_ns: int) -> None:
        """Write what is settled up to this true time."""
        self._write(*self.ledger.settle(until_ns))
        self.show(lambda timeline: timeline.flush())

    def take_over(self, rows: Sequence[MessageRow]) -> None:
        """Take over the outcome of each frame from an earlier run."""
        self.ledger.rows += rows
        self._write(rows, [])

    def end(self, deaths: Sequence[Unplanned] = ()) -> None:
        """Write the rest of it; the timeline is still to be closed."""
        settled = self.ledger.close(name for name, *_ in deaths)
        self._write(*settled)
        self.bury(deaths)

    def bury(self, deaths: Sequence[Unplanned]) -> None:
        """Show unplanned deaths."""
        for name, t_s, why in deaths:
            if t_s is not None:
                t_ns = self.plan.origin_ns + round(t_s * NS)
                self.show(lambda timeline: timeline.death(t_ns, name.partition("~")[0], why))  # noqa: B023  called at once

    def show(self, tell: Callable[[Timeline], object]) -> None:
        """Tell the timeline, as long as it did not fail: nothing else depends on it."""
        if self.error:
            return
        try:
            tell(self._make())
        except Exception as error:  # noqa: BLE001  whatever it is, the tables are worth more
            self.error = error

    def _write(self, rows: Sequence[MessageRow], events: Sequence[Event]) -> None:
        for row in rows:
            self.outcomes[row.outcome] = self.outcomes.get(row.outcome, 0) + 1
        self.states |= states(events)
        self.show(lambda timeline: self._tell_all(timeline, rows, events))

    def _tell_all(self, timeline: Timeline, rows: Sequence[MessageRow], events: Sequence[Event]) -> None:
        for row in rows:
            if row.sent_ns < self.plan.run.end_ns:  # a foreign sender may put any time on its frames
                timeline.message(row)
        for event in events:
            self._tell(timeline, event)
        for (t_ns, process), error_ns in islice(self.ledger.clock_errors.items(), self._errors_told, None):
            if t_ns < self.plan.run.end_ns:  # of a frame, as above
                timeline.clock_error(t_ns, process, error_ns / 1e6)
        self._errors_told = len(self.ledger.clock_errors)

    def _tell(self, timeline: Timeline, event: Event) -> None:
        match event.effect:
            case State(name, lane):
                timeline.state(event.t_ns, event.process, name, lane)
            case Charge(share):
                timeline.battery(event.t_ns, event.process, share)
            case Died(why):
                timeline.death(event.t_ns, event.process, why)
            case Queued(ahead=ahead):
                timeline.queue(event.t_ns, event.process, ahead)
            case Note(text):
                timeline.note(event.t_ns, event.process, text)
            case Publish(point) if self.stray(point):
                pass
            case Publish(point) if point.at_ns <= self.plan.run.end_ns:  # its source's clock may be ahead
                truth, _ = nearest(self.plan.paths, point)
                late_ns = event.t_ns - point.at_ns - round(self.plan.deadline_s * NS)
                timeline.estimate(point, truth[:2] if truth else None, late_ns)
                if self.leads(point):
                    self.points[point.tracker] = point
            case Write(port, data):
                timeline.note(event.t_ns, event.process, written(port, data))


class Journal(Telling):
    """Writes the timeline of a run into its folder, or to ``timeline``; at the end the tables, then the rest of it."""

    def __init__(self, plan: Plan, ledger: Ledger, folder: FilePath, timeline: FilePath | None = None) -> None:
        from launcher.timeline.timeline import Timeline  # loads Rerun

        self.folder, self._file = folder, timeline or folder / TIMELINE
        super().__init__(plan, ledger, partial(Timeline, self._file, plan.info))
        self._rest: tuple[Sequence[MessageRow], Sequence[Event]] = [], []
        self._bound: dict[int, float] = {}
        self._tracks: Sequence[TrackRow] = ()
        self._deaths: Sequence[Unplanned] = ()
        self._outside: Outside | None = None

    def tables(self, deaths: Sequence[Unplanned], *, messages: int) -> Metrics:
        """Write the tables; returns the metrics that are known here. ``messages`` is how many were received.

        Points that belong to no track of the run are left out, with a complaint. Raises ``RunFailed`` if the disk does
        not take the tables.
        """
        self._rest, self._deaths = self.ledger.close(name for name, *_ in deaths), deaths
        tracks = track_rows(self.ledger.estimates(), self.plan.paths)
        strays = Counter(why for row in tracks if (why := self.stray(row.point)))
        tracks = [row for row in tracks if not self.stray(row.point)]
        bounds = run_bounds(self.plan, tracks)
        bound = headline_bound(self.plan, tracks, bounds)
        self._bound = {t_ns: bound[t_ns] for t_ns in sorted({row.t_ns for row in tracks} & bound.keys())}
        outside, strange = outside_of(self.plan, self.ledger.diaries.values())
        patiently(lambda: self._write_tables(tracks, bounds, outside), f"the tables of {self.folder}")
        self._tracks, self._outside = tracks, outside
        metrics = run_metrics(self.plan, self.ledger, tracks, bounds)
        complaints = [*(f"{why} ({count} times)" for why, count in strays.items()), *strange, *self.ledger.complaints()]
        metrics["recorder"] |= {"messages": messages, "complaints": complaints}
        return metrics

    def make_room(self) -> None:
        """Give up the timeline, which a log can make again, for the tables' sake: the disk is full."""
        self.error = self.error or OSError(ENOSPC, os.strerror(ENOSPC))
        with suppress(OSError):
            os.truncate(self._file, 0)  # it is still open
            self._file.unlink()

    def _write_tables(self, tracks: Sequence[TrackRow], bounds: Bounds, outside: Outside | None) -> None:
        write_messages(self.ledger.rows, self.folder / MESSAGES_TABLE)
        write_tracks(tracks, bounds, self.folder / TRACKS_TABLE, self.plan.origin_ns)
        if outside is not None:
            write_camera(outside, self.folder / CAMERA)

    def draw(self) -> str:
        """Write the rest of the timeline, and the video of a camera; returns why one of them failed, or nothing.

        To be called after ``tables``.
        """
        self._write(*self._rest)
        self.bury(self._deaths)
        for t_ns, sd_m in self._bound.items():
            self.show(lambda timeline: timeline.bound(t_ns, sd_m))  # noqa: B023  called at once
        self.show(self._heard)
        unfilmed = "" if self._outside is None else self._film(self._outside)
        self.show(lambda timeline: timeline.close())
        if self.error is None:
            return unfilmed
        if isinstance(self.error, RunFailed):
            self.make_room()
            return f"{TIMELINE_FAILED}{self.error}"
        return f"{TIMELINE_FAILED}{_why(self.error)}"

    def _film(self, outside: Outside) -> str:
        """Show what the camera did and saw, and write the video; returns why that failed, or nothing."""
        self.show(lambda timeline: timeline.outside(outside))
        try:
            left = film_run(
                self.plan,
                outside,
                self.folder,
                lambda frame: self.show(lambda timeline: timeline.frame(frame)),
            )
        except Exception as error:  # noqa: BLE001  whatever it is, all else of the run is worth more
            return f"{VIDEO_FAILED}{_why(error)}"
        if left:
            said = f"{left} of {len(outside.exposures)} frames are not drawn, but those between them"
            self.show(lambda timeline: timeline.note(self.plan.origin_ns, "video", said, "WARN"))
        return ""

    def _heard(self, timeline: Timeline) -> None:
        """The events in which sensors heard targets, and what some of them heard."""
        events = events_of_run(self.plan, self._tracks, self.ledger.rows)
        timeline.events(events)
        heard: dict[str, list[tuple[Sound, bytes]]] = {rank: [] for rank in RANKS}
        for event in events[:SOUNDED]:
            ranks = dict(zip(loudest_and_weakest(event), RANKS, strict=False))
            for sound in sounds(self.plan, event, list(ranks)):
                heard[ranks[sound.sensor]].append((sound, wav(sound.samples, sound.rate)))
        for rank, several in heard.items():
            timeline.sounds(rank, several)


def _why(error: Exception) -> str:
    return reason(error) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"


def states(events: Iterable[Event]) -> dict[str, str]:
    """The latest state of each process in these events."""
    found = ((event.process, event.effect) for event in events if isinstance(event.effect, State | Died))
    return {process: effect.name if isinstance(effect, State) else "dead" for process, effect in found}


def written(port: str, data: bytes) -> str:
    """Bytes at a port in words."""
    shown = f": {data[:SHOWN].hex(' ')}" if data else ""
    more = " ..." if len(data) > SHOWN else ""
    return f"wrote {len(data)} byte{'s' * (len(data) != 1)} to {shortened(plain(port))}{shown}{more}"


def summary(journal: Journal, now_ns: int) -> dict[str, Any]:
    """What the live table shows: counts so far, states now (true time), the latest error of each tracker (m).

    It is provisional: what is not settled yet counts by what is known of it.
    """
    ledger, waiting = journal.ledger, journal.ledger.unsettled(now_ns)
    points = dict(journal.points)
    for event in waiting:
        if isinstance(event.effect, Publish) and journal.leads(event.effect.estimate):
            points[event.effect.estimate.tracker] = event.effect.estimate
    return {
        "sent": ledger.leaving.left,
        "outcomes": dict(+(Counter(journal.outcomes) + ledger.leaving.ways)),
        "states": dict(Counter((journal.states | states(waiting)).values())),
        "errors": {tracker: _error(journal.plan, point) for tracker, point in points.items()},
    }


def _error(plan: Plan, point: TrackPoint) -> float | None:
    """How far (m) a point is from the truth; None where one of them is missing."""
    truth, _ = nearest(plan.paths, point)
    return hypot(point.mean[0] - truth[0], point.mean[1] - truth[1]) if truth and point.mean else None


def write_json(value: object, file: FilePath) -> None:
    """Write JSON that is easy to read, whole or not at all."""
    write_whole(file, json.dumps(value, indent=2, allow_nan=False) + "\n")
