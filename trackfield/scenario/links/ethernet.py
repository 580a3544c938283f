"""The link model ``ethernet``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import LinkSection
from trackfield.scenario.quantities import Delay


class Ethernet(LinkSection):
    """A wire: loses nothing, constant delay."""

    model: Literal["ethernet"] = Field(default="ethernet", description="a wire: loses nothing, constant delay")
    delay_ms: Delay = Field(default=1.0, description="from sending to arrival")
