"""Reads run folders: whole files of this version, with values that a run can have; for all else one ``ScenarioError``.

Every command that looks at a finished run reads its files here.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, Final, NoReturn

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from launcher.files import MANIFEST, MESSAGES_TABLE, SCENARIO, TRACKS_TABLE, recovering
from launcher.record.figures.frames import Count, Number
from launcher.record.figures.measures import RunFigures, first_problem
from launcher.record.journal import METRICS
from launcher.record.reading.columns import COLUMNS, Column
from launcher.records import ARRIVED, SENSES, Place
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.words import quoted

AHEAD_NS: Final = 3_600_000_000_000
LARGEST: Final = 256_000_000
"""The most bytes of a file that is read as one text."""
OF_THIS: Final = f"those of the run of its {SCENARIO}"
A_RUN: Final = "the folder of a finished run"
ANEW: Final = f"a run by this version; trackfield run <its {SCENARIO}> repeats it"


class Machine(BaseModel):
    """The machine that a run was made on."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    system: str
    cores: Count | None
    memory_gb: Number


class Manifest(BaseModel):
    """What manifest.json says of a run: its command, when it ``started``, versions, machine.

    ``endpoint`` is where others could join it, None in virtual time. To make its tables again: the ``run``, its
    ``speed``, the digest of its ``scenario``, and its ``bridges``: real devices by the processes in whose place they
    were; empty if it does not say.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    command: tuple[str, ...]
    started: str
    versions: Mapping[str, str]
    machine: Machine
    run: str = ""
    endpoint: str | None = None
    speed: Number | None = None
    scenario: str = ""
    bridges: Mapping[str, str] = {}

    @field_validator("started")
    @classmethod
    def _a_time(cls, value: str) -> str:
        datetime.fromisoformat(value)
        return value

    @property
    def when(self) -> str:
        """When it started, for people."""
        return self.started.replace("T", " ").replace("+00:00", " UTC")


def check_run(folder: Path) -> None:
    """Raise ``ScenarioError`` unless this is the folder of a finished run: figures, scenario, and tables to read."""
    read_figures(folder)
    for name in COLUMNS:
        with _table(folder, name) as file:
            _check_columns(folder / name, file.schema_arrow, COLUMNS[name])
    read_settings(folder)


def read_figures(folder: Path) -> RunFigures:
    """metrics.json."""
    figures = read_json(folder, METRICS)
    try:
        return RunFigures.of(figures, str(folder / METRICS))
    except ScenarioError as error:
        expected = error.expected + recovering(folder)
        raise ScenarioError(error.what, file=error.file, key=error.key, expected=expected) from None


def read_manifest(folder: Path) -> Manifest:
    """manifest.json."""
    try:
        return Manifest.model_validate(read_json(folder, MANIFEST))
    except ValidationError as error:
        key, what = first_problem(error)
        raise ScenarioError(what, file=str(folder / MANIFEST), key=key, expected="the manifest of a run") from None


def read_settings(folder: Path) -> dict[str, Any]:
    """scenario.toml as it is written, by its tables."""
    try:
        return tomllib.loads(_bytes(folder, SCENARIO).decode("utf-8"))
    except (ValueError, RecursionError):
        _damaged(folder, SCENARIO)


def read_scenario(folder: Path) -> tuple[str, Scenario]:
    """scenario.toml, as text and checked."""
    read_settings(folder)
    return _bytes(folder, SCENARIO).decode("utf-8"), Scenario.load(folder / SCENARIO)


def read_table(folder: Path, name: str, columns: Collection[str] = (), dictionaries: Collection[str] = ()) -> pa.Table:
    """A table of a run with these columns (none: all), those of ``dictionaries`` with each text once."""
    with _table(folder, name, dictionaries) as file:
        return checked_table(file, folder / name, COLUMNS[name], columns)


def checked_table(
    file: pq.ParquetFile, path: Path, known: Mapping[str, Column], columns: Collection[str] = ()
) -> pa.Table:
    """The table in an open file, checked as one with these ``known`` columns; those of ``columns`` (none: all known).

    Raises ``ScenarioError`` for other columns or values, what pyarrow raises for a file that is damaged.
    """
    _check_columns(path, file.schema_arrow, known)
    table = file.read(columns=list(columns or known))
    table.validate(full=True)
    for column in table.column_names:
        _check_values(path, column, table[column], known[column])
    return table


def refuse(file: Path, key: str, what: str, expected: str = "the values of a run") -> NoReturn:
    """Say that a value in a file of a run is not one that the run can have had."""
    raise ScenarioError(what, file=str(file), key=key, expected=expected)


def check_belongs(
    folder: Path,
    places: Collection[Place],
    end_ns: int,
    jumps: Iterable[Sequence[tuple[int, int]]],
    points: pa.Table,
    messages: pa.Table,
) -> None:
    """Raise ``ScenarioError`` if tracks or frames name a process that the scenario lacks, or are of after the run.

    ``end_ns`` is its planned end, since its start; a point may be of later if the clock of its source is ahead, by its
    ``jumps`` (at ns, by ns) or, without any, by up to ``AHEAD_NS``. Frames from elsewhere may claim to have been sent
    at any time.
    """
    ids, sensors = {place.id for place in places}, {place.id for place in places if SENSES in place.tags}
    for name, column, values, known in (
        (TRACKS_TABLE, "source", points["source"], ids),
        (TRACKS_TABLE, "origin", points["origin"], ids | {""}),
        (TRACKS_TABLE, "sensors", pc.list_flatten(points["sensors"]), sensors),
        (MESSAGES_TABLE, "dst", messages["dst"], ids),
    ):
        if strange := set(pc.unique(values).to_pylist()) - known:
            refuse(folder / name, column, f"names {quoted(min(strange))}, which is not there", OF_THIS)
    arrived = messages.filter(pc.is_in(messages["outcome"], pa.array(ARRIVED)))
    ahead_ns = AHEAD_NS + max((sum(by for _, by in own if by > 0) for own in jumps), default=0)
    for name, column, values, most_ns in (
        (TRACKS_TABLE, "at_ns", points["at_ns"], end_ns + ahead_ns),
        (TRACKS_TABLE, "told_ns", points["told_ns"], end_ns),
        (MESSAGES_TABLE, "due_ns", arrived["due_ns"], end_ns),
    ):
        if (latest := pc.max(values).as_py() or 0) > most_ns:
            refuse(folder / name, column, f"is {latest:,}", f"{most_ns:,} at most: the run ended at {end_ns:,}")


# --- files ------------------------------------------------------------------------------------------------------------


def read_json(folder: Path, name: str) -> dict[str, Any]:
    """A JSON file of a run, as a table. Raises ``ScenarioError`` unless it is one."""
    try:
        found = json.loads(_bytes(folder, name))
        json.dumps(found, ensure_ascii=False).encode()  # JSON can hold halves of characters, which cannot be written
    except (ValueError, RecursionError):
        _damaged(folder, name)
    return found if isinstance(found, dict) else _damaged(folder, name)


def _bytes(folder: Path, name: str) -> bytes:
    with _readable(folder, name) as file:
        if file.stat().st_size > LARGEST:
            _damaged(folder, name)
        return file.read_bytes()


@contextmanager
def _table(folder: Path, name: str, dictionaries: Collection[str] = ()) -> Iterator[pq.ParquetFile]:
    try:
        with (
            _readable(folder, name) as path,
            pq.ParquetFile(path, read_dictionary=list(dictionaries), page_checksum_verification=True) as file,
        ):
            yield file
    except (OSError, ValueError, KeyError, MemoryError, pa.ArrowException):
        _damaged(folder, name)


@contextmanager
def _readable(folder: Path, name: str) -> Iterator[Path]:
    """The path of a file that is there; no pipe or device, which could be read for ever."""
    file = folder / name
    try:
        if not file.is_file():
            _missing(folder, name, there=file.exists())
        with file.open("rb"):
            pass
    except OSError as error:
        what = f"its {name} cannot be read ({error.strerror})"
        raise ScenarioError(what, file=str(folder), expected=A_RUN) from None
    yield file


def _missing(folder: Path, name: str, *, there: bool) -> NoReturn:
    if there:
        raise ScenarioError(f"its {name} is not a file", file=str(folder), expected=A_RUN)
    recover = recovering(folder)
    why = ": its run still goes on, or was killed" if recover else ""
    raise ScenarioError(f"has no {name}{why}", file=str(folder), expected=A_RUN + recover)


def _damaged(folder: Path, name: str) -> NoReturn:
    raise ScenarioError(f"its {name} is damaged", file=str(folder), expected=A_RUN) from None


# --- tables -----------------------------------------------------------------------------------------------------------


def _check_columns(file: Path, schema: pa.Schema, known: Mapping[str, Column]) -> None:
    if set(known) - set(schema.names):
        raise ScenarioError("was written by an older version", file=str(file), expected=ANEW)
    for name, column in known.items():
        if schema.names.count(name) > 1:
            refuse(file, name, "is there twice", "one column of that name")
        found = schema.field(name).type
        found = found.value_type if pa.types.is_dictionary(found) else found
        if found != column.type:
            refuse(file, name, f"is a column of type {found}", str(column.type))


def _check_values(file: Path, name: str, values: pa.ChunkedArray, column: Column) -> None:
    if values.null_count and not column.nulls:
        refuse(file, name, "lacks a value", "one in each row")
    if pa.types.is_list(column.type):
        lengths = set(pc.unique(pc.list_value_length(values).drop_null()).to_pylist())
        if column.length is not None and lengths - {column.length}:
            refuse(file, name, f"has {max(lengths - {column.length})} numbers in a row", f"{column.length}")
        values = pc.list_flatten(values)
        if values.null_count:
            refuse(file, name, "lacks a value inside a row", "whole rows")
    if column.known and (strange := set(pc.unique(values).to_pylist()) - column.known - {None}):
        refuse(file, name, f"is {quoted(min(strange))}", f"one of {', '.join(sorted(column.known))}")
    if column.finite and not pc.all(pc.is_finite(values), min_count=0).as_py():
        refuse(file, name, "is not a number somewhere", "finite numbers")
    if column.least is not None and len(values) > values.null_count:
        low, high = pc.min_max(values).values()
        for one in (low.as_py(), high.as_py()):
            if not column.least <= one <= column.most:
                refuse(file, name, f"is {one:g}", f"from {column.least:g} to {column.most:g}")
