"""The architecture ``clusters``."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from trackfield.scenario.architectures.architecture import BASE_WORDS, BaseSection
from trackfield.scenario.quantities import Joules
from trackfield.scenario.section import Id

CLUSTERS: Final = "clusters"

Policies = Literal[
    "closest",
    "merge_until_3",
    "all",
    "nearest_4",
    "nearest_5",
    "information_2",
    "information_4",
    "information_5",
    "trace",
]


class Clusters(BaseSection):
    """Masters with slaves: the master that is nearest to the target leads, and tells a base."""

    kind: Literal["clusters"] = Field(
        default=CLUSTERS, description="no centre: masters lead in turn, each with sensors as slaves"
    )
    masters: int | None = Field(default=None, ge=1, le=1000, description="how many; unset: one for four sensors")
    placement: Literal["random", "among"] = Field(
        default="among", description="where they stand: anywhere in the field, or among the sensors, spread over them"
    )
    capacity: int = Field(default=5, ge=1, le=50, description="the most slaves that a master has")
    base: Id = Field(default="base", json_schema_extra={"expected": BASE_WORDS}, description="the base's id")
    policy: Policies = Field(
        default="merge_until_3",
        description="who measures next: slaves of the closest master; of the next ones, too, until there are 3; ...",
    )
    beacon_every: int = Field(default=10, ge=2, le=250, description="steps for which a beacon keeps a slave awake")
    listen_every: int = Field(default=1, ge=1, le=250, description="steps between the windows of a sleeping slave")
    share_every: int = Field(default=2, ge=1, le=1000, description="steps after which a leader shares its belief")
    base_every: int = Field(
        default=0, ge=0, le=1000, description="steps after which the base is told; 0: as the radio allows"
    )
    timeout_steps: int = Field(
        default=4, ge=1, le=1000, description="a leader that is silent for so many steps is taken for dead"
    )
    handover: Literal["gaussian", "particles"] = Field(
        default="gaussian", description="the form in which a belief is handed over"
    )
    unasked: bool | None = Field(
        default=None,
        strict=True,
        description="slaves that sense a target report it, even if nobody woke them; unset: if fusion.prior is none",
    )
    announcements: int = Field(default=3, ge=1, le=100, description="how often a master announces itself")
    renew_s: float = Field(default=1800.0, ge=1, le=1e6, description="a slave renews its place after so long")
    master_battery_j: Joules | None = Field(default=None, description="battery of each master; unset: mains")
