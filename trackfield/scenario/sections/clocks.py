"""``[clock]``: the nodes' clocks."""

from __future__ import annotations

from pydantic import Field

from trackfield.scenario.section import Section


class Clocks(Section):
    """The sensor nodes' clocks; the fusion centre's is the reference, and right."""

    offset_ms: float = Field(
        default=0.0, ge=0, le=1e9, description="standard deviation of a node's clock offset at the start"
    )
    drift_ppm: float = Field(
        default=0.0, ge=0, le=10_000, description="standard deviation of a node's clock drift (us in a second)"
    )
    ramp_ppm_per_h: float = Field(
        default=0.0, ge=-100, le=100, description="by how much every node's drift grows in an hour, as it warms up"
    )
    sync: bool = Field(
        default=True, description="nodes whose clocks are off ask the centre for the time, over the radio"
    )
    exchanges: int = Field(
        default=8, ge=1, le=1000, description="requests and replies of a synchronisation; the quickest pair counts"
    )
    resync_s: float = Field(
        default=60.0, ge=0.1, le=1e6, description="a node that stays awake synchronises again after this time"
    )

    @property
    def off(self) -> bool:
        """Whether any clock can be wrong."""
        return bool(self.offset_ms or self.drift_ppm or self.ramp_ppm_per_h)
