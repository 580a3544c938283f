"""The link model ``trace``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.links.link import LinkSection
from trackfield.scenario.section import FileName


class Trace(LinkSection):
    """A measured link, replayed."""

    model: Literal["trace"] = Field(default="trace", description="a measured link, replayed")
    file: FileName = Field(
        description="CSV file (src,dst,t_s,received,delay_ms), relative to the scenario's own folder"
    )
