"""Targets whose paths are formulas: the three manoeuvres of Zhai et al. (2009), sec. V, and straight legs.

The paper plots its trajectories without their parameters; those here were chosen to match its figures.
Headings are counter-clockwise from east, as in the paper, inside this module only.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil, cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from trackfield.draw import normal
from trackfield.world.path import Knot, Path


def s1(seed: int, steps: int = 60, step_s: float = 1.0, id: str = "target") -> Path:
    """Scenario 1: straight motion disturbed by a random acceleration (sd 0.1 m/s^2) that holds for a step.

    Starts at (50, 70) m with (6, 5) m/s and lasts ``steps`` times ``step_s`` seconds; another seed or
    ``id`` gives another path.
    """
    x, y, vx, vy = 50.0, 70.0, 6.0, 5.0
    knots: list[Knot] = [(0.0, x, y, vx, vy)]
    for k in range(steps):
        ax, ay = (0.1 * normal(seed, id, 0, axis, k) for axis in ("ax", "ay"))
        x, vx = x + vx * step_s + 0.5 * ax * step_s**2, vx + ax * step_s
        y, vy = y + vy * step_s + 0.5 * ay * step_s**2, vy + ay * step_s
        t = round((k + 1) * step_s * 1e9) / 1e9  # whole ns, as a driver's steps are
        knots.append((t, x, y, vx, vy))
    return Path.of(knots)


def s2(end_s: float = 75.0) -> Path:
    """Scenario 2: two sharp turns of 90 degrees in 4 s, left from 20 s and right from 45 s.

    The speed is 8 + 2 sin(2 pi t / 15) m/s. Integrated by Gauss-Legendre quadrature to rounding; between the
    knots, a quarter of a second apart at most, the cubic is within 0.01 mm.
    """
    t = np.linspace(0.0, end_s, max(ceil(end_s / 0.25), 1) + 1)
    t = np.union1d(t, [corner for corner in (20.0, 24.0, 45.0, 49.0) if corner < end_s])
    nodes, weights = np.polynomial.legendre.leggauss(6)
    half = np.diff(t)[:, None] / 2
    moves = (_s2_velocity(t[:-1, None] + half * (nodes + 1)) * weights * half).sum(axis=-1)
    x, y = np.array([45.0, 85.0])[:, None] + np.hstack([np.zeros((2, 1)), moves.cumsum(axis=-1)])
    vx, vy = _s2_velocity(t)
    return Path.of(zip(*(column.tolist() for column in (t, x, y, vx, vy)), strict=True))


def _s2_velocity(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, ...) velocities of scenario 2 at times ``t`` (s)."""
    turned = 22.5 * (np.clip(t - 20.0, 0.0, 4.0) - np.clip(t - 45.0, 0.0, 4.0))
    heading = np.radians(8.0 + turned)
    velocity: NDArray[np.float64] = (8 + 2 * np.sin(2 * pi * t / 15)) * np.stack([np.cos(heading), np.sin(heading)])
    return velocity


def s3(end_s: float = 40.0) -> Path:
    """Scenario 3: straight on, 20 s of +1 m/s^2 from 1 m/s, then -1 m/s^2 until it stands at 41 s."""
    ux, uy = cos(radians(40.0)), sin(radians(40.0))

    def knot(t: float) -> Knot:
        rise, fall = min(t, 20.0), min(max(t - 20.0, 0.0), 21.0)
        way = rise + rise**2 / 2 + 21.0 * fall - fall**2 / 2
        speed = 1.0 + rise - fall
        return t, 70.0 + way * ux, 100.0 + way * uy, speed * ux, speed * uy

    return Path.of(map(knot, [0.0, *(t for t in (20.0, 41.0) if t < end_s), end_s]))


def waypoints(points: Sequence[tuple[float, float, float]]) -> Path:
    """Straight legs at constant speed through (t s, x m, y m); the velocity jumps at each waypoint.

    Raises ``ValueError`` unless there are at least two, with increasing times.
    """
    if len(points) < 2 or any(b[0] <= a[0] for a, b in pairwise(points)):
        raise ValueError("waypoints need increasing times, and at least two of them")
    knots: list[Knot] = []
    for (ta, xa, ya), (tb, xb, yb) in pairwise(points):
        vx, vy = (xb - xa) / (tb - ta), (yb - ya) / (tb - ta)
        knots += [(ta, xa, ya, vx, vy), (tb, xb, yb, vx, vy)]
    return Path.of(knots)
