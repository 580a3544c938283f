"""The layers of the field's view: truth, tracks, readings of sensors, close-ups."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from launcher.timeline.layers.rays import rays
from launcher.timeline.scene import Points

Layer = Callable[
    [Mapping[str, Sequence[float]], Mapping[str, tuple[float, float]], Iterable[tuple[float, float]], float], Points
]
"""Lines (n, 2, 2) in metres: of readings by sensor, the sensors' places, the latest fixes, and the reach (m)."""

READINGS: Final[Mapping[str, Layer]] = {"rays": rays}
"""How readings are drawn, by the layer that a kind of sensing names."""
