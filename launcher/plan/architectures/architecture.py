"""What an architecture says of a surveyed field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from launcher.records import Flow, Place, View
from trackfield.drivers.spec import ProcessSpec
from trackfield.scenario import Site


@dataclass(frozen=True)
class Arranged:
    """The processes of a field before anything befalls them, one life each; ``tracking``, ``flows`` as in a ``Plan``.

    A process's ``peers`` are its own affair: those it may hear.
    """

    processes: tuple[ProcessSpec, ...]
    tracking: Mapping[str, Any]
    flows: Sequence[Flow]


class Architecture(Protocol):
    """Made of a surveyed field."""

    def __init__(self, site: Site) -> None: ...

    def places(self) -> tuple[Place, ...]:
        """Who is there, where, and what for; none of it depends on trackers."""
        ...

    def views(self) -> tuple[View, ...]:
        """Whose tracks are scored together, the headline first."""
        ...

    def arrange(self, end_ns: int) -> Arranged:
        """The processes, in a run that ends then. Raises ``ScenarioError`` for trackers and sensors that do not fit."""
        ...
