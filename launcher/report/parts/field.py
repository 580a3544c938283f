"""The figure of the field: where the sensors stand, where the target went, and where the trackers saw it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.records import ARRIVED
from launcher.report import style
from launcher.report.folder import Array, Run, Track

MUCH_LARGER: Final = 2.0
"""A field so much larger than what happened in it is shown in a small map of its own."""
REPORTED: Final = "#3d9a62"


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``: the figure says it all."""
    return {}


def field(run: Run) -> Figure:
    """The track over the field; what is near the path, if the field is much larger."""
    sensors = np.array([place[1:] for place in run.site.sensors])
    heard, tried = run.frames.senders(*ARRIVED), run.frames.senders()
    path = _path(run)
    box, whole = _box(np.vstack([path, _at(run, tried)])), _box(np.vstack([path, sensors]))
    aside = bool((np.ptp(whole, axis=0) > MUCH_LARGER * np.ptp(box, axis=0)).any())
    if not aside:
        box = whole
    figure = Figure(figsize=(style.WIDTH, _height(box)), layout="constrained")
    axes = figure.subplots()
    _sensors(axes, run, sensors, heard, tried, box)
    _truth(axes, run, path)
    for track in run.tracks:
        _track(axes, run, track)
    _centre(axes, run)
    axes.set(xlim=box[:, 0], ylim=box[:, 1], xlabel="east [m]", ylabel="north [m]", aspect="equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, labelspacing=0.7)
    if aside:
        _map(axes, sensors, whole, box)
    return figure


def _path(run: Run) -> Array:
    """(n, 2) where the target was, at each step and a few times in between; m."""
    every_s = run.end_s / max(4 * run.site.steps, 1)
    states = [next(iter(run.site.paths.values())).at(i * every_s) for i in range(4 * run.site.steps + 1)]
    return np.array([state[:2] if state else (np.nan, np.nan) for state in states], float)


def _at(run: Run, ids: Collection[str]) -> Array:
    return np.array([run.places[id] for id in sorted(ids) if id in run.places], float).reshape(-1, 2)


def _box(points: Array) -> Array:
    """(2, 2) lower and upper corner of what is shown around these points."""
    known = points[np.isfinite(points).all(axis=1)]
    low, high = known.min(axis=0), known.max(axis=0)
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


def _truth(axes: Axes, run: Run, path: Array) -> None:
    axes.plot(*path.T, color=style.TRUTH, lw=5.0, alpha=0.45, label="true path", zorder=2)
    known = path[np.isfinite(path).all(axis=1)]
    axes.plot(*known[0], "o", color="white", mec=style.INK, mew=1.2, ms=6, label="start", zorder=7)
    for index, (begin, end) in enumerate(next(iter(run.site.paths.values())).gaps):
        states = [next(iter(run.site.paths.values())).at(t) for t in np.linspace(begin, end, 20)]
        line = np.array([state[:2] for state in states if state])
        if len(line):
            axes.plot(
                *line.T, ":", color=style.GAP, lw=2.0, label=None if index else "no data (interpolated)", zorder=3
            )


def _track(axes: Axes, run: Run, track: Track) -> None:
    """A line, thin where there were no reports."""
    colour, line = style.colour(run, track.tracker), style.width(len(track.t_s))
    first = next(one for one in run.tracks if one.tracker == track.tracker) is track
    axes.plot(*track.mean[:, :2].T, "-", color=colour, lw=max(line / 2, 0.5), zorder=4)
    informed = np.where(track.coasting[:, None], np.nan, track.mean[:, :2])
    axes.plot(*informed.T, "-", color=colour, lw=line, label=track.tracker if first else None, zorder=4)


def _centre(axes: Axes, run: Run) -> None:
    axes.plot(*run.site.centre, "^", color=style.INK, ms=9, label="fusion centre", zorder=1.9)
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
