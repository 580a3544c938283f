"""``[energy]``: what devices draw."""

from __future__ import annotations

from pydantic import Field

from trackfield.scenario.quantities import Joules, Millijoules
from trackfield.scenario.radios import Device
from trackfield.scenario.section import Section


class Energy(Section):
    """The power that devices draw, and their batteries."""

    device: Device | None = Field(
        default=None, description="device whose power figures are used; unset: that of link.radio, or else cc2420"
    )
    battery_j: Joules | None = Field(default=None, description="battery of each sensor node; unset: mains, never empty")
    centre_battery_j: Joules | None = Field(
        default=None, description="battery of the fusion centre; unset: mains, never empty"
    )
    sample_mj: Millijoules = Field(default=0.0, description="energy of each reading of the sensor")
