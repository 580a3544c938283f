"""Writes a run to a Rerun file: the field, its tracks, the network, every message and the plots.

Rows are kept per entity and sent together (``send_columns``): one at a time, each costs seven times as long
and 1.1 kB. What is shown for a while (a sensor's state, the bearings and frames of a step) is one array per
picture on a raster of 50 ms, not an entity per node.
"""

from __future__ import annotations

import math
import pathlib
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr

from launcher import blueprint as look
from launcher.blueprint import path as entity
from launcher.records import FieldInfo, MessageRow
from launcher.scene import Points, Seconds, Shown, extent, rings
from trackfield.role import NS, TrackPoint

LAG_NS: Final = NS
"""How far calls may be out of order: pictures and sums are settled only up to this long before the newest."""

HOLD: Final = 16
"""Rows are sent every so many flushes,"""
BULK: Final = 256
"""or as soon as an entity has so many of them."""

Columns = rr.ComponentColumnList
Rows = list[tuple[int, Any]]


class Timeline:
    """The timeline of one run, as a file.

    Times are emulated ns since the start of the run, lengths metres. Calls may come up to a second out of
    order; whatever comes later than that is shown a moment late, never dropped. Not safe for several threads.
    """

    def __init__(self, path: pathlib.Path, info: FieldInfo) -> None:
        self._info = info
        self._places = {place.id: place for place in info.places}
        self._sensors = [place.id for place in info.places if place.role == "node"]
        self._graph = look.graph_positions(info)
        self._reach = extent(info) / 4
        self._pending: defaultdict[tuple[str, Callable[[list[Any]], Columns]], Rows] = defaultdict(list)
        self._messages: list[MessageRow] = []
        self._shown = Shown()
        self._seconds = Seconds()
        self._tracks: dict[str, _Track] = {}
        self._step_ns = NS
        self._newest = self._flushes = self._truths = 0
        self._rec = rr.RecordingStream("trackfield", recording_id=info.run)
        rr.set_log_tick_enabled(False, recording=self._rec)
        rr.set_log_time_enabled(False, recording=self._rec)
        self._rec.save(path, default_blueprint=look.layout(info))
        self._rec.send_recording_name(info.run)
        self._scenery()

    def state(self, t_ns: int, process: str, name: str, lane: str = "") -> None:
        """A process (or one lane of it) entered a state, of any name."""
        self._newest = max(self._newest, t_ns)
        self._add(entity("state", process, *([lane] if lane else [])), _states, t_ns, name)
        self._shown.show("state", process, name, t_ns)

    def message(self, row: MessageRow) -> None:
        """A frame reached its hearer, or is known to be lost."""
        self._newest = max(self._newest, _instant(row))
        self._messages.append(row)

    def note(self, t_ns: int, process: str, text: str, level: str = "INFO") -> None:
        """A sentence among the messages; ``level`` is INFO, WARN or ERROR."""
        self._newest = max(self._newest, t_ns)
        self._note(t_ns, process, text, level)

    def estimate(self, t_ns: int, point: TrackPoint, truth: tuple[float, float] | None) -> None:
        """A tracker published a point; ``truth`` is where the target was at that step (metres)."""
        self._newest = max(self._newest, t_ns)
        track = self._track(point.tracker)
        if track.at is not None and point.step > track.at[1]:
            self._step_ns = (t_ns - track.at[0]) // (point.step - track.at[1])
        track.at = (t_ns, point.step)
        here = np.reshape(point.mean[:2], (-1, 2))
        self._add(track.path + "/position", _points, t_ns, here)
        self._add(track.path + "/ellipse", _strips, t_ns, rings(here, point.covariance))
        particles = np.frombuffer(point.particles, "<f4").reshape(-1, 2)
        if len(particles) or track.particles:
            track.particles = True
            self._add(track.path + "/particles", _points, t_ns, particles)
        if len(here) and len(track.last):
            self._add(track.path + "/track", _strips, t_ns, np.stack((track.last, here), axis=1))
        track.last = here
        if len(here):
            fix = (point.mean[0], point.mean[1])
            self._shown.show("fix", point.tracker, fix, t_ns)
            if truth is not None:
                error = math.dist(fix, truth)
                self._add(entity("plots", "error", point.tracker), _scalars, t_ns, (error,))

    def flush(self) -> None:
        """Sends what is due; to be called every quarter of a second."""
        self._flushes += 1
        self._settle(self._newest - LAG_NS)
        self._send(everything=self._flushes % HOLD == 0)

    def close(self) -> None:
        """Sends all that is left and ends the file; without it the file has no footer."""
        self._settle(math.inf)
        self._send(everything=True)
        self._rec.flush(timeout_sec=5)
        self._rec.disconnect()

    # --- what stands still --------------------------------------------------------------------------------

    def _scenery(self) -> None:
        static = self._static
        sensors = [self._places[name] for name in self._sensors]
        centres = [place for place in self._info.places if place.role != "node"]
        few = len(sensors) <= look.ALL_LANES
        static("/field", rr.Transform3D(scale=[1, -1, 1]))  # 2-D views point y down, north is up
        static(
            "/field/sensors",
            rr.Points2D(
                [(place.x, place.y) for place in sensors],
                radii=rr.Radius.ui_points(4.5 if few else 2.5),
                labels=self._sensors,
                show_labels=False,
            ),
        )
        static(
            "/field/centres",
            rr.Points2D(
                [(place.x, place.y) for place in centres],
                radii=rr.Radius.ui_points(8),
                colors=look.CENTRE,
                draw_order=25,
                labels=[place.id for place in centres],
            ),
        )
        static("/field/rays", look.line_style(look.RAY, 1.2, order=5))
        static("/field/truth/path", look.line_style(look.TRUTH, 4.5, order=10))
        static("/field/truth/interpolated", look.line_style(look.INTERPOLATED, 4.5, order=10))
        static("/field/truth/position", look.point_style(look.TARGET, 3.5, order=60))
        static(
            "/network",
            rr.GraphNodes(
                list(self._graph),
                positions=list(self._graph.values()),
                labels=list(self._graph),
                show_labels=few,
                radii=10.0,
            ),
            rr.GraphEdges.from_fields(graph_type="directed"),
        )
        for name, labels, colours in (
            ("latency", ["median", "95 %"], [0x8C7BF0FF, 0x5B4FB0FF]),
            ("lost", ["lost", "late"], [look.LOST, look.LATE]),
            ("bytes", ["sent to hearers", "delivered"], [0x9A8F6AFF, 0xE6C65CFF]),
        ):
            static(f"/plots/{name}", rr.SeriesLines(colors=colours, names=labels, widths=1.5))
        for name in ("lost", "bytes"):
            self._add(f"/plots/{name}", _scalars, 0, (0.0, 0.0))
        for start, end in self._info.gaps:
            self._note(round(start * NS), "target", f"path interpolated until {end:g} s", "WARN")
        self._shown.show("state", "", "", 0)  # a first picture, all asleep

    def _track(self, tracker: str) -> _Track:
        if tracker not in self._tracks:
            track = self._tracks[tracker] = _Track(entity("field", tracker))
            colour = look.tracker_colour(self._info, tracker)
            faint = colour & ~0xFF | 0x70
            self._static(track.path + "/position", look.point_style(colour, 3.0, order=50))
            self._static(track.path + "/track", look.line_style(colour, 1.5, order=20))
            self._static(track.path + "/ellipse", look.line_style(colour, 1.5, order=40))
            self._static(track.path + "/particles", look.point_style(faint, 1.2, order=35))
            plot = entity("plots", "error", tracker)
            self._static(plot, rr.SeriesLines(colors=colour, names=tracker, widths=1.5))
        return self._tracks[tracker]

    def _static(self, path: str, *what: rr.AsComponents) -> None:
        self._rec.log(path, *what, static=True)

    # --- what happens -------------------------------------------------------------------------------------

    def _note(self, t_ns: int, process: str, text: str, level: str) -> None:
        colour = {"WARN": look.LATE, "ERROR": look.LOST}.get(level, look.INFO)
        self._add("/notes", _texts, t_ns, (f"{process}: {text}", level, colour))

    def _settle(self, until_ns: float) -> None:
        """Turns all messages, and all else that happened up to this time, into rows."""
        for row in self._messages:
            self._message(row)
        self._messages.clear()
        truth, seen = self._info.truth, self._newest / NS
        while self._truths < len(truth) and truth[self._truths][0] <= seen:
            self._truth(self._truths)
            self._truths += 1
        for t_ns, changed in self._shown.until(until_ns):
            self._picture(t_ns, changed)
        for t_ns, name, values in self._seconds.until(until_ns):
            self._add(f"/plots/{name}", _scalars, t_ns, values)

    def _message(self, row: MessageRow) -> None:
        t_ns = _instant(row)
        self._add(entity("messages", row.kind), _texts, t_ns, _sentence(row))
        self._seconds.count(t_ns, row)
        if row.src not in self._places or row.dst not in self._places:
            return
        over = row.sent_ns + self._step_ns
        if not row.delivered:
            self._shown.show("lost", row.src, True, row.sent_ns, over)
            return
        self._shown.show("edge", (row.src, row.dst), True, t_ns, over)
        if row.bearing_deg is not None and row.outcome == "delivered":
            self._shown.show("ray", row.src, math.radians(row.bearing_deg), t_ns, over)

    def _rays(self) -> Points:
        """From each sensor along its bearing to a little past the latest estimate, (n, 2, 2)."""
        fix = next(iter(self._shown.now["fix"].values()), None)
        found = []
        for src, bearing in self._shown.now["ray"].items():
            x, y = self._places[src].x, self._places[src].y
            length = self._reach if fix is None else 1.15 * math.dist((x, y), fix) + 5.0
            found.append((x, y, x + length * math.sin(bearing), y + length * math.cos(bearing)))
        return np.reshape(found, (-1, 2, 2))

    def _truth(self, index: int) -> None:
        t, x, y = self._info.truth[index]
        t_ns = round(t * NS)
        self._add("/field/truth/position", _points, t_ns, np.array([(x, y)]))
        if index:
            before, *start = self._info.truth[index - 1]
            guessed = any(before < end and t > begin for begin, end in self._info.gaps)
            path = "/field/truth/interpolated" if guessed else "/field/truth/path"
            self._add(path, _strips, t_ns, np.array([[start, (x, y)]]))

    def _picture(self, t_ns: int, changed: set[str]) -> None:
        shown = self._shown.now
        states, lost = shown["state"], shown["lost"]
        colours = {name: look.STATE_COLOURS.get(states.get(name, "asleep"), look.OTHER_STATE) for name in self._graph}
        if "state" in changed:
            self._add("/field/sensors", _point_colours, t_ns, [colours[name] for name in self._sensors])
        if changed & {"state", "lost"}:
            reds = [look.LOST if name in lost else colour for name, colour in colours.items()]
            self._add("/network", _node_colours, t_ns, reds)
        if "ray" in changed:
            self._add("/field/rays", _strips, t_ns, self._rays())
        if "edge" in changed:
            self._add("/network", _edges, t_ns, np.reshape(sorted(shown["edge"]), (-1, 2)))

    def _add(self, path: str, columns: Callable[[list[Any]], Columns], t_ns: int, value: Any) -> None:
        self._pending[path, columns].append((t_ns, value))

    def _send(self, everything: bool) -> None:
        for key, rows in list(self._pending.items()):
            if everything or len(rows) >= BULK:
                rows.sort(key=lambda row: row[0])
                times = np.array([t_ns for t_ns, _ in rows], "timedelta64[ns]")
                path, columns = key
                self._rec.send_columns(
                    path, [rr.TimeColumn(look.EMU, duration=times)], columns([value for _, value in rows])
                )
                del self._pending[key]


