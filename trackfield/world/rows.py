"""Rows of CSV files, read by the names in their header."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Any, Final

from trackfield.errors import ScenarioError, combined, together

Column = tuple[Callable[[str], Any], str]
"""The parser of a cell, which raises ``ValueError``, and what is expected there."""
MOST: Final = 5
"""The number of wrong lines of a file that are reported."""
Row = tuple[int, dict[str, Any]]
"""(line, values by column)"""


def number(limit: float, text: str) -> float:
    """A finite number of at most this size; raises ``ValueError``."""
    value = float(text)
    if not abs(value) <= limit:  # also true for NaN
        raise ValueError
    return value


PLACES: Final[dict[str, Column]] = {
    "lat": (partial(number, 90.0), "degrees from -90 to 90"),
    "lon": (partial(number, 180.0), "degrees from -180 to 180"),
    "x": (partial(number, 1e7), "metres"),
    "y": (partial(number, 1e7), "metres"),
}


def read_rows(
    file: FilePath, formats: Sequence[Sequence[str]], columns: Mapping[str, Column], optional: Sequence[str] = ()
) -> list[Row]:
    """All rows, with the columns of the first of the ``formats`` that the file has, and the ``optional`` it has.

    Other columns and empty rows are ignored. Raises ``ScenarioError`` for a file without these columns or without
    rows, ``OSError`` if it cannot be read.
    """
    kinds = " or ".join(",".join(names) for names in formats)
    fail = partial(ScenarioError, file=str(file), expected=f"a CSV file with columns {kinds}")
    try:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            rows = list(csv.reader(lines, skipinitialspace=True))
    except (csv.Error, UnicodeDecodeError):
        raise fail("not a CSV file") from None
    header = [name.strip().lower() for name in rows[0]] if rows else []
    found = next((names for names in formats if set(names) <= set(header)), None)
    if found is None:
        raise fail(f"has the columns {', '.join(header)}" if header else "is empty")
    wanted = [*found, *(name for name in optional if name in header)]
    read, wrong = [], list[ScenarioError]()
    for line, row in enumerate(rows[1:], start=2):
        if any(cell.strip() for cell in row):
            values = dict(zip(header, row, strict=False))
            try:
                read.append((line, _cells(f"{file}:{line}", values, {name: columns[name] for name in wanted})))
            except ScenarioError as error:
                wrong.append(error)
    if wrong:
        more = ScenarioError(f"{len(wrong) - MOST} more lines are wrong", file=str(file))
        raise combined([*wrong[:MOST], *([more] if len(wrong) > MOST else [])])
    if not read:
        raise fail("has no rows")
    return read


def _cells(where: str, values: Mapping[str, str], columns: Mapping[str, Column]) -> dict[str, Any]:
    """A line's values by column. Raises ``ScenarioError`` for invalid values."""
    found = together(partial(_cell, where, name, values.get(name, ""), column) for name, column in columns.items())
    return dict(zip(columns, found, strict=True))


def _cell(where: str, name: str, text: str, column: Column) -> Any:
    read, expected = column
    try:
        return read(text.strip())
    except ValueError:
        raise ScenarioError(f"{name} is {text!r}", file=where, expected=expected) from None
