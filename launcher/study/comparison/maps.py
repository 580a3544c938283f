"""The tracks of several runs on the map of the field, and a close-up of where they are furthest apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.report import style
from launcher.report.parts.field import IN_A_STEP, along, framed, scaled
from launcher.report.tracks import Array
from launcher.study.comparison.figures import columns
from launcher.study.comparison.lines import Line, colours, common, panels

CLOSE_M: Final = 5.0
"""From the middle of the close-up to its edge, at least."""


@dataclass(frozen=True)
class Apart:
    """Where two lines are furthest apart: at ``t_s``, ``distance_m``; ``points`` (2, 2) of the one and the other, m."""

    one: Line
    other: Line
    t_s: float
    points: Array

    @property
    def distance_m(self) -> float:
        """The distance between the two points, m."""
        return float(np.hypot(*(self.points[1] - self.points[0])))

    @property
    def text(self) -> str:
        """A sentence that says which they are, and how far apart."""
        ends = f"{self.one.track.tracker} in {self.one.name} and {self.other.name}"
        if self.one.track.tracker != self.other.track.tracker:
            ends = f"{self.one.label} and {self.other.label}"
        return f"At {self.t_s:g} s {ends} are furthest apart: {self.distance_m:.3g} m."


@dataclass(frozen=True)
class Map:
    """A map, and what its close-up shows, in a sentence; there is none if the tracks are the same."""

    figure: Figure
    text: str


def maps(found: Sequence[Line]) -> list[Map]:
    """A map for each plot of lines whose runs have the same target."""
    return [_map(plot, furthest(plot)) for plot in panels(found)]


def furthest(plot: Sequence[Line]) -> Apart | None:
    """Where two runs differ most: by the same tracker, or by any if they have none in common; None if nowhere."""
    pairs = [(a, b) for a, b in combinations(plot, 2) if a.place != b.place and a.track.target == b.track.target]
    same = [(a, b) for a, b in pairs if a.track.tracker == b.track.tracker]
    known = [apart for a, b in same or pairs if (apart := _apart(a, b)) is not None]
    return max(known, key=lambda apart: apart.distance_m, default=None)


def _apart(one: Line, other: Line) -> Apart | None:
    first, second = common(one.track, other.track)
    points = np.stack((one.track.mean[first, :2], other.track.mean[second, :2]), axis=1)
    distances = np.hypot(*(points[:, 1] - points[:, 0]).T)
    if not (distances > 0.0).any():
        return None
    where = int(np.nanargmax(distances))
    return Apart(one, other, float(one.track.t_s[first[where]]), points[where])


def _map(plot: Sequence[Line], apart: Apart | None) -> Map:
    run = plot[0].run
    ways = [along(path, path.start_s, path.end_s, IN_A_STEP * run.site.steps + 1) for path in run.site.paths.values()]
    heard = [run.sensors[id] for id in run.frames.senders() if id in run.sensors]
    box = framed(np.vstack([*ways, np.reshape(heard, (-1, 2))]))
    figure = Figure(figsize=(style.WIDTH, 4.6), layout="constrained")
    ratios = [1.25, 1.0] if apart else [1.0]
    whole, *close = figure.subplots(1, len(ratios), width_ratios=ratios, squeeze=False)[0]
    _draw(whole, plot, ways)
    scaled(whole, box)
    if apart:
        _draw(close[0], plot, ways)
        _close_up(whole, close[0], apart)
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns(labels), handlelength=3.2)
    return Map(figure, apart.text if apart else "")


def _draw(axes: Axes, plot: Sequence[Line], ways: Sequence[Array]) -> None:
    run, looks, named = plot[0].run, colours(plot), set[str]()
    axes.plot(*np.array(list(run.sensors.values())).T, "o", color="#c3cad4", ms=2.5, mew=0, label="sensor")
    for number, way in enumerate(ways):
        axes.plot(*way.T, color=style.TRUTH, lw=5.0, alpha=0.4, label=None if number else "true path")
    for line in plot:
        label = None if line.label in named else line.label
        axes.plot(*line.track.mean[:, :2].T, label=label, zorder=3, **line.look(looks))
        named.add(line.label)


def _close_up(whole: Axes, axes: Axes, apart: Apart) -> None:
    """Around the two points and where the target was, with a frame in the map that says where that is."""
    where = int(np.argmin(np.abs(apart.one.track.t_s - apart.t_s)))
    truth = apart.one.track.truth[where, :2]
    seen = np.vstack([apart.points, truth]) if np.isfinite(truth).all() else apart.points
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    half = max(0.75 * float(np.ptp(seen, axis=0).max()), CLOSE_M)
    low, high = middle - half, middle + half
    looks = colours([apart.one, apart.other])
    for line, point in zip((apart.one, apart.other), apart.points, strict=True):
        axes.plot(*point, "o", color=line.look(looks)["color"], mec=style.INK, mew=1.0, ms=8, zorder=5)
    if np.isfinite(truth).all():
        axes.plot(*truth, "s", color="white", mec=style.INK, mew=1.2, ms=7, zorder=5)
    scaled(axes, np.array([low, high]))
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1]), low])
    whole.plot(*corners.T, color=style.DEAD, lw=1.2, zorder=6)
