"""The link model ``csma154``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import Attempts, RadioSection


class Csma154(RadioSection):
    """The delays of 802.15.4 alone: who finds the channel busy five times gives up, all else arrives."""

    model: Literal["csma154"] = Field(default="csma154", description="the delays of an 802.15.4 radio in easy reach")
    ack: Attempts = Field(
        default=0, description="how often a frame is sent at most until it is acknowledged; 0: once, without"
    )
