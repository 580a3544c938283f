"""The estimates of the trackers: tracks, ellipses, particles, and errors over time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from launcher.records import TRACKS, FieldInfo
from launcher.timeline import look, rows
from launcher.timeline.curves import GAP, Curves
from launcher.timeline.layers.closeup import size
from launcher.timeline.look import path as entity
from launcher.timeline.scene import Add, Points, Shown, rings
from trackfield.role import TrackPoint

Static = Callable[..., None]
"""Takes an entity and what it always looks like."""


@dataclass(slots=True)
class _Track:
    """The state of a track that the next point needs: its entity, last position and latest instant, ``newest_ns``.

    ``source`` published the last point, in ``term``.
    """

    path: str
    plot: tuple[str, ...]
    last: Points = field(default_factory=lambda: np.empty((0, 2)))
    last_ns: int = 0
    newest_ns: int = 0
    source: str = ""
    term: int = 0
    particles: bool = False
    shown: bool = False


class Tracks:
    """Hands points to ``add``; the latest of each tracker is ``shown``, where rays end and which the close-up fits.

    A track without a point for one and a half steps, or whose process is dead, is hidden until its next point; its line
    breaks after one and a half steps. A point that comes so late, like that of a frozen process, is part of the line
    only.

    A field in which several processes track has a track for each of them; those outside of the headline are dimmed.
    Those of the headline, if they are several, have one together: of two points the one of the higher term is drawn.
    """

    def __init__(self, info: FieldInfo, add: Add, static: Static, shown: Shown, curves: Curves) -> None:
        self._info, self._add, self._static, self._shown = info, add, static, shown
        self._curves, self._limit_ns = curves, round(GAP * info.step_ns)
        self._alone = len(info.tagged(TRACKS)) <= 1
        self._names: dict[tuple[str, str], tuple[str, ...]] = {}
        self._tracks: dict[tuple[str, ...], _Track] = {}
        self._dead: dict[str, tuple[float, float]] = {}  # (from ns, until ns) of processes that died
        self._lived: dict[str, int] = {}

    def estimate(self, point: TrackPoint, truth: tuple[float, float] | None, late_ns: int = 0) -> None:
        """Add a point, ``late_ns`` after its deadline; of a smoothed track only the line is drawn."""
        track, t_ns = self._track(point), point.at_ns
        if point.source != track.source:
            if point.term < track.term or (point.term == track.term and t_ns <= track.newest_ns):
                return
            track.source = point.source
        track.term = max(track.term, point.term)
        here = np.reshape(point.mean[:2], (-1, 2))
        self._leave(track, t_ns)
        dead_ns, back_ns = self._dead.get(point.source, (math.inf, math.inf))
        stale = late_ns > self._limit_ns and t_ns > track.newest_ns  # else it is told again, of late reports
        if stale and track.shown:
            self._hide(track, track.last_ns + self._limit_ns)
        track.newest_ns = max(track.newest_ns, t_ns)
        if not point.lag and not stale and not dead_ns <= t_ns < back_ns:
            self._place(track, t_ns, here, point, truth)
        if len(here) and len(track.last):
            self._add(track.path + "/track", rows.strips, t_ns, np.stack((track.last, here), axis=1))
        track.last, track.last_ns = here, t_ns
        if point.mean and truth is not None:
            self._curves.value(track.plot, t_ns, (math.dist(point.mean[:2], truth),), self._info.step_ns)

    def died(self, t_ns: int, process: str) -> None:
        """The life of a process ended: its points for times before its next life are not current."""
        lived_ns = self._lived.get(process, 0)
        self._dead[process] = (t_ns, lived_ns if lived_ns > t_ns else math.inf)
        for track in self._tracks.values():
            if track.source == process and track.shown and t_ns > track.last_ns:
                self._hide(track, t_ns)

    def lives(self, t_ns: int, process: str) -> None:
        """A process is alive, again or still."""
        self._lived[process] = t_ns
        dead_ns, back_ns = self._dead.get(process, (math.inf, math.inf))
        if dead_ns < t_ns < back_ns:
            self._dead[process] = (dead_ns, t_ns)

    def until(self, t_ns: float) -> None:
        """No point for a time before this one will come."""
        for track in self._tracks.values():
            self._leave(track, t_ns)

    def _leave(self, track: _Track, t_ns: float) -> None:
        """Hides a track that has had no point for too long at this time."""
        gone_ns = track.last_ns + self._limit_ns
        if t_ns <= gone_ns:
            return
        track.last = np.empty((0, 2))
        if track.shown:
            self._hide(track, gone_ns)

    def _hide(self, track: _Track, t_ns: int) -> None:
        nothing, track.shown = np.empty((0, 2)), False
        self._add(track.path + "/position", rows.points, t_ns, nothing)
        self._add(track.path + "/ellipse", rows.strips, t_ns, rings(nothing, ()))
        if track.particles:
            self._add(track.path + "/particles", rows.points, t_ns, nothing)

    def _place(
        self, track: _Track, t_ns: int, here: Points, point: TrackPoint, truth: tuple[float, float] | None
    ) -> None:
        ring = rings(here, point.covariance)
        self._add(track.path + "/position", rows.points, t_ns, here)
        self._add(track.path + "/ellipse", rows.strips, t_ns, ring)
        particles = np.frombuffer(point.particles, "<f4").reshape(-1, 2)
        if len(particles) or track.particles:
            track.particles = True
            self._add(track.path + "/particles", rows.points, t_ns, particles)
        track.shown = bool(point.mean)
        if point.mean:
            key, end_ns = (point.target, point.tracker, point.source), t_ns + self._limit_ns
            self._shown.show("fix", point.tracker, (point.mean[0], point.mean[1]), t_ns, end_ns)
            self._shown.show("size", key, size(ring[0], truth), t_ns, end_ns)

    def _track(self, point: TrackPoint) -> _Track:
        key = point.tracker, point.source
        if key not in self._names:
            self._names[key] = look.track_name(self._info, *key)
        name = self._names[key]
        if name not in self._tracks:
            track = self._tracks[name] = _Track(entity("field", *name), ("error", *name), source=point.source)
            colour = look.tracker_colour(self._info, point.tracker)
            if not self._alone and point.source not in self._info.headline:
                colour = look.dimmed(colour)
            faint = colour & ~0xFF | 0xB0
            self._static(track.path + "/position", look.point_style(colour, 3.0, order=50))
            self._static(track.path + "/track", look.line_style(colour, 2.0, order=20))
            self._static(track.path + "/ellipse", look.line_style(colour, 2.5, order=40))
            self._static(track.path + "/particles", look.point_style(faint, 1.8, order=35))
            self._static(entity("plots", *track.plot), rr.SeriesLines(colors=colour, names=", ".join(name), widths=1.5))
        return self._tracks[name]
