"""Recorded reports: what real sensors reported and when, and where the target was, as far as that is known.

A file has a row for each report: its time, its sensor's id, the numbers that it reported and, where they are known, the
target's coordinates. What a row says of the target is so at the row's time.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache, partial
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Final, NamedTuple

import numpy as np

from trackfield.errors import ScenarioError
from trackfield.files import FAR_M, LONG_S
from trackfield.words import quoted, shortened
from trackfield.world.fixes import ISO, moment
from trackfield.world.path import Path
from trackfield.world.placed import Played
from trackfield.world.rows import Column, Row, form_of, number, read_rows, rows_in
from trackfield.world.tracks import path_through

TIMES: Final[dict[str, Column]] = {
    "t_s": (partial(number, LONG_S), "seconds"),
    "time": (moment, ISO),
}
"""A file has one of these columns."""
SENSOR: Final = "sensor"
PLACES: Final = (("x_m", "y_m"), ("x", "y"))
"""The columns of the target's coordinates; a file may have one pair, with empty cells where they are not known."""
APART_S: Final = 0.05
"""A row so soon after a fix is none: several sensors report one by one what the target sent at one instant."""
LARGEST: Final = 1e12
"""The largest number that is reported."""
_NS: Final = 1e9


@dataclass(frozen=True)
class Recording:
    """The reports of a ``file``.

    ``t_s`` are the times of all of them, in order, in seconds since ``zero``, or as in the file if that is None;
    ``readings`` are those of each sensor in order, and ``truth`` is the target's path on the same scale, None if no row
    has coordinates. ``columns`` are the names of the numbers of a report.
    """

    file: str
    columns: tuple[str, ...]
    t_s: tuple[float, ...]
    readings: Mapping[str, tuple[Played, ...]]
    truth: Path | None
    zero: datetime | None = None

    def first_step_s(self, start: Start) -> float:
        """The time of a first step on the recording's own scale.

        Raises ``ScenarioError`` if only one of both has dates.
        """
        return start.t_s + self.seconds_to(start.zero, "the target's file")

    def seconds_to(self, zero: datetime | None, whose: str) -> float:
        """The time from the recording's zero to another one. Raises ``ScenarioError`` if only one of both has dates."""
        if (self.zero is None) != (zero is None):
            has, lacks = ("dates", "seconds") if zero else ("seconds", "dates")
            what = f"has {lacks}, and {whose} has {has}"
            raise ScenarioError(what, file=self.file, expected=f"{has}, so that the two fit together")
        return 0.0 if zero is None or self.zero is None else (zero - self.zero).total_seconds()


class Start(NamedTuple):
    """The time of the first step: ``t_s`` after ``zero``, or as files count seconds if that is None."""

    zero: datetime | None
    t_s: float

    @classmethod
    def of(cls, recordings: Sequence[Recording], step_s: float) -> Start:
        """Half a step before the first report of all: reports that come once a step are in the middle of one each.

        Raises ``ScenarioError`` if some have dates and others have not.
        """
        first = recordings[0]
        earliest_s = min(one.t_s[0] + first.seconds_to(one.zero, "another recording") for one in recordings)
        return cls(first.zero, earliest_s - step_s / 2.0)


def read_recording(file: FilePath) -> Recording:
    """The reports of a CSV or Parquet file. Raises ``ScenarioError`` for a file that cannot be used.

    That is one without rows, with cells that cannot be read, whose times go back, or with two reports of a sensor at
    one time.
    """
    try:
        state = file.stat()
        return _read(file, (state.st_mtime_ns, state.st_size))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise ScenarioError(f"cannot be read ({why})", file=str(file)) from None


