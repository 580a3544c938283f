"""The architectures in which any node may lead: ``location-central`` and ``elected``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

from pydantic import Field, JsonValue, field_validator

from trackfield.scenario.architectures.architecture import ArchitectureSection
from trackfield.scenario.places import RESERVED
from trackfield.scenario.section import ID_WORDS, Id, wrong

LOCATION_CENTRAL: Final = "location-central"
ELECTED: Final = "elected"
MOST_CHOSEN: Final = 50
_BASE: JsonValue = f"{ID_WORDS}, other than {', '.join(RESERVED)}"

Form = Literal["gaussian", "modes", "particles"]


class PeersSection(ArchitectureSection):
    """What both have in common."""

    base: Id = Field(default="base", json_schema_extra={"expected": _BASE}, description="the base's id")
    multihop: bool = Field(
        default=False,
        strict=True,
        description="the base is told over a tree of several hops; then no receiver ever sleeps",
    )
    base_every: int = Field(
        default=1,
        ge=0,
        le=1000,
        description="steps after which the base is told over the tree; 0: as the radio allows; without one: at each",
    )
    handover: Form = Field(
        default="modes",
        description="the form in which a belief is handed over: one Gaussian, one for each motion model, or particles",
    )
    silent_steps: int = Field(
        default=3, ge=1, le=1000, description="a track without a report for so many steps in a row is given up"
    )
    expiry_steps: int = Field(
        default=10, ge=2, le=1000, description="steps for which it holds that a node senses the target"
    )
    announcements: int = Field(default=3, ge=1, le=100, description="how often a node announces itself at the start")

    @field_validator("base")
    @classmethod
    def _free(cls, base: str) -> str:
        if base in RESERVED:
            raise wrong(f"is {base!r}, which names another process of the run", str(_BASE))
        return base

    @property
    def options(self) -> Mapping[str, bool | int | float | str]:
        """See ``ArchitectureSection``."""
        given = self.model_dump(exclude={"kind"}, exclude_none=True)
        return dict(given)

    @property
    def centre_id(self) -> str | None:
        """See ``ArchitectureSection``."""
        return self.base

    @property
    def centre_key(self) -> str:
        """See ``ArchitectureSection``."""
        return "architecture.base"


class LocationCentral(PeersSection):
    """The sensors nearest to the target measure, and one of them leads (Yu et al.)."""

    kind: Literal["location-central"] = Field(
        default=LOCATION_CENTRAL, description="no centre: the nearest sensors measure, and one of them leads"
    )
    sensors: int = Field(default=4, ge=1, le=MOST_CHOSEN, description="how many measure at a step")
    sticky: bool = Field(
        default=True,
        strict=True,
        description="a head leads on while it is one of the nearest; false: only while it is the nearest",
    )


class Elected(PeersSection):
    """Nodes that sense a target elect a head, which picks the best of those that join it (Zhou et al.)."""

    kind: Literal["elected"] = Field(
        default=ELECTED, description="no centre: nodes that sense a target elect a head and join it"
    )
    sensors: int = Field(default=3, ge=1, le=MOST_CHOSEN, description="how many measure at a step")
    keep_within: float = Field(
        default=0.5, gt=0, le=10, description="a head leads on while it is so near to the target, in ranges of a sensor"
    )
    lease_steps: int = Field(default=2, ge=2, le=1000, description="a head that is silent for so many steps is gone")
    local: bool = Field(
        default=False, strict=True, description="sensors filter, and send what they conclude in place of readings"
    )
    combine: Literal["product", "intersection"] = Field(
        default="product", description="how the head combines that: a product corrected for the prior, or by covariance"
    )
