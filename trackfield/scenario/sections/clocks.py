"""``[clock]``: the clocks of processes."""

from __future__ import annotations

from pydantic import Field

from trackfield.scenario.section import Section


class Clocks(Section):
    """The clocks of all processes but the one that is the reference of a run, which is right.

    That is the architecture's choice: under ``centralised`` the fusion centre.
    """

    offset_ms: float = Field(
        default=0.0, ge=0, le=1e9, description="standard deviation of a clock's offset at the start"
    )
    drift_ppm: float = Field(
        default=0.0, ge=0, le=10_000, description="standard deviation of a clock's drift (us in a second)"
    )
    ramp_ppm_per_h: float = Field(
        default=0.0, ge=-100, le=100, description="by how much every drift grows in an hour, as the field warms up"
    )
    sync: bool = Field(
        default=True, description="processes whose clocks are off ask another for the time, over the radio"
    )
    exchanges: int = Field(
        default=8, ge=1, le=1000, description="requests and replies of a synchronisation; the quickest pair counts"
    )
    resync_s: float = Field(
        default=60.0, ge=0.1, le=1e6, description="a process that stays awake synchronises again after this time"
    )

    @property
    def off(self) -> bool:
        """Whether any clock can be wrong."""
        return bool(self.offset_ms or self.drift_ppm or self.ramp_ppm_per_h)
