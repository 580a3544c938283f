"""Directions of arrival: a ray from each sensor along its bearing."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from launcher.timeline.scene import Points, Sight


def rays(readings: Mapping[str, float], sight: Sight) -> Points:
    """From each sensor to a little past the first of the latest fixes, else as far as one sees: (n, 2, 2) m.

    Of readings the bearing, in degrees clockwise from north.
    """
    fix = next(iter(sight.fixes), None)
    found = []
    for src, bearing_deg in readings.items():
        (x, y), bearing = sight.places[src], math.radians(bearing_deg)
        length = sight.reach_m if fix is None else 1.15 * math.dist((x, y), fix) + 5.0
        found.append((x, y, x + length * math.sin(bearing), y + length * math.cos(bearing)))
    return np.reshape(found, (-1, 2, 2))
