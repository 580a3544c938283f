"""Recorded fixes from GPX and CSV files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from trackfield.errors import ScenarioError
from trackfield.files import LONG_S, read_text
from trackfield.world.gpx import TrackPoint, track_points
from trackfield.world.rows import PLACES, Column, cell, first_of, number, read_rows

Array = NDArray[np.float64]
Fix = tuple[Any, ...]
"""(line, time or seconds, first, second coordinate)"""

_FIRST_YEAR: Final = 1900
_LAST_YEAR: Final = 2199
ISO: Final = f"an ISO date and time of the years {_FIRST_YEAR} to {_LAST_YEAR}"
"""The times that ``moment`` takes, in words."""
_SHORTEST_S: Final = 0.001
"""Fixes are at one instant, or at least so far apart: nearer, no speed follows from them."""


@dataclass(frozen=True)
class Fixes:
    """The fixes of a file in order of time, at least two.

    ``t`` (n,) are increasing seconds since ``zero``, the time of the first in the file's own zone, or the
    file's own seconds where it gives no dates and ``zero`` is None. ``points`` (n, 2) are latitude and
    longitude in degrees, or x and y in metres where ``geodetic`` is false. Several fixes at one instant are
    averaged.
    """

    t: Array
    points: Array
    geodetic: bool
    zero: datetime | None = None

    def span(self) -> str:
        """The first and last time, for a message."""
        if self.zero is None:
            return f"{self.t[0]:g} s to {self.t[-1]:g} s"
        return f"{self.zero} to {self.zero + timedelta(seconds=self.t[-1])}"


def read_fixes(file: FilePath) -> Fixes:
    """The fixes of a ``.gpx`` or ``.csv`` file. Raises ``ScenarioError`` if it has none with a time."""
    try:
        return _READERS[file.suffix.lower()](file)
    except KeyError:
        raise ScenarioError("unknown kind of track", file=str(file), expected="a .gpx or .csv file") from None
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", file=str(file)) from None


def _gpx(file: FilePath) -> Fixes:
    """All track points that have a time."""
    fail = partial(ScenarioError, file=str(file), expected="a GPX file with <trkpt> elements that have a <time>")
    try:
        points = track_points(read_text(file))
    except ValueError as error:
        raise fail(f"not a GPX file ({error})") from None
    timed = [point for point in points if point.time is not None]
    if not timed:
        raise fail(f"its {len(points)} points have no times" if points else "has no track points")
    fixes, wrong = list[Fix](), list[ScenarioError]()
    for point in timed:
        try:
            fixes.append((point.line, *_values(file, point)))
        except ScenarioError as error:
            wrong.append(error)
    if wrong:
        raise first_of(wrong, file)
    return _in_order(file, fixes, geodetic=True)


def _values(file: FilePath, point: TrackPoint) -> tuple[Any, ...]:
    """Time, latitude and longitude of a point. Raises ``ScenarioError`` for any that cannot be read."""
    parts = {"time": point.time, "lat": point.lat, "lon": point.lon}
    where = f"{file}:{point.line}"
    return tuple(cell(where, name, text or "", _COLUMNS[name]) for name, text in parts.items())


def _csv(file: FilePath) -> Fixes:
    """All rows; columns other than those of the format are ignored."""
    rows = [(line, *values.values()) for line, values in read_rows(file, _FORMATS, _COLUMNS)]
    return _in_order(file, rows, geodetic=isinstance(rows[0][1], datetime))


def moment(text: str) -> datetime:
    """An ISO date and time. Raises ``ValueError`` for one that no receiver can have recorded.

    So differences of two, in any zones, are finite.
    """
    when = datetime.fromisoformat(text)
    if not _FIRST_YEAR <= when.year <= _LAST_YEAR:
        raise ValueError(f"the year {when.year}")
    return when


_COLUMNS: Final[dict[str, Column]] = {
    **PLACES,
    "time": (moment, ISO),
    "t_s": (partial(number, LONG_S), "seconds"),
}
_FORMATS: Final = (("time", "lat", "lon"), ("t_s", "x", "y"))
_READERS: Final[dict[str, Callable[[FilePath], Fixes]]] = {".gpx": _gpx, ".csv": _csv}


def _in_order(file: FilePath, fixes: Sequence[Fix], *, geodetic: bool) -> Fixes:
    """The fixes of a file, sorted; a time without a zone is UTC. Raises ``ScenarioError`` unless they are a track."""
    zero, times = None, [row[1] for row in fixes]
    if geodetic:
        dated = [when if when.tzinfo else when.replace(tzinfo=UTC) for when in times]
        zero = min(dated)
        times = [(when - zero).total_seconds() for when in dated]
    t, same = np.unique(np.array(times, dtype=float), return_inverse=True)
    if len(t) < 2:
        raise ScenarioError("has a single fix", file=str(file), expected="a track of at least two")
    if np.diff(t).min() < _SHORTEST_S / 2:  # exact fractions of a second are rounded
        close = int(np.diff(t).argmin()) + 1
        line = fixes[int(np.flatnonzero(same == close)[0])][0]
        what = f"a fix {t[close] - t[close - 1]:g} s after the one before it"
        expected = f"fixes at one instant, or at least {_SHORTEST_S:g} s apart"
        raise ScenarioError(what, file=f"{file}:{line}", expected=expected)
    sums = [np.bincount(same, weights=[row[i] for row in fixes]) for i in (2, 3)]
    return Fixes(t, np.column_stack(sums) / np.bincount(same)[:, None], geodetic, zero)
