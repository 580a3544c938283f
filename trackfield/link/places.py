"""Places of processes, and their positions over time if they move."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from math import dist
from typing import TypeGuard, cast

Point = tuple[float, float]
"""Metres east and north."""

Path = tuple[tuple[int, float, float], ...]
"""Legs (t ns, metres east, metres north), at least one, in increasing time: straight and at constant speed from each
to the next, at rest before the first and after the last."""

Places = Mapping[str, Point | Path]
"""Where processes are, by id: a point, or a path for one that moves."""


def moves(place: Point | Path) -> TypeGuard[Path]:
    """Whether this is a path."""
    return isinstance(place[0], tuple)


def position(places: Places, id: str, t_ns: int) -> Point:
    """Where a process is at an instant (true time). Raises ``KeyError`` for one whose place is not known."""
    place = places[id]
    return _along(place, t_ns) if moves(place) else cast(Point, place)


def distance_m(places: Places, a: str, b: str, t_ns: int) -> float:
    """The distance between two processes at an instant. Raises ``KeyError`` for one whose place is not known."""
    return dist(position(places, a, t_ns), position(places, b, t_ns))


def _along(path: Path, t_ns: int) -> Point:
    after = bisect_right(path, t_ns, key=lambda leg: leg[0])
    if after in (0, len(path)):
        return path[max(after - 1, 0)][1:]
    (t0, x0, y0), (t1, x1, y1) = path[after - 1], path[after]
    share = (t_ns - t0) / (t1 - t0)
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0)
