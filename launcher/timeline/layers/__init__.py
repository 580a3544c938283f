"""The layers of the field's view: truth, tracks, readings of sensors, close-ups."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import rerun as rr

from launcher.timeline import look, rows
from launcher.timeline.layers.discs import discs
from launcher.timeline.layers.rays import rays
from launcher.timeline.layers.rings import rings
from launcher.timeline.scene import Points, Sight


class Layer(NamedTuple):
    """How readings are drawn: shapes of the numbers by sensor, the columns of these shapes, and how they look."""

    shapes: Callable[[Mapping[str, float], Sight], Points]
    columns: Callable[[list[Any]], rows.Columns]
    style: rr.AsComponents


READINGS: Final[Mapping[str, Layer]] = {
    "rays": Layer(rays, rows.strips, look.line_style(look.RAY, 1.2, order=5)),
    "rings": Layer(rings, rows.strips, look.line_style(look.RING, 1.0, order=5)),
    "discs": Layer(discs, rows.discs, look.disc_style(look.DISC, order=4)),
}
"""By the layer that a kind of sensing names."""
