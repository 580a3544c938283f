"""The messages that Trackfield's roles exchange; docs/wire.md prints them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from trackfield.wire.registry import Scaled, kind


@kind(1, "doa")
@dataclass(frozen=True, slots=True)
class Doa:
    """What a sensor node heard at one of the filter's instants: from where, and how loud.

    ``bearing_deg`` points from the node to the sound, clockwise from north (+y).
    """

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    bearing_deg: Annotated[float, Scaled(0, 359.99, 0.01, "degree", cyclic=True)]
    level_db: Annotated[float, Scaled(-50, 200, 0.01, "dB")]
