"""Recorded fixes from GPX and CSV files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path as FilePath
from typing import Any, Final

import gpxpy
import gpxpy.gpx
import numpy as np
from numpy.typing import NDArray

from trackfield.errors import ScenarioError
from trackfield.world.rows import PLACES, Column, number, read_rows

Array = NDArray[np.float64]


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
        gpx = gpxpy.parse(file.read_text(encoding="utf-8-sig"))
    except (gpxpy.gpx.GPXException, UnicodeDecodeError):
        raise fail("not a GPX file") from None
    points = [point for track in gpx.tracks for segment in track.segments for point in segment.points]
    timed = [(point.time, point.latitude, point.longitude) for point in points if point.time]
    if not timed:
        raise fail(f"its {len(points)} points have no times" if points else "has no track points")
    for when, lat, lon in timed:
        if not (abs(lat) <= 90 and abs(lon) <= 180):
            raise fail(f"its point of {when} lies at latitude {lat}, longitude {lon}")
    return _in_order(file, timed, geodetic=True)


def _csv(file: FilePath) -> Fixes:
    """All rows; columns other than those of the format are ignored."""
    rows = [list(values.values()) for _, values in read_rows(file, _FORMATS, _COLUMNS)]
    return _in_order(file, rows, geodetic=isinstance(rows[0][0], datetime))


_COLUMNS: Final[dict[str, Column]] = {
    **PLACES,
    "time": (datetime.fromisoformat, "an ISO date and time"),
    "t_s": (partial(number, 1e9), "seconds"),
}
_FORMATS: Final = (("time", "lat", "lon"), ("t_s", "x", "y"))
_READERS: Final[dict[str, Callable[[FilePath], Fixes]]] = {".gpx": _gpx, ".csv": _csv}


def _in_order(file: FilePath, fixes: Sequence[Sequence[Any]], *, geodetic: bool) -> Fixes:
    """Rows of (time or seconds, first, second coordinate), sorted; a time without a zone is UTC."""
    zero, times = None, [row[0] for row in fixes]
    if geodetic:
        dated = [when if when.tzinfo else when.replace(tzinfo=UTC) for when in times]
        zero = min(dated)
        times = [(when - zero).total_seconds() for when in dated]
    t, same = np.unique(np.array(times, dtype=float), return_inverse=True)
    if len(t) < 2:
        raise ScenarioError("has a single fix", file=str(file), expected="a track of at least two")
    sums = [np.bincount(same, weights=[row[i] for row in fixes]) for i in (1, 2)]
    return Fixes(t, np.column_stack(sums) / np.bincount(same)[:, None], geodetic, zero)
