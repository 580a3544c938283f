"""messages.parquet and tracks.parquet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path as FilePath

import pyarrow as pa
import pyarrow.parquet as pq

from launcher.records import MessageRow
from trackfield.role import NS, TrackPoint
from trackfield.world.path import Path

STATE = ("x", "y", "vx", "vy")


@dataclass(frozen=True, slots=True)
class TrackRow:
    """A published point of a track beside the truth at its time; ``told_ns`` is when it was published first."""

    told_ns: int
    t_ns: int
    point: TrackPoint
    truth: tuple[float, float, float, float] | None


def track_rows(estimates: Sequence[tuple[int, TrackPoint]], path: Path, step_ns: int) -> list[TrackRow]:
    """The last estimate of each (tracker, target, step), in that order, and when there was one first."""
    latest: dict[tuple[str, str, int], tuple[int, TrackPoint]] = {}
    for told, point in estimates:
        key = (point.tracker, point.target, point.step)
        latest[key] = latest.get(key, (told, point))[0], point
    return [
        TrackRow(told, p.step * step_ns, p, path.at(p.step * step_ns / NS)) for _, (told, p) in sorted(latest.items())
    ]


def write_messages(rows: Sequence[MessageRow], file: FilePath) -> None:
    """messages.parquet: one row per (frame, hearer)."""
    types = {
        "sent_ns": pa.int64(), "due_ns": pa.int64(), "bytes": pa.int32(), "copy": pa.int32(),
        "incarnation": pa.int32(), "step": pa.int32(), "bearing_deg": pa.float64(), "local_ns": pa.int64(),
        "payload": pa.binary(),
    }  # fmt: skip
    names = [f.name for f in fields(MessageRow)]
    ordered = sorted(rows, key=lambda r: (r.sent_ns, r.src, r.kind, r.copy, r.dst, r.medium))
    columns = {n: pa.array([getattr(r, n) for r in ordered], types.get(n, pa.string())) for n in names}
    pq.write_table(pa.table(columns), file)


def write_tracks(rows: Sequence[TrackRow], bound: Mapping[int, float], file: FilePath) -> None:
    """tracks.parquet."""
    pq.write_table(tracks_table(rows, bound), file)


def tracks_table(rows: Sequence[TrackRow], bound: Mapping[int, float]) -> pa.Table:
    """One row per (tracker, target, step): state, covariance row by row, truth; null before the track.

    ``bound`` is that of the position's sd (m) by step, as far as there is one.
    """
    floats, vector = pa.float64(), pa.list_(pa.float64())
    columns = {
        "t_s": pa.array([r.t_ns / NS for r in rows], floats),
        "step": pa.array([r.point.step for r in rows], pa.int32()),
        "target": pa.array([r.point.target for r in rows], pa.string()),
        "tracker": pa.array([r.point.tracker for r in rows], pa.string()),
        "status": pa.array([r.point.status for r in rows], pa.string()),
        "reports": pa.array([r.point.reports for r in rows], pa.int32()),
        "told_s": pa.array([r.told_ns / NS for r in rows], floats),
        **{n: pa.array([r.point.mean[i] if r.point.mean else None for r in rows], floats) for i, n in enumerate(STATE)},
        "covariance": pa.array([list(r.point.covariance) or None for r in rows], vector),
        **{f"true_{n}": pa.array([r.truth[i] if r.truth else None for r in rows], floats) for i, n in enumerate(STATE)},
        "bound_m": pa.array([None if r.point.lag else bound.get(r.point.step) for r in rows], floats),
    }
    return pa.table(columns)
