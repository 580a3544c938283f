"""The link model ``ideal``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import LinkSection


class Ideal(LinkSection):
    """Loses nothing, takes 1 ms."""

    model: Literal["ideal"] = Field(default="ideal", description="loses nothing, takes 1 ms")
