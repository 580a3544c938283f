"""Pan and tilt over time: as the camera was told, as it was, and as it would have to be to look at each target."""

from __future__ import annotations

from math import atan, degrees, radians, tan
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from launcher.outside import Outside
from launcher.record.figures.camera.judged import Judge
from launcher.report import style
from launcher.report.folder import Run
from launcher.report.tracks import Array
from trackfield.models.pointing import EVI_D30, towards
from trackfield.role import NS

POINTS: Final = 2000
"""So many instants of the true direction are drawn."""
TOLD: Final = "#d55e00"
LOOKED: Final = "#0072b2"
SEEN: Final = "#009e73"
HALF: Final = (EVI_D30.wide / 2, degrees(atan(tan(radians(EVI_D30.wide / 2)) * EVI_D30.height / EVI_D30.width)))
"""Half of what the picture shows at its middle, across and upwards (deg)."""


def figure(run: Run, judge: Judge) -> Figure:
    """Pan, tilt, and what waited in the gateway."""
    drawn, (pan, tilt, queue) = style.blank(5.6, 3, ratios=(3.0, 2.0, 1.0))
    for place, axes in enumerate((pan, tilt)):
        _truth(axes, run, judge.outside, place)
        _looked(axes, run, judge, place)
        _told(axes, run, judge, place)
        _aims(axes, run, judge, place)
    _frames(pan, run, judge)
    _queue(queue, run, judge.outside)
    for axes in (pan, tilt, queue):
        style.over_time(axes, run, named=axes is pan)
    reach = max([EVI_D30.pan, *(abs(one.pan_deg) for one in judge.outside.shots)])
    pan.set(ylabel="pan [°]", ylim=(-1.15 * reach, 1.15 * reach), xlabel="")
    pan.yaxis.set_major_locator(MultipleLocator(50))
    tilt.set(ylabel="tilt [°]", ylim=(-1.1 * EVI_D30.tilt, 1.1 * EVI_D30.tilt), xlabel="")
    for axes, limit in ((pan, EVI_D30.pan), (tilt, EVI_D30.tilt)):
        for side in (-limit, limit):
            axes.axhline(side, color=style.SOFT, lw=0.7, ls=":")
    style.legend(pan, columns=4)
    return drawn


def _seconds(run: Run, t_ns: int) -> float:
    return (t_ns - run.site.origin_ns) / NS


def _truth(axes: Axes, run: Run, outside: Outside, place: int) -> None:
    """The direction of each target from the camera; the line breaks where that is behind it, and without a target."""
    end_s = min(run.end_s, run.metrics["ended_s"])
    times = np.linspace(0.0, max(end_s, 0.0), POINTS)
    for number, path in enumerate(run.site.paths.values()):
        states = [path.at(run.origin_s + t_s) for t_s in times]
        values = np.array(
            [towards(outside.mount, *state[:2])[place] if state is not None else np.nan for state in states]
        )
        if place == 0:
            values[1:][np.abs(np.diff(values)) > 180.0] = np.nan
        label = None if number else "where each target was" if run.several else "where the target was"
        axes.plot(times, values, color=style.TRUTH, lw=3.5, alpha=0.45, label=label)


def _looked(axes: Axes, run: Run, judge: Judge, place: int) -> None:
    """Where the camera looked, and how far its picture reaches to each side of that."""
    times = _instants(judge)
    looks = [judge.outside.look_at(t_ns) for t_ns in times]
    values: Array = np.array([np.nan if look is None else look[place] for look in looks])
    shown = [_seconds(run, t_ns) for t_ns in times]
    axes.fill_between(
        shown, values - HALF[place], values + HALF[place], color=LOOKED, alpha=0.10, lw=0, label="picture"
    )
    axes.plot(shown, values, color=LOOKED, lw=1.6, label="where the camera looked")


def _instants(judge: Judge) -> list[int]:
    """The ends of all straight pieces of where the camera looked (ns)."""
    found = {judge.end_ns}
    begins = [*(one.t_ns for one in judge.outside.turns), judge.end_ns + 1]
    for turn, after_ns in zip(judge.outside.turns, begins[1:], strict=True):
        until_ns = after_ns - 1
        axes_s = [
            abs(turn.pan1 - turn.pan0) / turn.pan_deg_s if turn.pan_deg_s else 0.0,
            abs(turn.tilt1 - turn.tilt0) / turn.tilt_deg_s if turn.tilt_deg_s else 0.0,
        ]
        found |= {turn.t_ns, until_ns}
        found |= {at_ns for one in axes_s if (at_ns := turn.t_ns + round(min(one, 1e6) * NS)) < until_ns}
    return sorted(t_ns for t_ns in found if t_ns <= judge.end_ns)


def _told(axes: Axes, run: Run, judge: Judge, place: int) -> None:
    """Where the camera was told to look last."""
    shots = judge.outside.shots
    if shots:
        times = [*(_seconds(run, one.t_ns) for one in shots), _seconds(run, judge.end_ns)]
        values = [one.to[place] for one in (*shots, shots[-1])]
        axes.step(times, values, where="post", color=TOLD, lw=1.1, ls="--", label="where it was told to look")


def _aims(axes: Axes, run: Run, judge: Judge, place: int) -> None:
    """The instants that shots aim for."""
    looks: tuple[tuple[bool | None, dict[str, Any]], ...] = (
        (True, {"color": SEEN, "marker": "o", "label": "aim: in the picture"}),
        (False, {"color": style.DEAD, "marker": "X", "label": "aim: not in it"}),
        (None, {"color": style.SOFT, "marker": "o", "mfc": "white", "label": "aim: not known"}),
    )
    for seen, look in looks:
        those = [shot.aim for shot in judge.shots if shot.in_frame is seen]
        if those:
            times, values = [_seconds(run, one.aim_ns) for one in those], [one.to[place] for one in those]
            axes.plot(times, values, ls="", ms=6.0, zorder=5, **look)


def _frames(axes: Axes, run: Run, judge: Judge) -> None:
    """The frames, at the lower edge."""
    for seen, colour in ((True, SEEN), (False, style.DEAD)):
        times = [_seconds(run, frame.t_ns) for shot in judge.shots for frame, one in shot.frames if one is seen]
        if times:
            low = axes.get_xaxis_transform()
            name = "frame with the target" if seen else "frame without"
            axes.plot(times, [0.03] * len(times), "|", color=colour, ms=5.0, mew=0.8, transform=low, label=name)


def _queue(axes: Axes, run: Run, outside: Outside) -> None:
    """Items that waited in the gateway, and those that it had dropped by then."""
    times = [0.0, *(_seconds(run, one.t_ns) for one in outside.counts), max(run.metrics["ended_s"], 0.0)]
    for name, colour in (("waiting", LOOKED), ("dropped", style.DEAD)):
        values = [0, *(getattr(one, name) for one in outside.counts)]
        if name == "waiting" or any(values):
            axes.step(times, [*values, values[-1]], where="post", color=colour, lw=1.4, label=name)
    axes.set(ylabel="in the\ngateway")
    axes.set_ylim(bottom=0.0, top=max(1.2, 1.15 * axes.get_ylim()[1]))
    style.counts(axes)
    axes.legend(loc="upper right", ncols=2)
