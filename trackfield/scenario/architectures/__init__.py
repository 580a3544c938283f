"""``[architecture]``: how processes are connected. An architecture is a file here and a line in the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trackfield.scenario.architectures.architecture import ArchitectureSection
from trackfield.scenario.architectures.centralised import Centralised
from trackfield.scenario.section import one_of

__all__ = ["ARCHITECTURES", "Architecture", "ArchitectureSection", "Centralised"]

ARCHITECTURES: Final[tuple[type[ArchitectureSection], ...]] = (Centralised,)

if TYPE_CHECKING:
    Architecture = ArchitectureSection
else:
    Architecture = one_of(ARCHITECTURES, "kind")
