"""What all architectures have in common."""

from __future__ import annotations

from pydantic import Field, JsonValue, field_validator

from trackfield.scenario.places import RESERVED
from trackfield.scenario.section import ID_WORDS, Id, Section, wrong

_CENTRE: JsonValue = f"{ID_WORDS}, other than {', '.join(RESERVED)}"


class ArchitectureSection(Section):
    """An architecture; ``kind`` is its name."""

    kind: str
    centre: Id = Field(default="fusion", json_schema_extra={"expected": _CENTRE}, description="the fusion centre's id")

    @field_validator("centre")
    @classmethod
    def _free(cls, centre: str) -> str:
        if centre in RESERVED:
            raise wrong(f"is {centre!r}, which names another process of the run", str(_CENTRE))
        return centre
