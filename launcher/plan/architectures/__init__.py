"""Architectures: which processes track, and how reports reach them; one file each."""

from __future__ import annotations

from typing import Final

from launcher.plan.architectures.architecture import Architecture, Arranged
from launcher.plan.architectures.centralised import Centralised
from trackfield.scenario import Site

__all__ = ["ARCHITECTURES", "Architecture", "Arranged", "architecture_of"]

ARCHITECTURES: Final[dict[str, type[Architecture]]] = {"centralised": Centralised}
"""By the kind that a scenario names."""


def architecture_of(site: Site) -> Architecture:
    """The architecture of a surveyed field's scenario."""
    return ARCHITECTURES[site.scenario.architecture.kind](site)
