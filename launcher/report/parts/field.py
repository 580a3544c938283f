"""The figure of the field: the sensors, the paths of the targets, and the estimates of the trackers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import cycle
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter

from launcher.records import TRACKS
from launcher.report import style
from launcher.report.folder import Run
from launcher.report.parts.closeup import closeup, ellipses, largest
from launcher.report.tracks import Array, Track
from trackfield.world.path import Path

MUCH_LARGER: Final = 2.0
"""A field larger than the area of interest by this factor is shown in a small map of its own."""
IN_KM: Final = 3000.0
"""A picture wider or higher than this (m) has its axes in km."""
REPORTED: Final = "#3d9a62"
SENSORS: Final[Mapping[str, Mapping[str, Any]]] = {
    "no report sent": {"color": "#c3cad4", "mew": 0.0},
    "report in time": {"color": REPORTED, "mew": 0.0},
    "reports late, but fused": {"color": REPORTED, "markeredgecolor": style.OUTCOMES["late"], "mew": 1.2},
    "reports too late": {"color": style.OUTCOMES["late"], "mew": 0.0},
    "reports ignored": {"color": style.OUTCOMES["ignored"], "mew": 0.0},
    "reports lost": {"color": "white", "markeredgecolor": style.OUTCOMES["radio"], "mew": 1.0},
}
"""The look of a sensor, by the best outcome of its reports."""
WORDS: Final = {"fusion": "fusion centre"}
"""The names of roles that track; others keep their own."""
MARKERS: Final = ("^", "s", "D")
"""Those of roles that track, in their order."""
FEW: Final = 10
"""So many places that track can be drawn large."""
IN_A_STEP: Final = 4
"""Points of a true path in a step."""
IN_A_GAP: Final = 20
"""Points of a true path in a gap of its data."""
HALO: Final = withStroke(linewidth=2.0, foreground="white")
"""Makes a name legible on any background."""
ROOM_IN: Final = (0.36, 0.16)
"""The width and height of the name of a sensor in a picture, in inches."""
MAP_IN: Final = 5.3
"""Width of the map on the page, in inches."""
BESIDE_IN: Final = 2.2
"""Width of what stands beside the map, in inches."""
FLAT: Final = 0.55
"""A map whose height is less than this part of its width has it below instead."""
ELLIPSES: Final = 12
"""The number of ellipses along a track."""
LARGEST: Final = 0.3
"""Larger ellipses, relative to the map, are not drawn."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``: whether there is a track, and a close-up."""
    return {"near": largest(run) is not None, "tracked": any(track.known.any() for track in run.tracks)}


def field(run: Run) -> Figure:
    """The tracks in the field, or around the paths if the field is much larger; a close-up of the largest error."""
    sensors = np.array(list(run.sensors.values()))
    points = IN_A_STEP * run.site.steps + 1
    ways = {target: along(path, path.start_s, path.end_s, points) for target, path in run.site.paths.items()}
    passed = np.vstack(list(ways.values())) if ways else sensors
    box = framed(np.vstack([passed, _at(run, run.frames.senders())]))
    whole = framed(np.vstack([passed, sensors]))
    aside = bool((np.ptp(whole, axis=0) > MUCH_LARGER * np.ptp(box, axis=0)).any())
    if not aside:
        box = whole
    figure, axes, beside = _sheet(box, aside=aside)
    _sensors(axes, run, sensors, box)
    _truths(axes, run, ways)
    _hearing(axes, run, next(iter(ways.values()), passed), box)
    for track in run.tracks:
        _track(axes, run, track, box)
    _centres(axes, run)
    scaled(axes, box)
    _legend(beside[0], axes)
    if aside:
        _map(beside[1], sensors, whole, box)
    closeup(beside[-1], axes, run, ways)
    return figure


# --- the sheet --------------------------------------------------------------------------------------------------------


