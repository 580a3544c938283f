"""Whether runs are the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from launcher.files import MESSAGES_TABLE, TRACKS_TABLE
from launcher.record.reading.files import read_table


def differences(a: Path, b: Path, tolerance: float) -> list[str]:
    """The differences between two runs: tracks by more than the tolerance, or the fate of any frame."""
    tracks, messages = ([read_table(run, name) for run in (a, b)] for name in (TRACKS_TABLE, MESSAGES_TABLE))
    return _track_differences(tracks[0], tracks[1], tolerance) + _frame_differences(messages[0], messages[1])


def _track_differences(a: pa.Table, b: pa.Table, tolerance: float) -> list[str]:
    keys = ("source", "tracker", "target", "at_ns", "step", "status", "sensors")
    if a.select(keys) != b.select(keys):
        return [f"the tracks have other steps, states or numbers of reports ({a.num_rows} and {b.num_rows} points)"]
    found = []
    for name in ("x", "y", "vx", "vy", "covariance"):
        old, new = (_floats(table[name]) for table in (a, b))
        if old.shape != new.shape:
            found.append(f"tracks: {name} is there for other steps")
        elif old.size and not np.allclose(old, new, rtol=0.0, atol=tolerance, equal_nan=True):
            found.append(f"tracks: {name} differs by up to {np.nanmax(np.abs(old - new)):.3g}")
    return found


def _floats(column: pa.ChunkedArray) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    flat = column.combine_chunks()
    values = flat.flatten() if pa.types.is_list(flat.type) else flat
    return np.asarray(values.to_numpy(zero_copy_only=False), float)


def _frame_differences(a: pa.Table, b: pa.Table) -> list[str]:
    keys = ("src", "dst", "kind", "sent_ns", "copy", "medium", "incarnation", "due_ns", "outcome", "bytes")
    old, new = (set(zip(*(table[k].to_pylist() for k in keys), strict=True)) for table in (a, b))
    only = sorted(old ^ new, key=str)
    if not only:
        return []
    src, dst, kind, sent_ns, *_ = only[0]
    which = f"the first {kind} from {src} to {dst} at {sent_ns / 1e9:.3f} s"
    return [f"frames: {len(old - new)} only in the first run, {len(new - old)} only in the second; {which}"]
