"""Directions of arrival: a ray from each sensor along its bearing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from launcher.timeline.scene import Points


def rays(
    readings: Mapping[str, Sequence[float]],
    places: Mapping[str, tuple[float, float]],
    fixes: Iterable[tuple[float, float]],
    reach_m: float,
) -> Points:
    """From each sensor to a little past the first of the latest ``fixes``, else ``reach_m``: (n, 2, 2).

    The first number of its reading is the bearing, in degrees clockwise from north.
    """
    fix = next(iter(fixes), None)
    found = []
    for src, (bearing_deg, *_) in readings.items():
        (x, y), bearing = places[src], math.radians(bearing_deg)
        length = reach_m if fix is None else 1.15 * math.dist((x, y), fix) + 5.0
        found.append((x, y, x + length * math.sin(bearing), y + length * math.cos(bearing)))
    return np.reshape(found, (-1, 2, 2))
