"""A close-up of the largest error: the track, the truth, and the tracker's own covariance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Ellipse, Rectangle
from matplotlib.ticker import MaxNLocator

from launcher.report import style
from launcher.report.cells import number
from launcher.report.folder import Run
from launcher.report.tracks import Array, Track

SCALE: Final = 2.447746830680816
"""Standard deviations to the 95 % ellipse: the root of the chi-square point of 2 degrees of freedom."""
AROUND: Final = 2
"""Steps before and after that are shown with ellipses."""
LED: Final = 10
"""Steps before and after that are shown."""
MARGIN: Final = 1.6
"""The size of the picture, relative to what it shows."""
LEAST_MARK: Final = 0.02
"""The smallest frame in the map, relative to its width: a smaller one could not be seen."""
MOST_MARK: Final = 0.3
"""The largest frame: a larger one is not drawn."""


def ellipses(
    axes: Axes, track: Track, steps: Iterable[int], colour: str, *, largest_m: float, label: str | None = None
) -> None:
    """The 95 % ellipses of a track's position at some of its steps, unless they are larger than ``largest_m``."""
    for step in steps:
        covariance = track.covariance[step, :2, :2]
        if not np.isfinite(covariance).all():
            continue
        values, vectors = np.linalg.eigh(covariance)
        if values[0] < 0.0 or SCALE * values[1] ** 0.5 > largest_m:
            continue
        short, long = 2 * SCALE * np.sqrt(values)
        angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
        x, y = track.mean[step, :2].tolist()
        look = {"facecolor": (*to_rgb(colour), 0.08), "edgecolor": colour, "lw": 0.7, "zorder": 3.8}
        axes.add_patch(Ellipse((x, y), float(long), float(short), angle=angle, label=label, **look))
        label = None


def largest(run: Run) -> tuple[Track, int] | None:
    """The first track with an error, and the step at which that is largest, outside the gaps of the data."""
    for track in run.tracks:
        if track.scored.any():
            return track, int(np.argmax(np.where(track.scored, track.error_m, -1.0)))
    return None


def closeup(axes: Axes, chart: Axes, run: Run, ways: Mapping[str, Array]) -> None:
    """Draw the surroundings of the largest error of the first tracker, and a frame in the large picture."""
    found = largest(run)
    if found is None:
        return
    track, worst = found
    axes.set_axis_on()
    mean, truth = track.mean[worst, :2], track.truth[worst, :2]
    middle, half = (mean + truth) / 2, _half(track, worst)
    for way in ways.values():
        axes.plot(*way.T, color=style.TRUTH, lw=5.0, alpha=0.45, zorder=2)
    for other in run.tracks:
        colour = style.colour(run, other.tracker)
        way = np.abs(other.t_s - track.t_s[worst]) <= (LED + 0.5) * run.step_s
        axes.plot(*other.mean[way, :2].T, ".-", color=colour, lw=1.2, ms=4, zorder=4)
        near = np.flatnonzero(np.abs(other.t_s - track.t_s[worst]) <= (AROUND + 0.5) * run.step_s)
        ellipses(axes, other, near, colour, largest_m=2 * half)
    axes.plot(*track.truth[:, :2].T, "o", color="white", mec=style.TRUTH, ms=3, mew=0.9, zorder=3)
    axes.plot(*np.array([mean, truth]).T, "-", color=style.DEAD, lw=1.3, zorder=5)
    places = np.array(list(run.sensors.values()))
    shown = int((np.abs(places - middle) <= half).all(axis=1).sum())
    axes.plot(*places.T, "o", color="#a9b4c2", ms=style.size(shown) / 1.5, mew=0, zorder=1.5)
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
    axes.set_anchor("NW")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(3))
    axes.tick_params(labelsize=7)
    error = number(float(track.error_m[worst]), "m")
    axes.set_title(f"largest error of {track.tracker},\n{error} at {track.t_s[worst]:g} s", fontsize=7.5, loc="left")
    _frame(chart, middle, half)


def _half(track: Track, step: int) -> float:
    """Half the width of the picture, m: it holds the error, an ellipse of up to that size, and a step."""
    error = float(track.error_m[step])
    sd = float(np.sqrt(max(np.nanmax(np.diag(track.covariance[step])[:2]), 0.0)))
    dt = float(np.median(np.diff(track.t_s))) if len(track.t_s) > 1 else 0.0
    moved = float(np.hypot(*track.truth[step, 2:])) * dt
    return MARGIN * max(error / 2 + min(SCALE * sd, error), 0.6 * moved, 0.5)


def _frame(chart: Axes, middle: Array, half: float) -> None:
    """Mark the close-up in the large picture."""
    width = float(np.ptp(np.array(chart.get_xlim())))
    if half > MOST_MARK * width:
        return
    least = LEAST_MARK * width
    side = max(half, least)
    corner = float(middle[0]) - side, float(middle[1]) - side
    chart.add_patch(Rectangle(corner, 2 * side, 2 * side, fill=False, ec=style.INK, lw=0.9, zorder=9))
