"""Runs of a study: their figures and tracks, as computed and as stored."""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from launcher.files import TRACKS_TABLE, whole_file
from launcher.plan.plan import make_plan
from launcher.record.figures.bounds import run_bounds
from launcher.record.figures.measures import RunFigures
from launcher.record.metrics import run_metrics
from launcher.record.reading.columns import COLUMNS
from launcher.record.reading.files import checked_table
from launcher.record.tables import tracks_table
from launcher.record.virtually import simulate
from launcher.study.axes import TRACKER, Axis, label
from trackfield.errors import ScenarioError, told_of
from trackfield.scenario import Scenario

_METRICS: Final = b"trackfield.metrics"
"""The metadata key under which a stored run has its figures, beside its tracks."""
_CHECK: Final = b"trackfield.check"
"""That of the figures' CRC-32: Parquet has checksums of its pages, but none of its metadata."""
_DELETED: Final = "the file to be deleted, so that the same command makes its run again"
_TYPES: Final = {
    "seed": pa.int64(),
    "tracker": pa.string(),
    "verdict": pa.string(),
    "lost": pa.bool_(),
    **dict.fromkeys(("steps", "steps_expected", "steps_tracked", "gap.steps"), pa.int64()),
    **dict.fromkeys(("nees_band", "nees_position_band"), pa.list_(pa.float64())),
    "lifetime_s.extrapolated": pa.bool_(),
}
"""The types of columns of a study's table; frames and bytes are whole numbers, all others are floats."""


@dataclass(frozen=True)
class StudyRun:
    """One run of a study: its seed, its figures, and the ``values`` of the varied keys."""

    seed: int
    metrics: RunFigures
    held: pa.Table | Path = field(repr=False)
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def tracks(self) -> pa.Table:
        """Its tracks, as in tracks.parquet; read again each time if the run is stored."""
        if isinstance(self.held, pa.Table):
            return self.held
        with _stored(self.held) as file:
            return checked_table(file, self.held, COLUMNS[TRACKS_TABLE]).replace_schema_metadata(None)

    def of(self, values: Mapping[str, Any]) -> StudyRun:
        """The same run, with these values of the varied keys."""
        return replace(self, values=values)

    def save(self, file: Path) -> StudyRun:
        """Write it, whole or not at all; the same run, with its tracks in the file."""
        said = json.dumps(self.metrics.model_dump(mode="json")).encode()
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as part:
            table = self.tracks.replace_schema_metadata({_METRICS: said, _CHECK: _check(said)})
            pq.write_table(table, part, write_page_checksum=True)
        return replace(self, held=file)

    @classmethod
    def load(cls, file: Path) -> StudyRun:
        """What ``save`` wrote. Raises ``ScenarioError`` if the file is damaged."""
        with _stored(file) as stored:
            metadata = stored.schema_arrow.metadata or {}
            said = metadata[_METRICS]
            metrics = RunFigures.of(json.loads(said), str(file))
        if not metrics.trackers or metadata.get(_CHECK) != _check(said):
            raise damaged(file)
        run = cls(metrics.seed, metrics, file)
        _ = run.tracks  # read before anything is made of the runs
        return run


def _check(said: bytes) -> bytes:
    return str(zlib.crc32(said)).encode()


@contextmanager
def _stored(file: Path) -> Iterator[pq.ParquetFile]:
    try:
        if not file.is_file():
            raise damaged(file)
        with pq.ParquetFile(file, page_checksum_verification=True) as stored:
            yield stored
    except ScenarioError as error:
        raise ScenarioError(error.what, file=error.file, key=error.key, expected=_DELETED) from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError, MemoryError, pa.ArrowException):
        raise damaged(file) from None


def damaged(file: Path, what: str = "is damaged") -> ScenarioError:
    """The error that says so of a run in a study."""
    return ScenarioError(what, file=str(file), expected=_DELETED)


def study_run(scenario: Scenario) -> StudyRun:
    """One run in virtual time, in this process: the figures of ``trackfield run --virtual``, but no folder."""
    begun, cpu_s = time.monotonic(), time.process_time()
    try:
        plan = make_plan(scenario, run=f"{scenario.name}-{scenario.seed}")
    except ScenarioError as error:
        raise told_of(f"with seed {scenario.seed}", error) from None
    ledger, rows = simulate(plan)
    bounds = run_bounds(plan, rows)
    metrics = run_metrics(plan, ledger, rows, bounds)
    metrics |= {"driver": "virtual", "wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - cpu_s}
    metrics["timing"]["speed"] = None
    metrics["recorder"]["messages"] = metrics["frames"]["sent"]
    return StudyRun(scenario.seed, RunFigures.of(metrics), tracks_table(rows, bounds, plan.origin_ns))


def median_run(runs: Sequence[StudyRun]) -> StudyRun:
    """The one whose first tracker has the median RMSE of the position; no track at all counts as worst."""

    def error(run: StudyRun) -> float:
        position = next(iter(run.metrics.trackers.values())).rmse.position
        return float("inf") if position is None else position

    return sorted(runs, key=error)[(len(runs) - 1) // 2]


# --- tables -----------------------------------------------------------------------------------------------------------


def figures_table(runs: Iterable[RunFigures]) -> pa.Table:
    """A row for each run and tracker, a column for each figure, named by its key in metrics.json."""
    rows = [row for run in runs for row in run.rows()]
    return pa.table({name: pa.array([row[name] for row in rows], _type(name)) for name in rows[0]})


def study_table(runs: Sequence[StudyRun], axes: Sequence[Axis]) -> pa.Table:
    """The table of all runs, after a column for each varied key."""
    table = figures_table(run.metrics for run in runs)
    for place, axis in enumerate(columns(axes)):
        values = [run.values[axis.key] for run in runs for _ in run.metrics.trackers]
        table = table.add_column(place, axis.key, column(axis, values))
    return table


def columns(axes: Sequence[Axis]) -> list[Axis]:
    """The axes with a column of their own: all but that of the tracker, which tables have anyway."""
    return [axis for axis in axes if axis.key != TRACKER]


def column(axis: Axis, values: Sequence[Any]) -> pa.Array:
    """Values of an axis: numbers if all of them are, else in words."""
    return pa.array(values if axis.numeric else [label(value) for value in values])


def write_tracks(runs: Sequence[StudyRun], axes: Sequence[Axis], file: Path) -> None:
    """The tracks of all runs in one file, one after the other, with the varied keys and the seed before them."""
    types = {axis.key: column(axis, axis.values).type for axis in columns(axes)}
    writer = None
    try:
        for run in runs:
            told = {key: run.values[key] if pa.types.is_primitive(t) else label(run.values[key])
                    for key, t in types.items()}  # fmt: skip
            table = run.tracks
            for place, (name, value) in enumerate((told | {"seed": run.seed}).items()):
                kind = types.get(name, pa.int64())
                table = table.add_column(place, name, pa.array([value] * len(table), kind))
            writer = writer or pq.ParquetWriter(file, table.schema)
            writer.write_table(table)
    finally:
        if writer:
            writer.close()


def _type(name: str) -> pa.DataType:
    whole_number = name.startswith(("frames.", "bytes."))
    return _TYPES.get(name, pa.int64() if whole_number else pa.float64())
