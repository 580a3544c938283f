"""Sound of a point source, and the bearings at which it is heard.

Every function takes numbers, or arrays with ``xp=numpy``: numpy shares the names with ``math``, so nodes that
never load numpy use the same formulas. Bearings are in radians, clockwise from north (+y).
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

T = TypeVar("T")  # float, or an array of them


def level_db(distance: T, source_db: float, alpha: float, xp: Any = math) -> T:
    """Received level in dB at ``distance`` metres (Zhai et al. 2009, eq. 1).

    The received power falls with distance^(alpha/2), so alpha=2 loses 10 dB a decade. ``source_db`` is the
    level at 1 m, and nearer than that the level stays there.
    """
    d: Any = distance
    # max(d, 1) written so that it serves numbers and arrays alike
    level: T = source_db - 5.0 * alpha * xp.log10(d + (d < 1.0) * (1.0 - d))
    return level


def audible_radius(source_db: float, alpha: float, threshold_db: float) -> float:
    """Distance in metres at which the level has fallen to ``threshold_db``: the inverse of ``level_db``.

    Zero if the source is not audible even at 1 m.
    """
    if threshold_db > source_db:
        return 0.0
    return math.pow(10.0, (source_db - threshold_db) / (5.0 * alpha))


def bearing(dx: T, dy: T, xp: Any = math) -> T:
    """Direction of the vector (dx east, dy north), in [-pi, pi] (Zhai et al. 2009, eq. 4)."""
    angle: T = xp.atan2(dx, dy)
    return angle


def wrap(angle: T) -> T:
    """The same direction in [-pi, pi); numbers and arrays alike."""
    turned: Any = (angle + math.pi) % math.tau  # type: ignore[operator]
    # a tiny negative angle + pi rounds up to a full turn
    wrapped: T = turned - math.tau * (turned >= math.tau) - math.pi
    return wrapped
