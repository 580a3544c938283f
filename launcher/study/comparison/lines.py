"""The tracks of several runs as lines: one colour per tracker; runs differ in dash and tint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from launcher.colours import tracker_colours
from launcher.report.folder import Run
from launcher.report.tracks import Track

Places = npt.NDArray[np.intp]
MOST_RUNS: Final = 6
"""The most runs that can be told apart in a figure."""
MOST_LINES: Final = 6
"""The most lines that can be told apart in a plot; with more, each tracker has its own plot."""
_DASHED: Final = (0, (4.0, 1.6))
_DOTTED: Final = (0, (1.0, 1.4))
_LOOKS: Final[tuple[tuple[float, float, Any, float], ...]] = (
    (0.0, 0.0, "-", 2.2),
    (-0.5, 0.6, _DASHED, 1.3),
    (0.5, -0.2, "-", 1.3),
    (-0.5, 0.85, _DOTTED, 1.5),
    (0.0, 0.35, (0, (6.0, 1.4, 1.0, 1.4)), 1.3),
    (0.45, -0.1, _DASHED, 1.3),
)
"""Of each run: how much its lines are lighter than the tracker's colour, or darker (below 0), on white and on black;
their dashes and width."""


@dataclass(frozen=True)
class Line:
    """A track of one tracker in one of the runs; ``name`` is that of the run, ``place`` its number, from 0."""

    place: int
    name: str
    run: Run
    track: Track

    @property
    def label(self) -> str:
        """What a legend says of it."""
        return f"{self.track.tracker}, {self.name}"

    def look(self, colours: dict[str, str], *, dark: bool = False) -> dict[str, Any]:
        """How matplotlib draws it, on white or on a ``dark`` ground; only one of the first ``MOST_RUNS`` runs."""
        on_white, on_black, dash, width = _LOOKS[self.place]
        shade = on_black if dark else on_white
        thin = float(np.clip(1.0 - len(self.track.t_s) / 2400, 0.4, 1.0))  # many points need a thin line
        return {"color": tint(colours[self.track.tracker], shade), "ls": dash, "lw": width * thin}


def lines(runs: Sequence[Run], names: Sequence[str]) -> list[Line]:
    """The tracks of all runs."""
    both = enumerate(zip(names, runs, strict=True))
    return [Line(place, name, run, track) for place, (name, run) in both for track in run.tracks]


def drawable(found: Sequence[Line]) -> list[Line]:
    """Those of the first runs, as many as can be told apart in a figure."""
    return [line for line in found if line.place < MOST_RUNS]


def colours(found: Sequence[Line]) -> dict[str, str]:
    """The colour of each tracker."""
    return tracker_colours(list(dict.fromkeys(line.track.tracker for line in found)))


def panels(found: Sequence[Line]) -> list[list[Line]]:
    """The lines of each plot: all in one, or those of each tracker if they are too many."""
    if len({line.label for line in found}) <= MOST_LINES:
        return [list(found)] if found else []
    trackers = dict.fromkeys(line.track.tracker for line in found)
    return [[line for line in found if line.track.tracker == tracker] for tracker in trackers]


def tint(colour: str, shade: float) -> str:
    """A colour ("#rrggbb") nearer to white by this share, or to black if it is below 0."""
    end = 255 if shade > 0 else 0
    channels = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return "#" + "".join(f"{round(c + (end - c) * abs(shade)):02x}" for c in channels)


def common(a: Track, b: Track) -> tuple[Places, Places]:
    """The places of the common instants in each of two tracks, (n,) and (n,)."""
    one, other = (np.round(track.t_s * 1e6).astype(np.int64) for track in (a, b))
    _, first, second = np.intersect1d(one, other, return_indices=True)
    return first, second
