"""Distances: a circle around each sensor, with the distance that it measured as its radius."""

from __future__ import annotations

from collections.abc import Mapping
from math import tau
from typing import Final

import numpy as np

from launcher.timeline.scene import Points, Sight

CORNERS: Final = 64
"""The corners of a circle."""


def rings(readings: Mapping[str, float], sight: Sight) -> Points:
    """The circles (n, 65, 2) m; of readings the distance (m), which is 0 if it is below."""
    turn = np.linspace(0.0, tau, CORNERS + 1)
    around = np.column_stack((np.sin(turn), np.cos(turn)))
    centres = np.reshape([sight.places[src] for src in readings], (-1, 1, 2))
    radii = np.reshape([max(radius, 0.0) for radius in readings.values()], (-1, 1, 1))
    found: Points = centres + radii * around
    return found
