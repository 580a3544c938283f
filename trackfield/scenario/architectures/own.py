"""A user's own architecture."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import ConfigDict, Field

from trackfield.scenario.architectures.architecture import ArchitectureSection
from trackfield.scenario.quantities import Option


class OwnArchitecture(ArchitectureSection):
    """An architecture that a user adds (docs/extending.md); further keys are its options, checked by its class."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Option]

    kind: str = Field(
        min_length=1,
        max_length=100,
        description="an architecture of your own; its options are further keys of this section",
    )

    @property
    def options(self) -> Mapping[str, bool | int | float | str]:
        """See ``ArchitectureSection``."""
        return dict(self.__pydantic_extra__)
