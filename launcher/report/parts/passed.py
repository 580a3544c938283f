"""A map of an event: the true path, the sensors by their use, the fixes, and the lines from which ECPA chose."""

from __future__ import annotations

import textwrap
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse
from matplotlib.ticker import MaxNLocator

from launcher.heard import Event, Line, Outcome
from launcher.report import style
from launcher.report.folder import Run
from launcher.report.parts.closeup import SCALE
from trackfield.role import NS

MARGIN: Final = 0.35
"""Beyond the sensors of an event so much of their extent is shown."""
LEAST_M: Final = 15.0
LONE: Final = "#e69f00"
HEARD: Final = "#0072b2"
REST: Final = "#c6ced8"
LETTERS: Final = 40
"""So many letters are as wide as a map."""
BESIDE_S: Final = 15.0
"""So much of the true path before and after is drawn, as far as it is in the picture."""


def draw(axes: Axes, run: Run, event: Event) -> None:
    """An event in its surroundings."""
    places = run.sensors
    used = np.array([places[id] for id in event.ranked if id in places]).reshape(-1, 2)
    middle, half = _box(used if len(used) else np.array(list(places.values())), event)
    _truth(axes, run, event)
    everywhere = np.array(list(places.values()))
    axes.plot(*everywhere.T, "o", color="white", mec=REST, mew=1.0, ms=4.0, zorder=3)
    axes.plot(*used.T, "o", color=HEARD, ms=5.0, mew=0.0, zorder=4)
    if event.tried is not None and event.tried.lone in places:
        axes.plot(*places[event.tried.lone], "o", color=LONE, ms=6.5, mew=0.0, zorder=5)
    for line in event.tried.lines if event.tried else ():
        ends = _through(line, 3.0 * half)
        axes.plot(*ends.T, color=style.SOFT, lw=0.7, ls=":", zorder=2)
    for id in event.ranked:
        if id in places:
            axes.annotate(id, places[id], (4, 3), textcoords="offset points", fontsize=6, color=style.INK, zorder=6)
    for outcome in event.outcomes:
        if outcome.line is not None:
            _fix(axes, outcome, outcome.line, style.colour(run, outcome.tracker), 3.0 * half)
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=6.5)
    refused = {one.refused for one in event.outcomes if one.refused}
    said = textwrap.wrap("; ".join(sorted(refused)), LETTERS)
    title = f"{(event.begin_ns - run.site.origin_ns) / NS:.1f} s, {event.head}{':' if said else ''}"
    axes.set_title("\n".join([title, *said]), fontsize=7.5, loc="left")


def entries(run: Run) -> tuple[list[Any], list[str]]:
    """Handles and labels of the legend."""
    dot: dict[str, Any] = {"ls": "", "marker": "o", "ms": 5.0}
    found: list[tuple[Any, str]] = [
        (Line2D([], [], color=style.TRUTH, lw=3.5, alpha=0.45), "true path"),
        (Line2D([], [], color=HEARD, mew=0.0, **dot), "sensor with a report"),
        (Line2D([], [], color=LONE, mew=0.0, **dot), "lone sensor"),
        (Line2D([], [], color="white", mec=REST, **dot), "other sensor"),
        (Line2D([], [], color=style.SOFT, lw=0.9, ls=":"), "candidates"),
        *((Line2D([], [], color=style.colour(run, name), lw=1.6), name) for name in run.metrics["passes"]["trackers"]),
    ]
    return [handle for handle, _ in found], [label for _, label in found]


def _box(used: Any, event: Event) -> tuple[Any, float]:
    """The middle of the picture and half of its width, which also holds where fixes are published."""
    lines = [one.line for one in event.outcomes if one.line is not None]
    ends = np.array([line[:2] for line in lines]).reshape(-1, 2)
    size = float(np.ptp(used, axis=0).max(initial=0.0))
    near = ends[(np.abs(ends - used.mean(axis=0)) < 2.0 * size + LEAST_M).all(axis=1)]
    points = np.concatenate((used, near))
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, max((0.5 + MARGIN / 2.0) * float((high - low).max()), LEAST_M)


def _truth(axes: Axes, run: Run, event: Event) -> None:
    """The true paths around the time of the event."""
    middle_s = event.outcomes[0].event_ns / NS
    times = np.arange(middle_s - BESIDE_S, middle_s + BESIDE_S, 0.1)
    for path in run.site.paths.values():
        way = np.array([state[:2] for t_s in times if (state := path.at(float(t_s))) is not None]).reshape(-1, 2)
        axes.plot(*way.T, color=style.TRUTH, lw=4.0, alpha=0.45, zorder=1.5)


def _through(line: Line, reach_m: float) -> Any:
    """The ends (2, 2) of a piece of a line, to both sides of where its state is."""
    x, y, vx, vy = line
    along = np.array([vx, vy]) / max(float(np.hypot(vx, vy)), 1e-9)
    return np.array([x, y]) + np.outer([-reach_m, reach_m], along)


def _fix(axes: Axes, outcome: Outcome, line: Line, colour: str, reach_m: float) -> None:
    """The line backwards from where it was published, an arrow there, and the 95 % ellipse."""
    begin, _ = _through(line, reach_m)
    end = np.array(line[:2])
    axes.plot(*np.array([begin, end]).T, color=colour, lw=1.3, zorder=4.5)
    speed = max(float(np.hypot(*line[2:])), 1e-9)
    ahead = end + np.array(line[2:]) / speed * 0.06 * reach_m
    tip, tail = (float(ahead[0]), float(ahead[1])), (float(end[0]), float(end[1]))
    axes.annotate("", tip, tail, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.3}, zorder=6)
    values, vectors = np.linalg.eigh(np.reshape(outcome.covariance, (4, 4))[:2, :2])
    short, long = 2.0 * SCALE * np.sqrt(np.maximum(values, 0.0))
    angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    look = {"facecolor": (*to_rgb(colour), 0.10), "edgecolor": colour, "lw": 0.8, "zorder": 4.0}
    axes.add_patch(Ellipse(tail, float(long), float(short), angle=angle, **look))
