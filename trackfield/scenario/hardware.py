"""What processes run on: their clocks and their energy."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from trackfield.scenario.section import Section

Joules = Annotated[float, Field(gt=0, le=1e9)]


class Clocks(Section):
    """The sensor nodes' clocks; the fusion centre's is the reference, and right."""

    offset_ms: float = Field(
        default=0.0, ge=0, le=1e9, description="standard deviation of how far a node's clock is off at the start"
    )
    drift_ppm: float = Field(
        default=0.0, ge=0, le=10_000, description="standard deviation of how fast a node's clock gains (us in a second)"
    )
    ramp_ppm_per_h: float = Field(
        default=0.0, ge=-1000, le=1000, description="by how much every node's drift grows in an hour, as it warms up"
    )
    sync: bool = Field(
        default=True, description="nodes whose clocks are off ask the centre for the time, over the radio"
    )
    exchanges: int = Field(
        default=8, ge=1, le=1000, description="questions and answers of a synchronisation; the quickest counts"
    )
    resync_s: float = Field(
        default=60.0, gt=0, le=1e6, description="a node that stays awake synchronises again after that"
    )

    @property
    def off(self) -> bool:
        """Whether any clock can be wrong."""
        return bool(self.offset_ms or self.drift_ppm or self.ramp_ppm_per_h)


class Energy(Section):
    """What devices draw, and from what."""

    device: Literal["cc2420", "cc2420-20dbm", "sx1276", "wifi11b"] | None = Field(
        default=None, description="whose power figures count; unset: those of link.radio, or else cc2420"
    )
    battery_j: Joules | None = Field(default=None, description="in each sensor node; unset: mains, never empty")
    centre_battery_j: Joules | None = Field(default=None, description="in the fusion centre; unset: mains, never empty")
    sample_mj: float = Field(default=0.0, ge=0, le=1e9, description="spent on each reading of the sensor")
