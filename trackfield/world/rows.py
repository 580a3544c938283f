"""Rows of CSV and Parquet files, read by the names of their columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Any, Final, NamedTuple

from trackfield.errors import ScenarioError, combined, together
from trackfield.files import FAR_M, read_bytes, read_text
from trackfield.words import quoted, shortened

Column = tuple[Callable[[str], Any], str]
"""The parser of a cell, which raises ``ValueError``, and what is expected there."""
MOST: Final = 5
"""The number of wrong lines of a file that are reported."""
MOST_ROWS: Final = 1_000_000
"""The largest number of rows of a file."""
Row = tuple[int, dict[str, Any]]
"""(line, values by column)"""


def number(limit: float, text: str) -> float:
    """A finite number of at most this size; raises ``ValueError``."""
    value = float(text)
    if not abs(value) <= limit:  # also true for NaN
        raise ValueError
    return value + 0.0  # 0 for -0


PLACES: Final[dict[str, Column]] = {
    "lat": (partial(number, 90.0), "degrees from -90 to 90"),
    "lon": (partial(number, 180.0), "degrees from -180 to 180"),
    "x": (partial(number, FAR_M), "metres"),
    "y": (partial(number, FAR_M), "metres"),
}


class Rows(NamedTuple):
    """A file's column names, in lower case, and the cells of its rows as text, empty where there is no value."""

    header: list[str]
    cells: Iterable[list[str]]


def rows_in(file: FilePath) -> Rows:
    """The rows of a CSV file, or of a ``.parquet`` file.

    Raises ``ValueError`` or ``csv.Error`` if it is none, also while rows are read, ``OSError`` if it cannot be read.
    """
    if form_of(file) == "Parquet":
        return _parquet(file)
    rows = csv.reader(io.StringIO(read_text(file), newline=""), skipinitialspace=True)
    return Rows(_names(next(rows, ())), rows)


def form_of(file: FilePath) -> str:
    """What the name of a file with rows says that it is."""
    return "Parquet" if file.suffix.lower() == ".parquet" else "CSV"


def _parquet(file: FilePath) -> Rows:
    import pyarrow as pa  # late: most runs read none
    import pyarrow.parquet as pq

    content = read_bytes(file)
    try:
        table = pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise ValueError(str(error).partition("\n")[0]) from None
    columns = [["" if value is None else str(value) for value in column.to_pylist()] for column in table.columns]
    return Rows(_names(table.column_names), map(list, zip(*columns, strict=True)))


def _names(header: Iterable[str]) -> list[str]:
    return [name.strip().lower() for name in header]


def read_rows(
    file: FilePath, formats: Sequence[Sequence[str]], columns: Mapping[str, Column], optional: Sequence[str] = ()
) -> list[Row]:
    """All rows, with the columns of the first of the ``formats`` that the file has, and the ``optional`` it has.

    Other columns and empty rows are ignored. Raises ``ScenarioError`` for a file that is not text, without these
    columns, without rows or with too many, ``OSError`` if it cannot be read.
    """
    kinds = " or ".join(",".join(names) for names in formats)
    form = form_of(file)
    fail = partial(ScenarioError, file=str(file), expected=f"a {form} file with columns {kinds}")
    try:
        header, rows = rows_in(file)
        found = next((names for names in formats if set(names) <= set(header)), None)
        if found is None:
            raise fail(f"has the columns {shortened(', '.join(header))}" if header else "is empty")
        wanted = [*found, *(name for name in optional if name in header)]
        read = _read(file, rows, header, {name: columns[name] for name in wanted})
    except (csv.Error, ValueError) as error:
        raise fail(f"not a {form} file ({error})") from None
    if not read:
        raise fail("has no rows")
    return read


def _read(file: FilePath, rows: Iterable[list[str]], header: list[str], columns: Mapping[str, Column]) -> list[Row]:
    """The rows below the ``header``. Raises ``ScenarioError`` for too many, and with the first that are wrong."""
    read, wrong = list[Row](), list[ScenarioError]()
    for line, row in enumerate(rows, start=2):
        if any(cell.strip() for cell in row):
            if len(read) == MOST_ROWS:
                raise ScenarioError("has too many rows", file=str(file), expected=f"at most {MOST_ROWS}")
            values = dict(zip(header, row, strict=False))
            try:
                read.append((line, _cells(f"{file}:{line}", values, columns)))
            except ScenarioError as error:
                wrong.append(error)
    if wrong:
        raise first_of(wrong, file)
    return read


def first_of(wrong: Sequence[ScenarioError], file: FilePath) -> ScenarioError:
    """One error with the first of many of a ``file``."""
    more = ScenarioError(f"{len(wrong) - MOST} more lines are wrong", file=str(file))
    return combined([*wrong[:MOST], *([more] if len(wrong) > MOST else [])])


def _cells(where: str, values: Mapping[str, str], columns: Mapping[str, Column]) -> dict[str, Any]:
    """A line's values by column. Raises ``ScenarioError`` for invalid values."""
    found = together(partial(cell, where, name, values.get(name, ""), column) for name, column in columns.items())
    return dict(zip(columns, found, strict=True))


def cell(where: str, name: str, text: str, column: Column) -> Any:
    """The value of a cell. Raises ``ScenarioError`` for one that cannot be read."""
    read, expected = column
    try:
        return read(text.strip())
    except (ValueError, OverflowError):
        raise ScenarioError(f"{name} is {quoted(text)}", file=where, expected=expected) from None
