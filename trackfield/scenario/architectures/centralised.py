"""The architecture ``centralised``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.architectures.architecture import ArchitectureSection


class Centralised(ArchitectureSection):
    """All sensor nodes report to one fusion centre."""

    kind: Literal["centralised"] = Field(default="centralised", description="all nodes report to one fusion centre")
