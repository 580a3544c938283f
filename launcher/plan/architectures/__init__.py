"""Who tracks, and how word gets there: from a surveyed field to processes, one architecture a file."""

from __future__ import annotations

from typing import Final

from launcher.plan.architectures.architecture import Architecture, Arranged
from launcher.plan.architectures.centralised import Centralised
from trackfield.scenario import Site

__all__ = ["ARCHITECTURES", "Architecture", "Arranged", "architecture_of"]

ARCHITECTURES: Final[dict[str, type[Architecture]]] = {"centralised": Centralised}
"""By the kind that a scenario names."""


def architecture_of(site: Site) -> Architecture:
    """That of a surveyed field's scenario."""
    return ARCHITECTURES[site.scenario.architecture.kind](site)
