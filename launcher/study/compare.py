"""Whether runs are the same."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from trackfield.errors import ScenarioError

FILES: Final[Mapping[str, Callable[[Path], object]]] = {
    "metrics.json": lambda file: json.loads(file.read_bytes()),
    "tracks.parquet": pq.read_metadata,
    "messages.parquet": pq.read_metadata,
    "scenario.toml": lambda file: tomllib.loads(file.read_text(encoding="utf-8")),
}
"""The files of a run folder that a comparison needs, each with a reader that fails if it is damaged."""
_NEW: Final = {"tracks.parquet": {"source", "at_ns", "sensors", "true_interpolated"}, "messages.parquet": {"payload"}}
"""Columns that an older version did not write."""


def check_runs(runs: Sequence[Path]) -> None:
    """Raise ``ScenarioError`` for a folder that is not that of a finished run."""
    for run in runs:
        for name, read in FILES.items():
            try:
                found = read(run / name)
            except (OSError, ValueError) as error:
                what = f"has no {name}" if isinstance(error, OSError) else f"its {name} is damaged"
                raise ScenarioError(what, file=str(run), expected="the folder of a finished run") from None
            if isinstance(found, pq.FileMetaData) and _NEW[name] - set(found.schema.to_arrow_schema().names):
                expected = "a run by this version; trackfield run <its scenario.toml> repeats it"
                raise ScenarioError("was written by an older version", file=str(run / name), expected=expected)


def differences(a: Path, b: Path, tolerance: float) -> list[str]:
    """The differences between two runs: tracks by more than the tolerance, or the fate of any frame."""
    tracks, messages = ([pq.read_table(run / f"{name}.parquet") for run in (a, b)] for name in ("tracks", "messages"))
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
