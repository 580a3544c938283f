"""All sensor nodes report to one fusion centre."""

from __future__ import annotations

from dataclasses import dataclass, replace

from launcher.plan.architectures.arranged import Arranged
from launcher.plan.architectures.field import Field


@dataclass(frozen=True)
class Centralised:
    """All sensor nodes report to one fusion centre, which tracks; its clock is the reference of theirs.

    If ``multihop``, the nodes hand on each other's messages to and from the centre, over a tree.
    """

    centre: str = "fusion"
    multihop: bool = False

    def arrange(self, field: Field) -> Arranged:
        """See ``Architecture``; the centre comes first."""
        ids = [id for id, *_ in field.sensors]
        centre = field.fusion_centre(self.centre, *field.centre, ids, route=field.route)
        base = self.centre if self.multihop else ""
        processes = [replace(process, base=base) for process in (centre, *field.sensor_nodes(self.centre))]
        return Arranged(processes, {"base": [self.centre]})
