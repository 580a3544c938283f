"""The link model ``csma154``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import Attempts, RadioSection


class Csma154(RadioSection):
    """The delays of 802.15.4 alone: a frame is lost only if its sender finds the channel busy five times."""

    model: Literal["csma154"] = Field(default="csma154", description="the delays of an 802.15.4 radio at short range")
    ack: Attempts = Field(
        default=0, description="most transmissions of a frame until it is acknowledged; 0: sent once, not acknowledged"
    )
