"""The link model ``serial``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import LinkSection


class Serial(LinkSection):
    """A serial line: bytes at a baud rate."""

    model: Literal["serial"] = Field(default="serial", description="a line on which bytes follow each other, none lost")
    baud: int = Field(default=115_200, ge=50, le=10_000_000, description="bits per second; a byte is ten")
    queue: int = Field(
        default=32, ge=1, le=10_000, description="most frames that wait while one is sent; further ones are dropped"
    )
