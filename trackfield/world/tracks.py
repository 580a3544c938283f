"""Targets from recorded tracks: a window of a GPX or CSV file, projected on a plane.

Latitude and longitude become metres east and north of the window's first fix, on the plane that touches the
ellipsoid there (heights are left out). Between two fixes the position follows a shape-preserving cubic
(Fritsch and Carlson 1980), so it never overshoots them. Where fixes are missing for longer, the target
moves in a straight line at constant speed, and the stretch is listed in ``Path.gaps``; so it does where the recording
jumps (``jumps.py``), which ``Path.jumps`` lists.
"""

from __future__ import annotations

from datetime import datetime, time
from pathlib import Path as FilePath
from typing import Final

import numpy as np
import pymap3d
from numpy.lib.stride_tricks import sliding_window_view

from trackfield.errors import ScenarioError
from trackfield.files import LONG_S
from trackfield.words import quoted
from trackfield.world.fixes import ISO, Array, Fixes, moment, read_fixes
from trackfield.world.jumps import Mask, jumps
from trackfield.world.path import Interval, Knot, Path
from trackfield.world.rows import number

GAP_S: Final = 5.0
"""Fixes further apart than this, and than three usual intervals of the file or around them, have a gap between them."""

_AROUND: Final = 10
"""The number of intervals on either side that define the usual one: some receivers record more fixes in turns."""

_DAY_S: Final = 86400


def read_track(
    file: FilePath,
    start: str | None = None,
    end: str | None = None,
    *,
    origin: Array | None = None,
    key: str = "target",
) -> Path:
    """The path in a ``.gpx`` or ``.csv`` file between two times; t=0 is ``start``, or else the first fix.

    Times are HH:MM[:SS] or a full ISO date and time, in the file's zone unless they name their own; seconds
    for a CSV file with a column ``t_s``. The fixes next to the window on either side still shape its ends.
    ``origin`` (2,) is the latitude and longitude of (0, 0); None: the window's first fix. Raises ``ScenarioError``
    with the ``key`` of the target if the file cannot be used, or has no fix inside the window.
    """
    fixes = read_fixes(file)
    (from_s, to_s), first, last = _inside(file, fixes, start, end, key)
    zero = fixes.points[first] if origin is None else origin
    xy = plane(fixes.points, zero) if fixes.geodetic else fixes.points
    gap = _gaps(fixes.t)
    jump = jumps(fixes.t, xy, gap)
    around = slice(max(first - 1, 0), last + 2)
    between = slice(around.start, min(around.stop, len(fixes.t)) - 1)
    return _through(fixes.t[around] - from_s, xy[around], gap[between], jump[between]).clip(0.0, to_s - from_s)


def path_through(t: Array, xy: Array) -> Path:
    """The path through fixes ``xy`` (n, 2) in metres at increasing times ``t`` (n,), at least two."""
    gap = _gaps(t)
    return _through(t, xy, gap, jumps(t, xy, gap))


def track_origin(
    file: FilePath, start: str | None = None, end: str | None = None, *, key: str = "target"
) -> Array | None:
    """(2,) latitude and longitude in degrees of the path's (0, 0); None where the file is in metres.

    Takes and raises what ``read_track`` does.
    """
    fixes = read_fixes(file)
    _, first, _ = _inside(file, fixes, start, end, key)
    return fixes.points[first] if fixes.geodetic else None


def track_start(
    file: FilePath, start: str | None = None, end: str | None = None, *, key: str = "target"
) -> tuple[datetime | None, float]:
    """The time of the path's t=0: seconds after a time, or as the file counts them, and then None.

    Takes and raises what ``read_track`` does.
    """
    fixes = read_fixes(file)
    (from_s, _), _, _ = _inside(file, fixes, start, end, key)
    return fixes.zero, from_s


def plane(degrees: Array, origin: Array) -> Array:
    """Metres (n, 2) east and north of ``origin`` (2,), for latitudes and longitudes (n, 2) in degrees."""
    east, north, _ = pymap3d.geodetic2enu(degrees[:, 0], degrees[:, 1], 0.0, origin[0], origin[1], 0.0)
    return np.column_stack([east, north])