def framed(points: Array) -> Array:
    """(2, 2) lower and upper corner of what is shown around these points."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = float((high - low).max())
    margin = 0.06 * span + min(10.0, 0.1 * span + 1.0)
    return np.array([low - margin, high + margin])


def _sheet(box: Array, *, aside: bool) -> tuple[Figure, Axes, list[Axes]]:
    """A map, and blank axes for a legend, a map of the whole field if it is ``aside``, and a close-up.

    They are beside the map, or below one that is much wider than high.
    """
    wide, high = np.ptp(box, axis=0)
    heights = [2.3, 1.3, 2.3] if aside else [2.3, 2.3]
    if high < FLAT * wide:
        across = style.WIDTH * high / wide + 0.4
        figure = Figure(figsize=(style.WIDTH, across + 2.6), layout="constrained")
        grid = figure.add_gridspec(2, len(heights), height_ratios=[across, 2.3])
        places = [grid[1, column] for column in range(len(heights))]
        axes = figure.add_subplot(grid[0, :])
    else:
        height = float(np.clip(MAP_IN * high / wide + 0.5, sum(heights) + 0.2, 7.0))
        figure = Figure(figsize=(style.WIDTH, height), layout="constrained")
        grid = figure.add_gridspec(len(heights), 2, width_ratios=[MAP_IN, BESIDE_IN], height_ratios=heights)
        places = [grid[row, 1] for row in range(len(heights))]
        axes = figure.add_subplot(grid[:, 0], anchor="N")
    beside = [figure.add_subplot(place) for place in places]
    for one in beside:
        one.set_axis_off()
    return figure, axes, beside


def scaled(axes: Axes, box: Array) -> None:
    """What the map shows, in metres or kilometres."""
    axes.set(xlim=box[:, 0], ylim=box[:, 1], xlabel="east [m]", ylabel="north [m]", aspect="equal")
    if np.ptp(box, axis=0).max() > IN_KM:
        axes.set(xlabel="east [km]", ylabel="north [km]")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda metres, _: f"{metres / 1000:g}"))


def _legend(axes: Axes, chart: Axes) -> None:
    """The legend of the map."""
    drawn = axes.legend(
        *chart.get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(-0.1, 1.0), borderaxespad=0
    )
    for line in drawn.get_lines():
        if line.get_linestyle() == "-":
            line.set_linewidth(max(line.get_linewidth(), 1.8))  # whatever the map needs


def _map(axes: Axes, sensors: Array, whole: Array, box: Array) -> None:
    """The whole field, with what the large picture shows of it."""
    axes.set_axis_on()
    axes.plot(*sensors.T, ",", color="#8d97a5")
    axes.plot(box[[0, 1, 1, 0, 0], 0], box[[0, 0, 1, 1, 0], 1], color=style.DEAD, lw=1.2)
    axes.set(xlim=whole[:, 0], ylim=whole[:, 1], aspect="equal", anchor="NW", xticks=[], yticks=[])
    axes.grid(visible=False)
    sides = np.ptp(whole, axis=0)
    unit, metres = ("km", 1000.0) if sides.max() > IN_KM else ("m", 1.0)
    east, north = (f"{side / metres:,.3g}" if metres > 1 else f"{side:,.0f}" for side in sides)
    axes.set_title(f"whole field: {east} x {north} {unit}", fontsize=7.5, loc="left")


# --- what stands there ------------------------------------------------------------------------------------------------


def _at(run: Run, ids: Collection[str]) -> Array:
    return np.array([run.sensors[id] for id in sorted(ids) if id in run.sensors], float).reshape(-1, 2)


def fates(run: Run) -> dict[str, set[str]]:
    """The sensors by the best outcome of their reports, as ``SENSORS`` names it."""
    best = {
        "report in time": run.frames.senders("delivered"),
        "reports late, but fused": run.frames.those(run.fused_late),
        "reports too late": run.frames.senders("late"),
        "reports ignored": run.frames.senders("ignored"),
        "reports lost": run.frames.senders(),
    }
    found: dict[str, set[str]] = {}
    told: set[str] = set()
    for label, senders in best.items():
        found[label] = senders - told
        told |= senders
    return found


def _sensors(axes: Axes, run: Run, sensors: Array, box: Array) -> None:
    shown = sensors[((sensors >= box[0]) & (sensors <= box[1])).all(axis=1)]
    size = style.size(len(shown))
    for label, places in {
        "no report sent": sensors,
        **{name: _at(run, ids) for name, ids in fates(run).items()},
    }.items():
        if len(places):
            axes.plot(*places.T, "o", ms=size, label=label, **SENSORS[label])
    dead = _at(run, dead_sensors(run))
    if len(dead):
        axes.plot(*dead.T, "x", color=style.DEAD, ms=size + 3, mew=1.6, label="died", zorder=6)
    _names(axes, run, box)


def _names(axes: Axes, run: Run, box: Array) -> None:
    """The names of sensors that reported, as many as there is room for."""
    room = np.array(ROOM_IN) * float(np.ptp(box[:, 0])) / MAP_IN
    taken: list[Array] = []
    for id in sorted(run.frames.senders() & run.sensors.keys()):
        place = np.array(run.sensors[id])
        if not any((np.abs(place - other) < room).all() for other in taken):
            taken.append(place)
            axes.annotate(
                id, (place[0], place[1]), (2.5, 2.5), textcoords="offset points", fontsize=6, color=style.SOFT,
                zorder=5, annotation_clip=True, path_effects=[HALO],
            )  # fmt: skip


def dead_sensors(run: Run) -> set[str]:
    """The processes that were killed, died, or ran out of energy, for good or for a while."""
    killed = ("kill", "restart", "container-kill", "container-restart")
    planned = {id for _, id, text in run.marks if text.startswith(killed)}
    empty = {one["id"] for one in run.metrics["lifetime_s"].get("empty") or []}
    return planned | empty | {one["id"].partition("~")[0] for one in run.metrics["processes"]["died"] or []}


def _hearing(axes: Axes, run: Run, way: Array, box: Array) -> None:
    """The hearing radius, around a sensor that reported near the middle of a path, if it fits into the picture.

    None where all that sensors do is to play what was recorded.
    """
    radius = max((kind.report_m for kind in run.site.sensing.values() if not kind.recorded), default=0.0)
    places = _at(run, run.frames.senders())
    if not radius or not len(places) or radius > float(np.ptp(box, axis=0).max()):
        return
    middle = way[len(way) // 2]
    place = min(places, key=lambda one: float(np.hypot(*(one - middle))))
    look = {"fill": False, "ec": REPORTED, "lw": 1.0, "ls": (0, (4, 3)), "zorder": 1.8}
    axes.add_patch(Circle((place[0], place[1]), radius, label=f"hearing radius, {radius:,.0f} m", **look))


# --- what moves -------------------------------------------------------------------------------------------------------


def _truths(axes: Axes, run: Run, ways: Mapping[str, Array]) -> None:
    """The paths of the targets; several have their names at their starts."""
    for number, (target, way) in enumerate(ways.items()):
        axes.plot(*way.T, color=style.TRUTH, lw=5.0, alpha=0.45, label=None if number else "true path", zorder=2)
        label = None if number else "start"
        axes.plot(*way[0], "o", color="white", mec=style.INK, mew=1.2, ms=6, label=label, zorder=7)
        if run.several:
            axes.annotate(target, way[0], (7, -9), textcoords="offset points", path_effects=[HALO], zorder=8)
    gaps = [(path, gap) for path in run.site.paths.values() for gap in path.guessed_inside]
    for number, (path, gap) in enumerate(gaps):
        label = None if number else "truth interpolated"
        axes.plot(*along(path, *gap, IN_A_GAP).T, ":", color=style.GAP, lw=2.0, label=label, zorder=3)


def along(path: Path, from_s: float, to_s: float, points: int) -> Array:
    """(points, 2) where a target was between two times at which it was there, m."""
    return np.array([state[:2] for t in np.linspace(from_s, to_s, points) if (state := path.at(t))])


def _track(axes: Axes, run: Run, track: Track, box: Array) -> None:
    """A line, thin where there were no reports, with an ellipse now and then."""
    colour, line = style.colour(run, track.tracker), style.width(len(track.t_s))
    first = next(one for one in run.tracks if one.tracker == track.tracker) is track
    axes.plot(*track.mean[:, :2].T, "-", color=colour, lw=max(line / 2, 0.5), zorder=4)
    informed = np.where(track.coasting[:, None], np.nan, track.mean[:, :2])
    axes.plot(*informed.T, "-", color=colour, lw=line, label=track.tracker if first else None, zorder=4)
    there = np.flatnonzero(track.known)
    some = np.unique(there[np.linspace(0, len(there) - 1, ELLIPSES).astype(int)]) if len(there) else there
    most = LARGEST * float(np.ptp(box, axis=0).max())
    ellipses(axes, track, some, colour, largest_m=most, label="95 % ellipses" if track is run.tracks[0] else None)


def _centres(axes: Axes, run: Run) -> None:
    """The places that track, by role, and the routes of processes that move."""
    roles: dict[str, list[tuple[float, float]]] = {}
    for place in run.tagged(TRACKS):
        roles.setdefault(place.role, []).append((place.x, place.y))
    for (role, points), marker in zip(roles.items(), cycle(MARKERS), strict=False):
        size = 9 if len(points) <= FEW else 5
        axes.plot(*np.array(points).T, marker, color=style.INK, ms=size, label=WORDS.get(role, role), zorder=1.9)
    for id, legs in run.field.routes:
        label = "its route" if len(run.field.routes) == 1 else f"route of {id}"
        axes.plot(*np.array(legs)[:, 1:].T, "--", color=style.INK, lw=1.0, label=label, zorder=2)


FIGURES: Final[style.Figures] = {"field": field}
