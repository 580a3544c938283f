"""The architecture ``cpa``: sensors that hear targets pass, in clusters that say where each passed."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from trackfield.scenario.architectures.architecture import BASE_WORDS, BaseSection
from trackfield.scenario.section import Id

CPA: Final = "cpa"


class Cpa(BaseSection):
    """Clusters of sensors report when they were passed; their heads solve for the path (Yang et al.)."""

    kind: Literal["cpa"] = Field(
        default=CPA, description="no centre: clusters whose heads say where a target passed, and a base that asks them"
    )
    base: Id = Field(default="base", json_schema_extra={"expected": BASE_WORDS}, description="the base's id")
    heads: Literal["fixed", "loudest"] = Field(
        default="fixed",
        description="clusters of size sensors by their order, of which the first one alive leads; or a cluster forms "
        "around the sensor that heard the target loudest",
    )
    size: int = Field(default=5, ge=4, le=50, description="sensors of a cluster, if heads are fixed")
    interest_s: float = Field(
        default=9.0, ge=3, le=3600, description="how long an interest lives; it is spread anew every third of that"
    )
    most_hops: int | None = Field(
        default=None,
        ge=1,
        le=16,
        description="how many hops an interest of a head goes; unset: 4 with fixed heads, also to those of the next "
        "clusters, and 2 with the loudest",
    )
    reports: int = Field(
        default=5, ge=0, le=8, description="the most reports of an event that a head picks; 0: all, as far as 8"
    )
    announcements: int = Field(default=3, ge=1, le=100, description="how often a node announces itself at the start")
