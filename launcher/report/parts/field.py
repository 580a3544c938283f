"""The figure of the field: where the sensors stand, where the targets went, and where the trackers saw them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from launcher.records import ARRIVED, TRACKS
from launcher.report import style
from launcher.report.folder import Run
from launcher.report.tracks import Array, Track
from trackfield.world.path import Path

MUCH_LARGER: Final = 2.0
"""A field so much larger than what happened in it is shown in a small map of its own."""
REPORTED: Final = "#3d9a62"
WORDS: Final = {"fusion": "fusion centre"}
"""For roles that track; others go by their own name."""
IN_A_STEP: Final = 4
"""Points of a true path in a step,"""
IN_A_GAP: Final = 20
"""and in a gap of its data."""
HALO: Final = withStroke(linewidth=2.0, foreground="white")
"""Makes a name legible on whatever lies below it."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``: the figure says it all."""
    return {}


def field(run: Run) -> Figure:
    """The track over the field; what is near the paths, if the field is much larger."""
    sensors = np.array(list(run.sensors.values()))
    heard, tried = run.frames.senders(*ARRIVED), run.frames.senders()
    points = IN_A_STEP * run.site.steps + 1
    ways = {target: _along(path, path.start_s, path.end_s, points) for target, path in run.site.paths.items()}
    passed = np.vstack(list(ways.values()))
    box, whole = _box(np.vstack([passed, _at(run, tried)])), _box(np.vstack([passed, sensors]))
    aside = bool((np.ptp(whole, axis=0) > MUCH_LARGER * np.ptp(box, axis=0)).any())
    if not aside:
        box = whole
    figure = Figure(figsize=(style.WIDTH, _height(box)), layout="constrained")
    axes = figure.subplots()
    _sensors(axes, run, sensors, heard, tried, box)
    _truths(axes, run, ways)
    for track in run.tracks:
        _track(axes, run, track)
    _centres(axes, run)
    axes.set(xlim=box[:, 0], ylim=box[:, 1], xlabel="east [m]", ylabel="north [m]", aspect="equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, labelspacing=0.7)
    if aside:
        _map(axes, sensors, whole, box)
    return figure


def _at(run: Run, ids: Collection[str]) -> Array:
    return np.array([run.sensors[id] for id in sorted(ids) if id in run.sensors], float).reshape(-1, 2)


def _box(points: Array) -> Array:
    """(2, 2) lower and upper corner of what is shown around these points."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.06 * float((high - low).max()) + 10.0
    return np.array([low - margin, high + margin])


def _height(box: Array) -> float:
    wide, high = np.ptp(box, axis=0)
    return float(np.clip(0.74 * style.WIDTH * high / wide + 0.6, 3.2, 7.4))


def _sensors(axes: Axes, run: Run, sensors: Array, heard: Collection[str], tried: Collection[str], box: Array) -> None:
    shown = sensors[((sensors >= box[0]) & (sensors <= box[1])).all(axis=1)]
    size = float(np.clip(70 / max(len(shown), 1) ** 0.5, 1.0, 5.0))
    points: dict[str, tuple[Array, dict[str, Any]]] = {
        "sensor": (sensors, {"color": "#c3cad4"}),
        "report arrived": (_at(run, heard), {"color": REPORTED}),
        "reported in vain": (_at(run, set(tried) - set(heard)), {"markeredgecolor": REPORTED, "color": "white"}),
    }
    for label, (places, look) in points.items():
        if len(places):
            axes.plot(*places.T, "o", ms=size, mew=1.0 if label.endswith("vain") else 0.0, label=label, **look)
    dead = _at(run, dead_sensors(run))
    if len(dead):
        axes.plot(*dead.T, "x", color=style.DEAD, ms=size + 3, mew=1.6, label="died", zorder=6)


def dead_sensors(run: Run) -> set[str]:
    """Those that were killed, died, or ran out of power, for good or for a while."""
    planned = {id for _, id, text in run.marks if text.startswith(("kill", "restart"))}
    empty = {one["id"] for one in run.metrics["lifetime_s"].get("empty") or []}
    return planned | empty | {one["id"].partition("~")[0] for one in run.metrics["processes"]["died"] or []}


def _truths(axes: Axes, run: Run, ways: Mapping[str, Array]) -> None:
    """Where the targets were; several have their names where they began."""
    for number, (target, way) in enumerate(ways.items()):
        axes.plot(*way.T, color=style.TRUTH, lw=5.0, alpha=0.45, label=None if number else "true path", zorder=2)
        label = None if number else "start"
        axes.plot(*way[0], "o", color="white", mec=style.INK, mew=1.2, ms=6, label=label, zorder=7)
        if run.several:
            axes.annotate(target, way[0], (7, 4), textcoords="offset points", path_effects=[HALO], zorder=8)
    gaps = [(path, gap) for path in run.site.paths.values() for gap in path.gaps]
    for number, (path, gap) in enumerate(gaps):
        label = None if number else "no data (interpolated)"
        axes.plot(*_along(path, *gap, IN_A_GAP).T, ":", color=style.GAP, lw=2.0, label=label, zorder=3)


def _along(path: Path, from_s: float, to_s: float, points: int) -> Array:
    """(points, 2) where a target was between two times at which it was there, m."""
    return np.array([state[:2] for t in np.linspace(from_s, to_s, points) if (state := path.at(t))])


def _track(axes: Axes, run: Run, track: Track) -> None:
    """A line, thin where there were no reports."""
    colour, line = style.colour(run, track.tracker), style.width(len(track.t_s))
    first = next(one for one in run.tracks if one.tracker == track.tracker) is track
    axes.plot(*track.mean[:, :2].T, "-", color=colour, lw=max(line / 2, 0.5), zorder=4)
    informed = np.where(track.coasting[:, None], np.nan, track.mean[:, :2])
    axes.plot(*informed.T, "-", color=colour, lw=line, label=track.tracker if first else None, zorder=4)


def _centres(axes: Axes, run: Run) -> None:
    """Who tracks, by role, and the way of one that drives."""
    roles: dict[str, list[tuple[float, float]]] = {}
    for place in run.tagged(TRACKS):
        roles.setdefault(place.role, []).append((place.x, place.y))
    for role, points in roles.items():
        axes.plot(*np.array(points).T, "^", color=style.INK, ms=9, label=WORDS.get(role, role), zorder=1.9)
    if run.site.route:
        axes.plot(*np.array(run.site.route)[:, 1:].T, "--", color=style.INK, lw=1.0, label="its way", zorder=2)


def _map(axes: Axes, sensors: Array, whole: Array, box: Array) -> None:
    """The whole field below the legend, with what the large picture shows of it."""
    small = axes.inset_axes((1.03, 0.0, 0.25, 0.25))
    small.plot(*sensors.T, ",", color="#8d97a5")
    small.plot(box[[0, 1, 1, 0, 0], 0], box[[0, 0, 1, 1, 0], 1], color=style.DEAD, lw=1.2)
    small.set(xlim=whole[:, 0], ylim=whole[:, 1], aspect="equal", anchor="SW", xticks=[], yticks=[])
    small.grid(visible=False)
    east, north = np.ptp(whole, axis=0)
    small.set_title(f"whole field\n{east:,.0f} x {north:,.0f} m", fontsize=7.5, loc="left")


FIGURES: Final[style.Figures] = {"field": field}
