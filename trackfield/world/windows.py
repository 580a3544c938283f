"""When each sensor can hear a target: audible windows of many sensors along one path.

The path is split into short pieces, each inside a circle (a cubic lies within the hull of its Bezier control
points). Joined two by two, up to the whole path, the pieces form a tree, which is searched for all sensors
together: a sensor out of reach of a circle is out of reach of all pieces below it, a sensor whose range encloses
the circle hears all pieces below it, and only otherwise are the two halves examined. Pieces that are undecided at
the bottom count as audible, so a window may be a piece too long at either end, but never too short.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trackfield.errors import ScenarioError
from trackfield.sensing.readings import Window
from trackfield.world.path import Path

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Windows = tuple[Window, ...]

_NS: Final = 1e9
_ROUNDING: Final = 1.0 + 1e-9
"""Covers the rounding difference between a level computed from a distance and a radius from a level."""

MOST_PIECES: Final = 5_000_000
"""Pieces of a path that are looked at, which takes 1.7 GB: 3300 km past sensors that hear 56 m."""
MOST_PAIRS: Final = 20_000_000
"""Pairs of a sensor and a part of a path that it may hear or not."""


@dataclass(frozen=True)
class _Pieces:
    """Consecutive pieces of a path: their times ``t`` (n, 2) in s, boxes ``low`` to ``high`` (n, 2)."""

    t: Array
    low: Array
    high: Array

    def joined(self) -> _Pieces:
        """Two by two; the last stays alone if their number is odd."""
        left = np.arange(0, len(self.t), 2)
        right = np.minimum(left + 1, len(self.t) - 1)
        return _Pieces(
            np.column_stack([self.t[left, 0], self.t[right, 1]]),
            np.minimum(self.low[left], self.low[right]),
            np.maximum(self.high[left], self.high[right]),
        )


def windows(positions: Array, path: Path, radius_m: float) -> list[Windows]:
    """When the target may be within ``radius_m`` of each of the ``positions`` (n, 2), as (from ns, to ns).

    No instant at which it is within is missing. Where a window is too long, the target is beyond the radius
    by no more than an eighth of it, or two metres. Raises ``ValueError`` for a path that was cut, ``ScenarioError``
    for one that is too long to be followed past so many sensors with so short a reach.
    """
    found: list[Windows] = [()] * len(positions)
    if radius_m <= 0 or not len(positions):
        return found
    tree = [_pieces(path, max(radius_m / 25.0, 0.5), radius_m)]
    while len(tree[-1].t) > 1:
        tree.append(tree[-1].joined())
    sensor, first, last = _within(np.asarray(positions, dtype=np.float64), tree, radius_m * _ROUNDING)
    new = np.append(True, (sensor[1:] != sensor[:-1]) | (first[1:] > last[:-1] + 1))[: len(sensor)]
    begin = np.floor(tree[0].t[first[new], 0] * _NS).astype(np.int64)
    end = np.ceil(tree[0].t[last[np.roll(new, -1)], 1] * _NS).astype(np.int64)
    for i, window in zip(sensor[new].tolist(), zip(begin.tolist(), end.tolist(), strict=True), strict=True):
        found[i] += (window,)
    return found


def merged(parts: Iterable[Windows]) -> Windows:
    """The union of the windows of several paths, in order and disjoint."""
    found: list[Window] = []
    for begin, end in sorted(window for part in parts for window in part):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end)
        else:
            found.append((begin, end))
    return tuple(found)


def distances(positions: Array, path: Path, within_m: float) -> Array:
    """(n,) metres from ``positions`` (n, 2) to the nearest point of the path; infinite beyond ``within_m``.

    Never too short; near ``within_m``, too long by less than 0.1 % of it. Raises as ``windows`` does.
    """
    from scipy.spatial import cKDTree

    pieces = _knots(path, within_m / 50.0, within_m)
    points = np.vstack([pieces[:, 0, 1:3], pieces[-1:, 1, 1:3]])
    nearest, _ = cKDTree(points).query(positions, distance_upper_bound=within_m)
    return np.asarray(nearest)


def _within(positions: Array, tree: list[_Pieces], radius: float) -> tuple[Indices, Indices, Indices]:
    """(sensor, first piece, last piece) in which it may hear the target, sorted by sensor and piece."""
    sensor: Indices = np.arange(len(positions))
    node: Indices = np.zeros(len(positions), dtype=np.intp)
    found: list[Indices] = []
    for level in range(len(tree) - 1, -1, -1):
        low, high = tree[level].low[node], tree[level].high[node]
        centre = np.hypot(*(positions[sensor] - (low + high) / 2).T)
        reach = np.hypot(*(high - low).T) / 2
        near = centre <= radius + reach
        heard = near & ((centre <= radius - reach) | (level == 0))
        first = node[heard] << level
        last = np.minimum(first + (1 << level), len(tree[0].t)) - 1
        found.append(np.stack([sensor[heard], first, last]))
        doubt = near & ~heard
        if (pairs := 2 * int(doubt.sum()) + sum(map(len, (one[0] for one in found)))) > MOST_PAIRS:
            what = f"there are {pairs} pairs of a sensor and a part of the path near the end of its reach"
            raise ScenarioError(what, key="target", expected=f"at most {MOST_PAIRS}: a shorter path, or fewer sensors")
        sensor, node = np.repeat(sensor[doubt], 2), np.repeat(node[doubt] * 2, 2)
        node[1::2] += 1
        if level:
            exists = node < len(tree[level - 1].t)
            sensor, node = sensor[exists], node[exists]
    sensor, first, last = np.hstack(found)
    order = np.lexsort([first, sensor])
    return sensor[order], first[order], last[order]


def _pieces(path: Path, length_m: float, reach_m: float) -> _Pieces:
    """The path in pieces as of ``_knots``, each with the box around its Bezier control points."""
    knots = _knots(path, length_m, reach_m)
    begin, end = knots[:, 0], knots[:, 1]
    third = (end[:, :1] - begin[:, :1]) / 3
    hull = np.stack(
        [begin[:, 1:3], begin[:, 1:3] + third * begin[:, 3:], end[:, 1:3] - third * end[:, 3:], end[:, 1:3]]
    )
    return _Pieces(knots[:, :, 0], hull.min(axis=0), hull.max(axis=0))


def _knots(path: Path, length_m: float, reach_m: float) -> Array:
    """(n, 2, 5): the knots (t, x, y, vx, vy) at both ends of each piece of about this length.

    Raises ``ScenarioError`` for too long a path; it names the reach from which ``length_m`` follows.
    """
    if path.missing:
        raise ValueError("the path was cut, and does not give the target's position in the missing parts")
    knots = np.column_stack([path.t, path.x, path.y, path.vx, path.vy])
    ends = np.stack([knots[:-1], knots[1:]], axis=1)
    ends = ends[ends[:, 1, 0] > ends[:, 0, 0]]
    if not len(ends):
        return np.stack([knots[-1:], knots[-1:]], axis=1)
    h = ends[:, 1, 0] - ends[:, 0, 0]
    chord = np.hypot(*(ends[:, 1, 1:3] - ends[:, 0, 1:3]).T)
    speeds = np.hypot(ends[:, :, 3], ends[:, :, 4])
    parts = np.maximum(np.ceil((chord + h * speeds.sum(axis=1) / 3) / length_m), 1)
    if not parts.sum() <= MOST_PIECES:
        far_km = float(np.maximum(chord, h * speeds.mean(axis=1)).sum()) / 1e3
        what = f"the path, {far_km:.3g} km, is too long to be searched for sensors within {reach_m:.3g} m of it"
        most_km = far_km * MOST_PIECES / parts.sum()
        raise ScenarioError(what, key="target", expected=f"at most about {most_km:.3g} km, or a longer reach")
    parts = parts.astype(np.intp)
    whole = np.repeat(np.arange(len(h)), parts)
    number = np.arange(len(whole)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (number[:, None] + np.array([0, 1])) / parts[whole][:, None]
    return _evaluate(ends[whole], h[whole], share)


def _evaluate(ends: Array, h: Array, share: Array) -> Array:
    """(n, m, 5) knots at ``share`` (n, m) of stretches of ``h`` (n,) seconds between ``ends`` (n, 2, 5)."""
    t0, p0, p1, v0, v1 = ends[:, 0, :1], ends[:, 0, 1:3], ends[:, 1, 1:3], ends[:, 0, 3:], ends[:, 1, 3:]
    h = h[:, None]
    mean = (p1 - p0) / h
    c2, c3 = (3 * mean - 2 * v0 - v1) / h, (v0 + v1 - 2 * mean) / h**2
    v0, c2, c3, p0, s = v0[:, None], c2[:, None], c3[:, None], p0[:, None], (share * h)[:, :, None]
    return np.concatenate([t0[:, None] + s, p0 + s * (v0 + s * (c2 + s * c3)), v0 + s * (2 * c2 + 3 * s * c3)], axis=-1)
