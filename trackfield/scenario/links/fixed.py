"""The link model ``fixed``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import LinkSection
from trackfield.scenario.quantities import Delay, Share


class Fixed(LinkSection):
    """Independent losses, constant delay."""

    model: Literal["fixed"] = Field(default="fixed", description="independent losses, constant delay")
    loss: Share = Field(default=0.05, description="share of the frames lost")
    delay_ms: Delay = Field(default=5.0, description="from sending to arrival")
