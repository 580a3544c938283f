"""What all architectures have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pydantic import JsonValue, field_validator

from trackfield.scenario.places import RESERVED
from trackfield.scenario.section import ID_WORDS, Section, wrong

BASE_WORDS: Final[JsonValue] = f"{ID_WORDS}, other than {', '.join(RESERVED)}"
"""What the id of a base may be."""


class ArchitectureSection(Section):
    """An architecture; ``kind`` is its name. What it makes of a field is its class's (docs/extending.md)."""

    kind: str

    @property
    def options(self) -> Mapping[str, bool | int | float | str]:
        """The arguments of its class."""
        raise NotImplementedError

    @property
    def centre_id(self) -> str | None:
        """The id that a file of places has to give to the fusion centre; None: any that no sensor has."""
        return None

    @property
    def centre_key(self) -> str:
        """The key that sets it."""
        return "architecture.centre"


class BaseSection(ArchitectureSection):
    """An architecture without a centre, whose process ``base`` is told of the track."""

    @field_validator("base", check_fields=False)
    @classmethod
    def _free(cls, base: str) -> str:
        if base in RESERVED:
            raise wrong(f"is {base!r}, which names another process of the run", str(BASE_WORDS))
        return base

    @property
    def options(self) -> Mapping[str, bool | int | float | str]:
        """See ``ArchitectureSection``."""
        given = self.model_dump(exclude={"kind"}, exclude_none=True)
        return dict(given)

    @property
    def centre_id(self) -> str | None:
        """See ``ArchitectureSection``."""
        return str(self.options["base"])

    @property
    def centre_key(self) -> str:
        """See ``ArchitectureSection``."""
        return "architecture.base"
