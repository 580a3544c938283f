"""What trackers say: tracks, ellipses, particles, and the error of each over time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from launcher.records import TRACKS, FieldInfo
from launcher.timeline import blueprint as look
from launcher.timeline import rows
from launcher.timeline.blueprint import path as entity
from launcher.timeline.scene import Add, Points, Shown, rings
from trackfield.role import TrackPoint

Static = Callable[..., None]
"""Takes an entity and what it always looks like."""


@dataclass(slots=True)
class _Track:
    """What of a track the next point needs: its entity, and where it was."""

    path: str
    plot: str
    last: Points = field(default_factory=lambda: np.empty((0, 2)))
    particles: bool = False


class Tracks:
    """Hands points to ``add``; the latest of each tracker is ``shown``, for rays to end there.

    A field in which several processes track has a track for each of them.
    """

    def __init__(self, info: FieldInfo, add: Add, static: Static, shown: Shown) -> None:
        self._info, self._add, self._static, self._shown = info, add, static, shown
        self._alone = len(info.tagged(TRACKS)) <= 1
        self._tracks: dict[tuple[str, ...], _Track] = {}

    def estimate(self, point: TrackPoint, truth: tuple[float, float] | None) -> None:
        """A point; of a smoothed track only the line is drawn, at the times that its points are about."""
        track, t_ns = self._track(point), point.at_ns
        here = np.reshape(point.mean[:2], (-1, 2))
        if not point.lag:
            self._place(track, t_ns, here, point)
        if len(here) and len(track.last):
            self._add(track.path + "/track", rows.strips, t_ns, np.stack((track.last, here), axis=1))
        track.last = here
        if point.mean and truth is not None:
            self._add(track.plot, rows.scalars, t_ns, (math.dist(point.mean[:2], truth),))

    def _place(self, track: _Track, t_ns: int, here: Points, point: TrackPoint) -> None:
        self._add(track.path + "/position", rows.points, t_ns, here)
        self._add(track.path + "/ellipse", rows.strips, t_ns, rings(here, point.covariance))
        particles = np.frombuffer(point.particles, "<f4").reshape(-1, 2)
        if len(particles) or track.particles:
            track.particles = True
            self._add(track.path + "/particles", rows.points, t_ns, particles)
        if point.mean:
            self._shown.show("fix", point.tracker, (point.mean[0], point.mean[1]), t_ns)

    def _track(self, point: TrackPoint) -> _Track:
        name = (point.tracker,) if self._alone else (point.tracker, point.source)
        if name not in self._tracks:
            track = self._tracks[name] = _Track(entity("field", *name), entity("plots", "error", *name))
            colour = look.tracker_colour(self._info, point.tracker)
            faint = colour & ~0xFF | 0x70
            self._static(track.path + "/position", look.point_style(colour, 3.0, order=50))
            self._static(track.path + "/track", look.line_style(colour, 1.5, order=20))
            self._static(track.path + "/ellipse", look.line_style(colour, 1.5, order=40))
            self._static(track.path + "/particles", look.point_style(faint, 1.2, order=35))
            self._static(track.plot, rr.SeriesLines(colors=colour, names=", ".join(name), widths=1.5))
        return self._tracks[name]
