"""The estimates of a run: the points of its headline view, as a track of each tracker and target."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from launcher.record.figures.frames import MOST
from launcher.record.tables import STATE
from launcher.records import View
from trackfield.filters import metrics as score
from trackfield.role import NS
from trackfield.world.path import Path, State

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
COLUMNS: Final = (
    *("source", "origin", "tracker", "target", "at_ns", "told_ns", "term", "lag", "step", "sensors"),
    *("t_s", "told_s", "reports", "status", "covariance", "bound_m"),
    *STATE,
    *(f"true_{name}" for name in STATE),
    "true_interpolated",
    "incarnation",
)
"""The columns of tracks.parquet that a report needs."""


@dataclass(frozen=True)
class Course:
    """The instants at which a track is expected: ``at_ns`` (in order), when any target of ``paths`` is there.

    Where nobody knows of any target, there are no ``paths``, and a track is expected at all steps.
    """

    at_ns: tuple[int, ...] = ()
    origin_ns: int = 0
    paths: Mapping[str, Path] = field(default_factory=dict)

    @classmethod
    def of(cls, paths: Mapping[str, Path], steps: Iterable[int], step_ns: int, origin_ns: int) -> Course:
        """The course of a run in which these steps are expected."""
        times = (origin_ns + step * step_ns for step in steps)
        whole = cls(tuple(times), origin_ns, paths)
        return replace(whole, at_ns=tuple(t for t in whole.at_ns if whole._present(t / NS))) if paths else whole

    def truth(self, at_ns: int) -> State | None:
        """Where the only target is; None if there are several, as a missing track is of no particular one."""
        return next(iter(self.paths.values())).at(at_ns / NS) if len(self.paths) == 1 else None

    @cached_property
    def interpolated(self) -> frozenset[int]:
        """The instants at which the place of no target was recorded: all that are there lie in gaps of their data."""
        present = {t: self._present(t / NS) for t in self.at_ns}
        return frozenset(t for t, paths in present.items() if paths and all(p.interpolated(t / NS) for p in paths))

    def _present(self, t_s: float) -> list[Path]:
        return [path for path in self.paths.values() if path.at(t_s) is not None]


@dataclass(frozen=True)
class Track:
    """The estimates of one tracker for one target: an entry for each step of the run, and any other instant published.

    ``t_s`` and ``told_s`` (T,) in s since the first step; ``reports`` (T,) fused; ``coasting`` (T,) where there was a
    track and no report; ``mean`` and ``truth`` (T, 4) as (x, y, vx, vy) in m and m/s, with several targets that of the
    nearest; ``covariance`` (T, 4, 4); ``bound`` (T,) in m, the least sd of the position. Where there was
    no track, target or bound, they are NaN. ``expected`` (T,) where a target was there; ``interpolated`` (T,) where
    its truth is a straight line over a gap of the recording. ``lag`` is the delay of a smoothed track, in steps;
    one that is smoothed as a ``whole`` has none of its own, as all of its points come at its end.
    """

    tracker: str
    target: str
    t_s: Array
    told_s: Array
    reports: Array
    coasting: Mask
    mean: Array
    covariance: Array
    truth: Array
    bound: Array
    expected: Mask
    interpolated: Mask
    lag: int = 0
    whole: bool = False

    @cached_property
    def known(self) -> Mask:
        """(T,) where there is a track."""
        return np.asarray(np.isfinite(self.mean).all(axis=1))

    @cached_property
    def scored(self) -> Mask:
        """(T,) the steps of the headline figures: those with a track and a truth that is not interpolated."""
        return np.asarray(np.isfinite(self.error_m) & ~self.interpolated)

    @cached_property
    def error_m(self) -> Array:
        """(T,) distance from the truth, m."""
        distances: Array = np.hypot(*(self.mean - self.truth)[:, :2].T)
        return distances

    @cached_property
    def nees(self) -> Array:
        """(T,) normalised estimation error squared of the whole state."""
        found = np.full(len(self.t_s), np.nan)
        known = np.isfinite(self.mean - self.truth).all(axis=1) & np.isfinite(self.covariance).all(axis=(1, 2))
        found[known] = score.nees((self.mean - self.truth)[known], self.covariance[known])
        return found


def read(points: pa.Table, view: View, order: Sequence[str], course: Course = Course()) -> tuple[Track, ...]:
    """The tracks of a view, by their trackers in this order; trackers that it does not name come last.

    Where several sources published a point for one instant, the highest term counts, of equal ones the first published.
    """
    table = points.filter(pc.is_in(points["source"], pa.array(view.sources, pa.string())))
    table = table.sort_by([("at_ns", "ascending"), ("term", "descending"), ("told_ns", "ascending")])
    rows: dict[tuple[str, str], dict[int, int]] = {}
    keys = zip(*(table[name].to_pylist() for name in ("tracker", "target", "at_ns")), strict=True)
    for index, (tracker, target, at_ns) in enumerate(keys):
        rows.setdefault((tracker, target), {}).setdefault(at_ns, index)
    names = [*order, *(tracker for tracker, _ in rows)]
    ordered = sorted(rows.items(), key=lambda item: names.index(item[0][0]))
    return tuple(_track(*key, table.take(pa.array(held.values())), course) for key, held in ordered)


def _track(tracker: str, target: str, table: pa.Table, course: Course) -> Track:
    told = np.asarray(table["at_ns"].to_numpy(), np.int64)
    at_ns = np.union1d(told, np.array(course.at_ns, np.int64))
    where = np.searchsorted(at_ns, told)

    def placed(values: Any, empty: float = np.nan) -> Array:
        """The values at their instants, ``empty`` at all others."""
        found = np.full((len(at_ns), *np.shape(values)[1:]), empty)
        found[where] = values
        return found

    def floats(name: str, empty: float = np.nan) -> Array:
        return placed(np.asarray(table[name].to_numpy(), float), empty)

    mean = np.column_stack([floats(name) for name in STATE])
    rows = [row or [np.nan] * 16 for row in table["covariance"].to_pylist()]
    covariance = placed(np.array(rows, float).reshape(-1, 4, 4))
    # a filter that diverged has no track, as in the figures
    diverged = ~(np.abs(mean).max(axis=1) <= MOST) | ~(np.abs(covariance).max(axis=(1, 2)) <= MOST)
    mean[diverged], covariance[diverged] = np.nan, np.nan
    truth = np.column_stack([floats(f"true_{name}") for name in STATE])
    interpolated = placed(np.asarray(table["true_interpolated"], float), 0.0) > 0
    for index in np.flatnonzero(~np.isin(at_ns, told)):
        truth[index] = course.truth(int(at_ns[index])) or np.nan
        interpolated[index] = int(at_ns[index]) in course.interpolated
    return Track(
        tracker,
        target,
        (at_ns - course.origin_ns) / NS if course.at_ns else floats("t_s"),
        floats("told_s"),
        floats("reports", 0.0),
        placed([status == "coasting" for status in table["status"].to_pylist()], 0.0) > 0,
        mean,
        covariance,
        truth,
        floats("bound_m"),
        np.isin(at_ns, course.at_ns),
        interpolated,
        int(pc.max(table["lag"]).as_py() or 0),
    )
