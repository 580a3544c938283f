"""The architecture ``centralised``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

from pydantic import Field, JsonValue, field_validator

from trackfield.scenario.architectures.architecture import ArchitectureSection
from trackfield.scenario.places import RESERVED
from trackfield.scenario.section import ID_WORDS, Id, wrong

CENTRALISED: Final = "centralised"
_CENTRE: JsonValue = f"{ID_WORDS}, other than {', '.join(RESERVED)}"


class Centralised(ArchitectureSection):
    """All sensor nodes report to one fusion centre."""

    kind: Literal["centralised"] = Field(default=CENTRALISED, description="all nodes report to one fusion centre")
    centre: Id = Field(default="fusion", json_schema_extra={"expected": _CENTRE}, description="the fusion centre's id")
    multihop: bool = Field(
        default=False,
        strict=True,
        description="messages to and from the centre go over as many nodes as it takes, by a tree",
    )

    @field_validator("centre")
    @classmethod
    def _free(cls, centre: str) -> str:
        if centre in RESERVED:
            raise wrong(f"is {centre!r}, which names another process of the run", str(_CENTRE))
        return centre

    @property
    def options(self) -> Mapping[str, bool | int | float | str]:
        """See ``ArchitectureSection``."""
        return {"centre": self.centre, "multihop": self.multihop}

    @property
    def centre_id(self) -> str | None:
        """See ``ArchitectureSection``."""
        return self.centre
