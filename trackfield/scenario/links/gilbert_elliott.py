"""The link model ``gilbert_elliott``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import LinkSection
from trackfield.scenario.quantities import Delay, Duration, Jitter, Share


class GilbertElliott(LinkSection):
    """Bursts of losses, random delay."""

    model: Literal["gilbert_elliott"] = Field(default="gilbert_elliott", description="losses in bursts, random delay")
    good_s: Duration = Field(default=50.0, description="mean time that a link stays good")
    bad_s: Duration = Field(default=4.0, description="mean time that a link stays bad")
    loss_good: Share = Field(default=0.0, description="share of the frames lost while it is good")
    loss_bad: Share = Field(default=1.0, description="share of the frames lost while it is bad")
    delay_ms: Delay = Field(default=20.0, description="shortest time from sending to arrival")
    jitter_ms: Jitter = Field(default=10.0, description="mean of the exponentially distributed extra delay")
