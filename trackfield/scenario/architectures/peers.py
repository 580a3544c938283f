"""The architectures in which any node may lead: ``location-central`` and ``elected``."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from trackfield.scenario.architectures.architecture import BASE_WORDS, BaseSection
from trackfield.scenario.section import Id

LOCATION_CENTRAL: Final = "location-central"
ELECTED: Final = "elected"
MOST_CHOSEN: Final = 50

Form = Literal["gaussian", "modes", "particles"]


class PeersSection(BaseSection):
    """What both have in common."""

    base: Id = Field(default="base", json_schema_extra={"expected": BASE_WORDS}, description="the base's id")
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
