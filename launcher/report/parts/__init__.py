"""The parts of a report, one per topic: its figures, its tables, its words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Protocol

from launcher.report.folder import Run
from launcher.report.parts import (
    camera,
    channel,
    clusters,
    consistency,
    energy,
    errors,
    field,
    heads,
    latency,
    machine,
    messages,
    passes,
    setting,
    troubles,
    verdicts,
)
from launcher.report.style import Figures


class Part(Protocol):
    """What a module of this folder offers."""

    FIGURES: Figures
    """What it draws; may be empty."""

    def contents(self, run: Run) -> Mapping[str, Any]:
        """What its section of the page is filled with."""
        ...


PARTS: Final[Mapping[str, Part]] = {
    "setting": setting,
    "verdicts": verdicts,
    "field": field,
    "errors": errors,
    "consistency": consistency,
    "clusters": clusters,
    "heads": heads,
    "passes": passes,
    "camera": camera,
    "messages": messages,
    "channel": channel,
    "latency": latency,
    "energy": energy,
    "troubles": troubles,
    "machine": machine,
}
"""By the name that the page's template has for its contents, in the order of the page."""
