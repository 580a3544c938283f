"""What all architectures have in common."""

from __future__ import annotations

from collections.abc import Mapping

from trackfield.scenario.section import Section


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
