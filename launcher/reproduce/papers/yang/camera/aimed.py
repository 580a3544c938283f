"""Whether a camera has the target in its picture when it has turned, so long after the last node has heard it pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import atan2, degrees, radians
from typing import Final, NamedTuple

import numpy as np

from camera.aiming import Camera, aim_at
from camera.fixes import Target
from camera.settings import Settings
from launcher.reproduce.kernels.study import Experiment, Figures
from launcher.reproduce.papers.yang.solved.solving import ML
from launcher.reproduce.papers.yang.trials.field import SPEED, Setup, trials
from launcher.reproduce.papers.yang.trials.sensitivity import C
from launcher.reproduce.papers.yang.trials.setups import USUAL
from trackfield.filters.passes.solve import solve
from trackfield.filters.types import Array
from trackfield.models import passing
from trackfield.models.pointing import AHEAD, Mount, in_view
from trackfield.role import NS

DELAYS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
"""s from when the last node hears the target pass until camera control has the fix."""
FAST: Final = 30.0
"""m/s."""
HEIGHT_M: Final = 2.0
NOWHERE: Final = -1.0
"""In figures of a camera: there is no instant at which it can look at the target."""


class View(NamedTuple):
    """Where a camera stands (m), and where it looks at pan 0 (deg, anticlockwise from east); None: at the field."""

    x_m: float
    y_m: float
    heading_deg: float | None = None

    def mount(self, middle: Array) -> Mount:
        """The camera there, with the field's middle (2,)."""
        ahead = degrees(atan2(middle[1] - self.y_m, middle[0] - self.x_m))
        return Mount(self.x_m, self.y_m, HEIGHT_M, ahead if self.heading_deg is None else self.heading_deg)


FAR, NEAR, ACROSS = "(120, -40)", "(30, -25)", "(30, -25), north"
VIEWS: Final[Mapping[str, View]] = {
    FAR: View(120.0, -40.0),
    NEAR: View(30.0, -25.0),
    ACROSS: View(30.0, -25.0, 90.0),
}
"""Cameras by name; the last one looks across the road from A to C."""


class Line(NamedTuple):
    """A point (m) and a heading (deg) of Table 1, about the point with the coordinates (3608558, 641359)."""

    x_m: float
    y_m: float
    heading_deg: float


ANY: Final = "any line"
LINES: Final[Mapping[str, Line | None]] = {
    "A to C": Line(0.0, 0.0, 87.0),
    "C to A": Line(0.0, 0.0, 267.0),
    "B to D": Line(0.0, -13.0, 128.0),
    "D to B": Line(0.0, -13.0, 308.0),
    ANY: None,
}
"""The paths of targets: the four of Table 1, and random ones through the field."""
EXACT: Final = ", exact"
"""After the name of a line: times and strengths are exact, and so are the fixes."""


def camera_case(line: str, speed: float) -> str:
    """The name of an experiment."""
    return f"camera: {line}, {speed:.3g} m/s"


def pointed(setup: Setup, line: Line | None, seeds: Sequence[int]) -> Figures:
    """``with VIEW`` and ``without VIEW`` (R, D) for each of ``DELAYS``: 1 where the target is in the picture.

    0: it is not, ``NOWHERE``: nor can it be, NaN: there is no fix. Aims are those of camera control. ``with``: the
    camera meets the target as early as it can, by the fix, and the true target is looked for at that instant.
    ``without``: it looks where the target was, by the fix, when the last node heard it, and the target is looked for
    when the camera has turned there.
    """
    through = None if line is None else (np.array(line[:2]), radians(line.heading_deg))
    trial = trials(setup, seeds, through)
    solved = solve(ML, trial.passes, sound_m_s=C)
    last = passing.times(trial.truth, trial.places, C).max(axis=-1)
    middle = trial.places[0].mean(axis=0)
    found: dict[str, Array] = {}
    for name, view in VIEWS.items():
        for way in ("with", "without"):
            settings = _settings(view.mount(middle), predict=way == "with")
            found[f"{way} {name}"] = np.array(
                [
                    [_seen(settings, mean, solved.time_s[run], trial.truth[run], last[run], delay) for delay in DELAYS]
                    if np.isfinite(mean).all()
                    else [np.nan] * len(DELAYS)
                    for run, mean in enumerate(solved.mean)
                ]
            )
    return found


def _settings(mount: Mount, *, predict: bool) -> Settings:
    """Those of camera control of which an aim depends, the others as they come."""
    told = {"id": "", "gateway": "", "camera": "", "video": "", "tracker": ML}
    return Settings(**told, mount=mount, origin_ns=0, step_ns=NS, predict=predict, shot_s=4.0, patience_ns=NS)


def _seen(settings: Settings, mean: Array, since_s: float, truth: Array, last_s: float, delay_s: float) -> float:
    """A figure of one camera: the aim is what camera control makes of the fix, with a camera that looks ahead."""
    now = last_s + delay_s
    x, y, vx, vy = mean.tolist()
    since_ns, last_ns, now_ns = (round(s * NS) for s in (since_s, last_s, now))
    target = Target("", 0, 0, since_ns, last_ns, now_ns, (x, y, vx, vy), 0.0, 0.0)
    aim = aim_at(target, Camera(AHEAD, 0.0), now_ns, settings)
    if aim is None:
        return NOWHERE
    at = truth[:2] + (now + aim.after_s) * truth[2:]
    return float(in_view(settings.mount, aim.to, *at.tolist()))


_NOISES: Final[Mapping[str, Setup]] = {"": USUAL, EXACT: replace(USUAL, time_s=0.0, strength=0.0)}
EXPERIMENTS: Final = {
    camera_case(line + told, speed): Experiment(partial(pointed, replace(setup, speed=speed), LINES[line]), 50)
    for told, setup in _NOISES.items()
    for line in (LINES if setup is USUAL else ("A to C", ANY))
    for speed in (SPEED, FAST)
}
"""By name: every line at 30 mph and at 30 m/s; times are off by 0.1 s, strengths by 10 %, or exact."""
