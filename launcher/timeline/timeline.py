"""Writes a run to a Rerun file, or to viewers as it goes on: the field, its tracks, the network, messages, plots.

Rows are kept per entity and sent together (``send_columns``): sent one at a time, each takes seven times as long
and 1.1 kB. What is shown for a while (a sensor's state, the bearings and frames of a step) is one array per
picture on a raster of 50 ms, not an entity per node, and holds only what is not at rest.
"""

from __future__ import annotations

import math
import pathlib
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from launcher.filming.frames import Frame
from launcher.heard import Event, Sound
from launcher.outside import Outside
from launcher.records import SENSES, FieldInfo, MessageRow
from launcher.timeline import look, rows, scenery, views
from launcher.timeline.curves import Curves
from launcher.timeline.file import TimelineFile
from launcher.timeline.layers import heads
from launcher.timeline.layers.passes import Passes
from launcher.timeline.layers.tracks import Tracks
from launcher.timeline.layers.truth import Truths
from launcher.timeline.look import path as entity
from launcher.timeline.picture import Picture
from launcher.timeline.scene import Seconds
from trackfield.link.places import position
from trackfield.role import NS, TrackPoint

APPLICATION: Final = "trackfield"
"""The application id of recordings and layouts, for the viewer."""
LAG_NS: Final = NS
"""How far calls may be out of order: pictures and sums are settled only up to this long before the newest."""

HOLD: Final = 16
"""Rows are sent every so many flushes."""
BULK: Final = 256
"""Rows are also sent as soon as an entity has so many of them."""

BATTERY_STEPS: Final = 20
"""The number of levels of a battery that are distinguished."""
MOVES_NS: Final = NS // 4
"""How often a process that moves is drawn."""
LINES: Final = 100
"""The most messages that are listed at a flush of a live timeline."""
PROVISIONAL: Final = "what is shown while the run goes on may be taken back; run.rrd has what holds"
LIVE_MEMORY: Final = "256MiB"
"""Memory for viewers that connect late; the oldest data is dropped first."""
LINGER_S: Final = 1.0
"""Time for viewers to fetch the last of it."""
MARKS: Final = 100
"""A mark of an instant is as long as the run divided by this."""

Columns = rows.Columns
Rows = list[tuple[int, Any]]


