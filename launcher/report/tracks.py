"""What the trackers of a run said: the points of its headline view, as a track of each tracker and target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from launcher.record.tables import STATE
from launcher.records import View
from trackfield.filters import metrics as score

Array = npt.NDArray[np.float64]
COLUMNS: Final = (
    *("source", "tracker", "target", "at_ns", "told_ns", "term", "lag", "step", "sensors"),
    *("t_s", "told_s", "reports", "status", "covariance", "bound_m"),
    *STATE,
    *(f"true_{name}" for name in STATE),
)
"""Of tracks.parquet, that a report needs."""


@dataclass(frozen=True)
class Track:
    """What one tracker said of one target: an entry per instant, in the order of time.

    ``t_s`` and ``told_s`` (T,) in s since the first step; ``reports`` (T,) fused; ``coasting`` (T,) where there was a
    track and no report; ``mean`` and ``truth`` (T, 4) as (x, y, vx, vy) in m and m/s, with several targets that of the
    nearest; ``covariance`` (T, 4, 4); ``bound`` (T,) in m, the least sd of the position. Where there was
    no track, target or bound, they are NaN.
    """

    tracker: str
    target: str
    t_s: Array
    told_s: Array
    reports: Array
    coasting: npt.NDArray[np.bool_]
    mean: Array
    covariance: Array
    truth: Array
    bound: Array

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


def read(points: pa.Table, view: View, order: Sequence[str]) -> tuple[Track, ...]:
    """The tracks of a view, by their trackers in this order; what it does not name comes last.

    Of what several sources told of one instant the point of the highest term holds, of equal ones the first told.
    """
    table = points.filter(pc.is_in(points["source"], pa.array(view.sources)))
    table = table.sort_by([("at_ns", "ascending"), ("term", "descending"), ("told_ns", "ascending")])
    rows: dict[tuple[str, str], dict[int, int]] = {}
    keys = zip(*(table[name].to_pylist() for name in ("tracker", "target", "at_ns")), strict=True)
    for index, (tracker, target, at_ns) in enumerate(keys):
        rows.setdefault((tracker, target), {}).setdefault(at_ns, index)
    names = [*order, *(tracker for tracker, _ in rows)]
    ordered = sorted(rows.items(), key=lambda item: names.index(item[0][0]))
    return tuple(_track(*key, table.take(pa.array(held.values()))) for key, held in ordered)


def _track(tracker: str, target: str, table: pa.Table) -> Track:
    def floats(name: str) -> Array:
        return np.asarray(table[name].to_numpy(), float)

    covariances = [row or [np.nan] * 16 for row in table["covariance"].to_pylist()]
    return Track(
        tracker,
        target,
        floats("t_s"),
        floats("told_s"),
        floats("reports"),
        np.array([status == "coasting" for status in table["status"].to_pylist()], bool),
        np.column_stack([floats(name) for name in STATE]),
        np.array(covariances, float).reshape(-1, 4, 4),
        np.column_stack([floats(f"true_{name}") for name in STATE]),
        floats("bound_m"),
    )