def _inside(file: FilePath, fixes: Fixes, start: str | None, end: str | None, key: str) -> tuple[Interval, int, int]:
    """The window on the time scale of the fixes, and the first and last of the fixes inside."""
    from_s, to_s = _window(file, fixes, start, end, key)
    inside = np.flatnonzero((fixes.t >= from_s) & (fixes.t <= to_s))
    if not len(inside):
        raise ScenarioError("no fix inside the window", file=str(file), expected=f"times in {fixes.span()}")
    return (from_s, to_s), int(inside[0]), int(inside[-1])


def _gaps(t: Array) -> Mask:
    """Which of the intervals (n-1,) between the times ``t`` (n,) of a whole file are gaps."""
    intervals = np.diff(t)
    padded = np.pad(intervals, _AROUND, constant_values=np.nan)
    around = np.nanmedian(sliding_window_view(padded, 2 * _AROUND + 1), axis=-1)
    usual = np.minimum(around, np.median(intervals))
    return np.asarray(intervals > np.maximum(GAP_S, 3 * usual))


def _through(t: Array, xy: Array, gap: Mask, jump: Mask) -> Path:
    """The path through positions ``xy`` (n, 2) at increasing times ``t`` (n,), straight in a ``gap`` and a ``jump``."""
    from scipy.interpolate import PchipInterpolator

    knots: list[Knot] = []
    straight: list[Interval] = []
    after = np.flatnonzero(gap | jump) + 1
    for times, points in zip(np.split(t, after), np.split(xy, after), strict=True):
        if knots:
            ta, xa, ya = knots[-1][:3]
            tb, xb, yb = float(times[0]), float(points[0, 0]), float(points[0, 1])
            velocity = (xb - xa) / (tb - ta), (yb - ya) / (tb - ta)
            knots += [(ta, xa, ya, *velocity), (tb, xb, yb, *velocity)]
            straight.append((ta, tb))
        velocities = PchipInterpolator(times, points)(times, 1) if len(times) > 1 else np.zeros((1, 2))
        knots += map(tuple, np.column_stack([times, points, velocities]).tolist())
    jumped = jump[after - 1].tolist()
    gaps = [one for one, is_jump in zip(straight, jumped, strict=True) if not is_jump]
    return Path.of(knots, gaps, [one for one, is_jump in zip(straight, jumped, strict=True) if is_jump])


def _window(file: FilePath, fixes: Fixes, start: str | None, end: str | None, key: str) -> Interval:
    """(from, to) on the time scale of the fixes."""
    from_s = float(fixes.t[0]) if start is None else _moment(file, fixes, f"{key}.from", start, float(fixes.t[0]))
    to_s = float(fixes.t[-1]) if end is None else _moment(file, fixes, f"{key}.to", end, from_s)
    if to_s <= from_s:
        raise ScenarioError(
            "the window ends before it begins",
            file=str(file),
            key=f"{key}.to",
            expected=f"times in {fixes.span()}",
        )
    return from_s, to_s


def _moment(file: FilePath, fixes: Fixes, key: str, text: str, after_s: float) -> float:
    """A time on the scale of the fixes; a time of day is the first in the file at or after ``after_s``."""
    zero = fixes.zero
    try:
        if zero is None:
            return number(LONG_S, text)
        try:
            clock = time.fromisoformat(text)
        except ValueError:
            when = moment(text)
            return ((when if when.tzinfo else when.replace(tzinfo=zero.tzinfo)) - zero).total_seconds()
    except ValueError:
        expected = "seconds" if zero is None else f"HH:MM[:SS] or {ISO}"
        raise ScenarioError(f"{quoted(text)} is not a time", file=str(file), key=key, expected=expected) from None
    zone = clock.tzinfo or zero.tzinfo
    first = (datetime.combine(zero.astimezone(zone).date(), clock.replace(tzinfo=zone)) - zero).total_seconds()
    later = first + -(-(after_s - first) // _DAY_S) * _DAY_S
    return later if later <= fixes.t[-1] else first
