"""Energies: a disc on each sensor, the larger the louder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from launcher.timeline.scene import Points, Sight

LARGEST: Final = 0.9
"""The radius of the loudest disc, as a share of the distance between sensors."""


def discs(readings: Mapping[str, float], sight: Sight) -> Points:
    """The discs (n, 3): x, y and radius (m); of readings how large, from 0 to 1."""
    centres = np.reshape([sight.places[src] for src in readings], (-1, 2))
    radii = LARGEST * sight.spacing_m * np.clip(list(readings.values()), 0.0, 1.0)
    return np.column_stack((centres, radii))
