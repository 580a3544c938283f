"""What all kinds of sensors have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from pydantic import Field

from trackfield.scenario.places import Place
from trackfield.scenario.section import Section
from trackfield.sensing.readings import Window
from trackfield.world.path import Path


class SensorSection(Section):
    """The sensors of a field, all of a kind; ``reach_key`` is the key that says how far they hear."""

    reach_key: ClassVar[str]

    kind: str
    position_error_m: float = Field(
        default=0.0,
        ge=0,
        le=10_000,
        description="standard deviation, east and north, of the error in the centre's knowledge of a sensor's place",
    )

    def reach_m(self) -> tuple[float, float]:
        """How near (m) a target has to be for a sensor to be awake, and for it to report, if its threshold is lowest.

        Raises ``ScenarioError`` for a user's own sensor that does not exist or whose options do not fit.
        """
        raise NotImplementedError

    def plain(self, place: Place, paths: Sequence[Path], windows: Sequence[Window], seed: int) -> dict[str, Any]:
        """The plain form of the sensor at a ``place``, with the targets' ``paths`` and when it can hear any of them."""
        raise NotImplementedError
