"""All sensor nodes report to one fusion centre."""

from __future__ import annotations

from dataclasses import dataclass

from launcher.plan.architectures.arranged import Arranged
from launcher.plan.architectures.field import Field


@dataclass(frozen=True)
class Centralised:
    """All sensor nodes report to one fusion centre, which tracks; its clock is the reference of theirs."""

    centre: str = "fusion"

    def arrange(self, field: Field) -> Arranged:
        """See ``Architecture``; the centre comes first."""
        ids = [id for id, *_ in field.sensors]
        centre = field.fusion_centre(self.centre, *field.centre, ids, route=field.route)
        return Arranged([centre, *field.sensor_nodes(self.centre)], {"base": [self.centre]})