@dataclass(slots=True)
class _Track:
    """What of a tracker the next point needs: its entity, time and step of the last point, where it was."""

    path: str
    at: tuple[int, int] | None = None
    last: Points = field(default_factory=lambda: np.empty((0, 2)))
    particles: bool = False


# --- messages as text -------------------------------------------------------------------------------------


def _instant(row: MessageRow) -> int:
    """When a message is shown: when it arrived, or was sent if it did not."""
    return row.due_ns if row.delivered and row.due_ns is not None else row.sent_ns


def _sentence(row: MessageRow) -> tuple[str, str, int]:
    """A message as a line of the log: text, level, colour."""
    text = f"{row.src} → {row.dst}  {row.text or row.kind}  ({row.bytes} B)"
    if not row.delivered:
        return f"{text}  LOST: {row.outcome}", "ERROR", look.LOST
    if row.due_ns is not None:
        text += f"  {(row.due_ns - row.sent_ns) / 1e6:.1f} ms"
    if row.outcome != "delivered":
        return f"{text}  {row.outcome.upper()}", "WARN", look.LATE
    return text, "INFO", look.INFO


# --- rows of one kind as columns --------------------------------------------------------------------------


def _scalars(values: list[tuple[float, ...]]) -> Columns:
    return rr.Scalars.columns(scalars=np.array(values))


def _states(values: list[str]) -> Columns:
    return rr.StateChange.columns(state=values)


def _texts(values: list[tuple[str, str, int]]) -> Columns:
    text, level, colour = zip(*values, strict=True)
    return rr.TextLog.columns(text=text, level=level, color=np.array(colour, np.uint32))


def _points(values: list[Points]) -> Columns:
    return rr.Points2D.columns(positions=np.concatenate(values)).partition(_lengths(values))


def _point_colours(values: list[list[int]]) -> Columns:
    return rr.Points2D.columns(colors=np.array(values, np.uint32).ravel()).partition(_lengths(values))


def _node_colours(values: list[list[int]]) -> Columns:
    return rr.GraphNodes.columns(colors=np.array(values, np.uint32).ravel()).partition(_lengths(values))


def _strips(values: list[Points]) -> Columns:
    return rr.LineStrips2D.columns(strips=np.concatenate(values)).partition(_lengths(values))


def _edges(values: list[npt.NDArray[np.str_]]) -> Columns:
    return rr.GraphEdges.columns(edges=np.concatenate(values)).partition(_lengths(values))


def _lengths(values: list[Any]) -> list[int]:
    return [len(value) for value in values]
