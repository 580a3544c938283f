"""messages.parquet and tracks.parquet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from math import hypot, isfinite
from pathlib import Path as FilePath

import pyarrow as pa
import pyarrow.parquet as pq

from launcher.files import whole_file
from launcher.record.ledger import Published
from launcher.records import MessageRow
from trackfield.role import NS, TrackPoint
from trackfield.tracking.smoothing import WHOLE
from trackfield.world.path import Path, State

STATE = ("x", "y", "vx", "vy")
Bounds = Mapping[str, Mapping[int, float]]
"""The bound of the position's sd (m) by source and instant (ns)."""


@dataclass(frozen=True, slots=True)
class TrackRow:
    """A published point of a track beside the truth at its instant.

    ``told_ns`` is when it was published first, ``incarnation`` the life of its source that did so last. ``truth`` is
    the state of ``true_target``; with several targets the one nearest to the point, as reports name no target.
    It may be ``interpolated``, in a gap of a recorded track.
    """

    told_ns: int
    point: TrackPoint
    truth: State | None = None
    true_target: str = ""
    incarnation: int = 0
    interpolated: bool = False

    @property
    def t_ns(self) -> int:
        """The instant that the point is about."""
        return self.point.at_ns

    @property
    def has_track(self) -> bool:
        """Whether there is a track; a filter that diverged to NaN or infinity has none."""
        return bool(self.point.mean) and all(map(isfinite, (*self.point.mean, *self.point.covariance)))


def bound_of(row: TrackRow, bounds: Bounds) -> float | None:
    """The bound beside a point; None where there is none, and for smoothed tracks, which use later reports."""
    smoothed = row.point.lag or row.point.tracker.endswith(WHOLE)
    return None if smoothed else bounds.get(row.point.source, {}).get(row.t_ns)


def track_rows(published: Iterable[Published], paths: Mapping[str, Path]) -> list[TrackRow]:
    """The last point of each (source, tracker, target, instant), in that order, and when the first was published."""
    latest: dict[tuple[str, str, str, int], tuple[int, Published]] = {}
    for one in published:
        key = (one.source, one.point.tracker, one.point.target, one.point.at_ns)
        latest[key] = latest.get(key, (one.told_ns, one))[0], one
    return [_row(told_ns, one, paths) for _, (told_ns, one) in sorted(latest.items(), key=lambda item: item[0])]


def _row(told_ns: int, one: Published, paths: Mapping[str, Path]) -> TrackRow:
    truth, target = nearest(paths, one.point)
    interpolated = truth is not None and paths[target].interpolated(one.point.at_ns / NS)
    return TrackRow(told_ns, one.point, truth, target, one.incarnation, interpolated)


def nearest(paths: Mapping[str, Path], point: TrackPoint) -> tuple[State | None, str]:
    """The state of the target nearest to a point at its instant, and its id; of the first one if there is no track.

    (None, "") where no target is there.
    """
    states = [(state, id) for id, path in paths.items() if (state := path.at(point.at_ns / NS)) is not None]
    if not states:
        return None, ""
    x, y = point.mean[:2] if point.mean else states[0][0][:2]
    return min(states, key=lambda one: hypot(one[0][0] - x, one[0][1] - y))


def write_messages(rows: Sequence[MessageRow], file: FilePath) -> None:
    """messages.parquet: one row per frame and receiver."""
    types = {
        "sent_ns": pa.int64(), "due_ns": pa.int64(), "bytes": pa.int32(), "copy": pa.int32(),
        "incarnation": pa.int32(), "step": pa.int32(), "values": pa.list_(pa.float64()), "local_ns": pa.int64(),
        "payload": pa.binary(),
    }  # fmt: skip
    names = [f.name for f in fields(MessageRow)]
    ordered = sorted(rows, key=lambda r: (r.sent_ns, r.src, r.kind, r.copy, r.dst, r.medium))
    columns = {n: pa.array([getattr(r, n) for r in ordered], types.get(n, pa.string())) for n in names}
    with whole_file(file) as part:
        pq.write_table(pa.table(columns), part, write_page_checksum=True)


def write_tracks(rows: Sequence[TrackRow], bounds: Bounds, file: FilePath, origin_ns: int = 0) -> None:
    """tracks.parquet."""
    with whole_file(file) as part:
        pq.write_table(tracks_table(rows, bounds, origin_ns), part, write_page_checksum=True)


def tracks_table(rows: Sequence[TrackRow], bounds: Bounds, origin_ns: int = 0) -> pa.Table:
    """One row per (source, tracker, target, instant): state, covariance row by row, truth; null without a track.

    Times in s count from the first step, at ``origin_ns``.
    """
    floats, texts, vector = pa.float64(), pa.string(), pa.list_(pa.float64())
    points = [r.point for r in rows]
    columns = {
        "t_s": pa.array([(p.at_ns - origin_ns) / NS for p in points], floats),
        "step": pa.array([p.step for p in points], pa.int32()),
        "source": pa.array([p.source for p in points], texts),
        "target": pa.array([p.target for p in points], texts),
        "tracker": pa.array([p.tracker for p in points], texts),
        "status": pa.array([p.status for p in points], texts),
        "reports": pa.array([p.reports for p in points], pa.int32()),
        "told_s": pa.array([(r.told_ns - origin_ns) / NS for r in rows], floats),
        **{n: pa.array([p.mean[i] if p.mean else None for p in points], floats) for i, n in enumerate(STATE)},
        "covariance": pa.array([list(p.covariance) or None for p in points], vector),
        **{f"true_{n}": pa.array([r.truth[i] if r.truth else None for r in rows], floats) for i, n in enumerate(STATE)},
        "true_target": pa.array([r.true_target or None for r in rows], texts),
        "true_interpolated": pa.array([r.interpolated for r in rows], pa.bool_()),
        "bound_m": pa.array([bound_of(r, bounds) for r in rows], floats),
        "sensors": pa.array([list(p.sensors) for p in points], pa.list_(texts)),
        "lag": pa.array([p.lag for p in points], pa.int32()),
        "term": pa.array([p.term for p in points], pa.int32()),
        "at_ns": pa.array([p.at_ns for p in points], pa.int64()),
        "told_ns": pa.array([r.told_ns for r in rows], pa.int64()),
        "incarnation": pa.array([r.incarnation for r in rows], pa.int32()),
        "origin": pa.array([p.origin for p in points], texts),
        "unknowns": pa.array([list(p.unknowns) for p in points], vector),
        "unknown_sds": pa.array([list(p.unknown_sds) for p in points], vector),
        "known_step": pa.array([p.known_step for p in points], pa.int32()),
        "event_ns": pa.array([p.event_ns for p in points], pa.int64()),
        "refused": pa.array([p.refused for p in points], texts),
    }
    return pa.table(columns)