@lru_cache(maxsize=8)
def _read(file: FilePath, version: tuple[int, int]) -> Recording:
    """``version`` tells two contents of a file apart."""
    time, columns = _columns(file)
    rows = read_rows(file, [tuple(columns)], columns)
    _check_order(file, rows, time)
    zero, times = None, [row[time] for _, row in rows]
    if time == "time":
        dated = [when if when.tzinfo else when.replace(tzinfo=UTC) for when in times]
        zero, times = dated[0], [(when - dated[0]).total_seconds() for when in dated]
    place = next((pair for pair in PLACES if pair[0] in columns), ())
    values = tuple(name for name in columns if name not in (time, SENSOR, *place))
    found = defaultdict[str, list[Played]](list)
    for t_s, (line, row) in zip(times, rows, strict=True):
        mine, t_ns = found[row[SENSOR]], round(t_s * _NS)
        if mine and mine[-1][0] == t_ns:
            what = f"{quoted(row[SENSOR])} reports twice at {row[time]}"
            raise ScenarioError(what, file=f"{file}:{line}", expected="one report of a sensor at a time")
        mine.append((t_ns, tuple(row[name] for name in values)))
    readings = {id: tuple(mine) for id, mine in found.items()}
    return Recording(str(file), values, tuple(times), readings, _truth(file, rows, times, place), zero)


def _columns(file: FilePath) -> tuple[str, dict[str, Column]]:
    """The name of the column of times, and how all columns of a file are read."""
    form = form_of(file)
    expected = f"a {form} file with columns t_s (or time), {SENSOR}, the numbers of a report, and x_m,y_m if known"
    fail = partial(ScenarioError, file=str(file), expected=expected)
    try:
        header, _ = rows_in(file)
    except (csv.Error, ValueError) as error:
        raise fail(f"not a {form} file ({error})") from None
    time = next((name for name in TIMES if name in header), None)
    if time is None or SENSOR not in header:
        raise fail(f"has the columns {shortened(', '.join(header))}" if header else "is empty")
    if twice := next((name for name in header if header.count(name) > 1), None):
        raise fail(f"has the column {quoted(twice)} twice")
    place: tuple[str, ...] = next((pair for pair in PLACES if set(pair) & set(header)), ())
    if missing := [axis for axis in place if axis not in header]:
        raise fail(f"has no column {missing[0]}")
    known = {
        time: TIMES[time],
        SENSOR: (_id, "a sensor's id"),
        **dict.fromkeys(place, (_coordinate, "metres, or empty")),
    }
    return time, {name: known.get(name, _NUMBER) for name in header if name}


def _id(text: str) -> str:
    if not text:
        raise ValueError
    return text


def _coordinate(text: str) -> float | None:
    return number(FAR_M, text) if text else None


_NUMBER: Final[Column] = (partial(number, LARGEST), "a number")


def _check_order(file: FilePath, rows: Sequence[Row], time: str) -> None:
    """Raise ``ScenarioError`` if times go back."""
    for (_, before), (line, row) in pairwise(rows):
        try:
            back = row[time] < before[time]
        except TypeError:  # one with a zone, one without
            what = f"time is {row[time]}, after {before[time]}"
            raise ScenarioError(what, file=f"{file}:{line}", expected="times with a zone, or all without") from None
        if back:
            what = f"{time} goes back, from {before[time]} to {row[time]}"
            raise ScenarioError(what, file=f"{file}:{line}", expected="rows in order of time")


def _truth(file: FilePath, rows: Sequence[Row], times: Sequence[float], place: Sequence[str]) -> Path | None:
    """The path through the known places; None if there are fewer than two."""
    t, xy = list[float](), list[tuple[float, float]]()
    for t_s, (line, row) in zip(times, rows, strict=True):
        known = [row[axis] for axis in place if row[axis] is not None]
        if len(known) == 1:
            raise ScenarioError("has one coordinate", file=f"{file}:{line}", expected="both, or none")
        if known and (not t or t_s - t[-1] >= APART_S):
            t.append(t_s)
            xy.append((known[0], known[1]))
    return path_through(np.array(t), np.array(xy)) if len(t) > 1 else None