class Timeline:
    """The timeline of one run: as a file, or live, at a port of this machine to which viewers connect, or sent to a
    viewer at an address.

    Live, all is sent at every flush, and of many messages only some are listed. Times are emulated ns since the start
    of the run, and shown as counted from the first step; lengths are metres. Calls may come up to a second out of
    order; later ones are shown a moment late, never dropped. Not thread-safe.
    """

    def __init__(self, to: pathlib.Path | int | str, info: FieldInfo) -> None:
        self._info, self._live = info, not isinstance(to, pathlib.Path)
        self._places = {place.id for place in info.places}
        self._unwatched = {place.id for place in look.lanes(info)[look.ALL_LANES :] if SENSES in place.tags}
        self._begun: set[str] = set()
        self._resting: dict[str, int] = {}
        self._known = {(self._ns(t_s), process, text) for t_s, process, text in info.marks}
        self._pending: defaultdict[tuple[str, Callable[[list[Any]], Columns]], Rows] = defaultdict(list)
        self._spells = {(self._ns(since_s), id, text): self._ns(until_s) for since_s, until_s, id, text in info.spells}
        self._ends = {(until_ns, id) for (_, id, _), until_ns in self._spells.items()}
        self._messages: list[MessageRow] = []
        self._picture = Picture(info, self._add)
        self._seconds = Seconds()
        self._truths = Truths(info, self._add)
        self._curves = Curves(info, self._add)
        self._passes = Passes(info, self._add, self._static)
        self._tracks = Tracks(info, self._add, self._static, self._picture.shown, self._curves)
        self._mark_ns = round(info.end_s / MARKS * NS)
        self._newest = self._flushes = self._marks = self._moves = 0
        self._rec = rr.RecordingStream(APPLICATION, recording_id=info.run)
        rr.set_log_tick_enabled(False, recording=self._rec)
        rr.set_log_time_enabled(False, recording=self._rec)
        if isinstance(to, pathlib.Path):
            self._file = TimelineFile(to)
            self._rec.set_sinks(self._file.sink())
            self._file.begun()
            self._lay_out(views.layout(info))
        else:  # the layout has to come first: a viewer that has begun to show data keeps a layout of its own
            self._rec.set_sinks(_shown(to), default_blueprint=views.layout(info, live=True))
            self._note(0, "live view", PROVISIONAL, "WARN")
        self._rec.send_recording_name(info.run)
        for static in scenery.parts(info):
            self._static(*static)
        for name in ("lost", "bytes", "queue"):
            self._curves.value((name,), 0, (0.0,) if name == "queue" else (0.0, 0.0), NS)
        for truth in info.truths:
            for start, end in truth.gaps:
                self._note(self._ns(start), truth.target, f"path interpolated until {end:g} s", "WARN")

    def state(self, t_ns: int, process: str, name: str, lane: str = "") -> None:
        """A process (or one lane of it) entered a state, of any name."""
        self._newest = max(self._newest, t_ns)
        self._lane(t_ns, process, name, lane)
        drawn = self._picture.heads.state(t_ns, process, name, lane)
        if not self._picture.hearing.state(t_ns, process, name, lane) and not drawn:
            self._picture.shown.show("state", process, None if name == look.REST else name, t_ns)
            self._picture.clusters.state(t_ns, process, name)
        if name != look.DEAD:
            self._tracks.lives(t_ns, process)

    def death(self, t_ns: int, process: str, why: str) -> None:
        """The life of a process ended, for example by an empty battery; its next state begins another."""
        self.state(t_ns, process, look.DEAD)
        self._tracks.died(t_ns, process)
        self._mark(t_ns, process, why, "ERROR")

    def fault(self, t_ns: int, process: str, text: str) -> None:
        """A planned fault began or ended; one that ``FieldInfo.marks`` holds with this text is known already."""
        if (t_ns, process, text) not in self._known:
            self._newest = max(self._newest, t_ns)
            self._mark(t_ns, process, text, "WARN")

    def battery(self, t_ns: int, process: str, share: float) -> None:
        """The share left in a battery, 0 to 1; it is drawn once it is low."""
        self._newest = max(self._newest, t_ns)
        level = round(share * BATTERY_STEPS) / BATTERY_STEPS
        self._picture.shown.show("battery", process, level if level <= look.LOW else None, t_ns)

    def clock_error(self, t_ns: int, process: str, error_ms: float) -> None:
        """The clock error of a process; the plot shows those of each second."""
        self._newest = max(self._newest, t_ns)
        self._seconds.clock(t_ns, error_ms)

    def queue(self, t_ns: int, process: str, waiting: int) -> None:
        """How many frames wait at the radio of a process; the plot shows the longest queue of each second."""
        self._newest = max(self._newest, t_ns)
        self._seconds.queue(t_ns, waiting)

    def message(self, row: MessageRow) -> None:
        """A frame reached its hearer, or is known to be lost."""
        self._newest = max(self._newest, rows.instant(row))
        self._messages.append(row)

    def note(self, t_ns: int, process: str, text: str, level: str = "INFO") -> None:
        """A sentence among the messages; ``level`` is INFO, WARN or ERROR."""
        self._newest = max(self._newest, t_ns)
        self._note(t_ns, process, text, level)
        self._picture.heads.note(t_ns, process, text, level)

    def estimate(self, point: TrackPoint, truth: tuple[float, float] | None, late_ns: int = 0) -> None:
        """A tracker published a point; ``truth`` is where the target was at its instant (metres).

        ``late_ns`` is how long after the deadline of its step that was.
        """
        self._newest = max(self._newest, point.at_ns)
        self._tracks.estimate(point, truth, late_ns)

    def bound(self, t_ns: int, sd_m: float) -> None:
        """The least error of any tracker at an instant (m, root mean square)."""
        self._curves.value(("error", "bound"), t_ns, (sd_m,), self._info.step_ns)

    def events(self, events: Sequence[Event]) -> None:
        """All events of targets that sensors heard; to be called once the run is over."""
        self._passes.events(events)

    def sounds(self, rank: str, sounds: Sequence[tuple[Sound, bytes]]) -> None:
        """What the loudest or the weakest sensor of each event heard, also as WAV files."""
        self._passes.sounds(rank, [sound for sound, _ in sounds])
        for sound, file in sounds:
            self._add(look.path("sound", rank), rows.sounds, sound.first_ns, file)

    def outside(self, outside: Outside) -> None:
        """All that the processes of a camera told; to be called once the run is over."""
        self._picture.beyond.outside(outside)

    def frame(self, frame: Frame) -> None:
        """A frame of a camera; as above."""
        self._picture.beyond.frame(frame)

    def flush(self) -> None:
        """Sends what is due; to be called every quarter of a second."""
        self._flushes += 1
        self._settle(self._newest - LAG_NS)
        self._send(everything=self._live or self._flushes % HOLD == 0)

    def close(self) -> None:
        """Sends all that remains and ends the file; without it the file has no footer.

        Raises ``RunFailed`` if the disk does not take the file.
        """
        self._settle(self._newest)
        self._picture.close(self._newest + max(self._info.step_ns, self._mark_ns))
        for second in self._seconds.until(math.inf):
            self._second(*second)
        for path, words in (("/faults", self._picture.words), (heads.EVENTS, self._picture.heads.words)):
            if words:
                colours = np.array(list(words.values()), np.uint32)
                self._static(path, rr.StateConfiguration(values=list(words), colors=colours))
        self._send(everything=True)
        if not self._live:
            axes = {plot: self._curves.axis(plot, views.labels(self._info, plot)) for plot in views.PLOTS}
            self._lay_out(views.layout(self._info, axes), instead=True)
        self._rec.flush(timeout_sec=5)
        if self._live:
            time.sleep(LINGER_S)
        self._rec.disconnect()
        del self._rec
        rerun_bindings.flush_and_cleanup_orphaned_recordings()  # otherwise its threads stay until the program ends
        if not self._live:
            self._file.close()

    # --- what happens -------------------------------------------------------------------------------------

    def _ns(self, t_s: float) -> int:
        """The emulated time of so many seconds after the first step."""
        return self._info.origin_ns + round(t_s * NS)

    def _lay_out(self, blueprint: rrb.Blueprint, instead: bool = False) -> None:
        """Sends a blueprint, ``instead`` of the one before; Rerun's own function for it leaves two threads behind."""
        made = rerun_bindings.new_blueprint(APPLICATION, make_default=False, make_thread_default=False)
        stream = rr.RecordingStream._from_native(made)
        stream.set_time("blueprint", sequence=0)
        blueprint._log_to_stream(stream)
        if kept := rerun_bindings.memory_recording(stream.to_native()):
            rerun_bindings.send_blueprint(kept, instead, True, recording=self._rec.to_native())
        stream.disconnect()

    def _static(self, path: str, *what: rr.AsComponents) -> None:
        self._rec.log(path, *what, static=True)

    def _note(self, t_ns: int, process: str, text: str, level: str) -> None:
        self._add("/notes", rows.texts, t_ns, (f"{process}: {text}", level, look.LEVELS[level]))

    def _lane(self, t_ns: int, process: str, name: str, lane: str) -> None:
        """Adds to a lane of states; a lane that no view shows begins when its sensor first leaves its rest."""
        path = entity("state", process, *([lane] if lane else []))
        if process in self._unwatched and path not in self._begun:
            if name == look.REST:
                self._resting.setdefault(path, t_ns)
                return
            self._begun.add(path)
            if path in self._resting:
                self._add(path, rows.states, self._resting.pop(path), look.REST)
        self._add(path, rows.states, t_ns, name)

    def _mark(self, t_ns: int, process: str, text: str, level: str) -> None:
        self._add("/faults", rows.texts, t_ns, (f"{process}: {text}", level, look.LEVELS[level]))
        if (t_ns, process) not in self._ends or level == "ERROR":
            end_ns = self._spells.get((t_ns, process, text), t_ns + self._mark_ns)
            self._picture.shown.show("mark", (process, text), look.LEVELS[level], t_ns, end_ns)

    def _settle(self, until_ns: float) -> None:
        """Turns all messages, and all else that happened up to this time, into rows."""
        for number, row in enumerate(self._messages):
            if not self._live or number < LINES:
                self._list(row)
            self._message(row)
        if self._live and (more := len(self._messages) - LINES) > 0:
            self._note(self._newest, "messages", f"{more} more, not listed while the run goes on", "INFO")
        self._messages.clear()
        self._foreseen(self._newest)
        self._picture.settle(until_ns)
        self._tracks.until(until_ns)
        for second in self._seconds.until(until_ns):
            self._second(*second)

    def _second(self, t_ns: int, name: str, values: tuple[float, ...]) -> None:
        self._curves.value((name,), t_ns, values, max(NS, self._info.step_ns))

    def _foreseen(self, until_ns: int) -> None:
        """Draws what is known in advance, only as far as the run has come."""
        until_s, marks = (until_ns - self._info.origin_ns) / NS, self._info.marks
        self._truths.until(until_s)
        while self._marks < len(marks) and marks[self._marks][0] <= until_s:
            t_s, process, text = marks[self._marks]
            self._mark(self._ns(t_s), process, text, "WARN")
            self._marks += 1
        paths = dict(self._info.paths)
        while paths and self._moves * MOVES_NS <= until_ns:
            t_ns = self._moves * MOVES_NS
            at = np.array([position(paths, id, t_ns) for id in paths])
            self._add("/field/moving", rows.points, t_ns, at)
            self._moves += 1

    def _list(self, row: MessageRow) -> None:
        t_ns = rows.instant(row)
        self._add(entity("messages", row.kind), rows.texts, t_ns, rows.sentence(row))
        self._add("/times", rows.times, t_ns, (row, self._info.origin_ns))

    def _message(self, row: MessageRow) -> None:
        t_ns, show = rows.instant(row), self._picture.shown.show
        self._seconds.message(t_ns, row)
        if row.src not in self._places or row.dst not in self._places:
            return
        self._picture.heads.message(row)
        self._picture.beyond.message(row)
        begin_ns, over_ns = t_ns, row.sent_ns + self._info.step_ns
        if row.step is not None and row.outcome != "late":
            begin_ns = self._info.origin_ns + row.step * self._info.step_ns
            over_ns = begin_ns + self._info.step_ns
        if not row.delivered:
            show("lost", row.src, True, min(begin_ns, row.sent_ns), over_ns)
            return
        self._picture.clusters.message(row)
        self._picture.hearing.message(row)
        show("edge", (row.src, row.dst), True, begin_ns, over_ns)
        if row.values and row.src in self._info.layers and row.outcome == "delivered":
            show("reading", row.src, row.values, begin_ns, over_ns)

    def _add(self, path: str, columns: Callable[[list[Any]], Columns], t_ns: int, value: Any) -> None:
        self._pending[path, columns].append((t_ns, value))

    def _send(self, everything: bool) -> None:
        for key, found in list(self._pending.items()):
            if everything or len(found) >= BULK:
                path, columns = key
                found.sort(key=lambda row: row[0])
                times = np.array([t_ns for t_ns, _ in found], np.int64)
                if columns is rows.times:
                    times = rows.apart(times)
                index = rr.TimeColumn(look.TIME, duration=(times - self._info.origin_ns).astype("timedelta64[ns]"))
                self._rec.send_columns(path, [index], columns([value for _, value in found]))
                del self._pending[key]


def _shown(to: int | str) -> rr.GrpcServerSink | rr.GrpcSink:
    """On this machine only, where viewers that connect late get earlier data, too; or to a viewer at an address."""
    if isinstance(to, str):
        return rr.GrpcSink(to)
    return rr.GrpcServerSink("127.0.0.1", to, server_memory_limit=LIVE_MEMORY)
