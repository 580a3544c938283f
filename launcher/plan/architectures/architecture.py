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
    """The processes of a field without faults, one life each; ``tracking``, ``flows`` as in a ``Plan``.

    The ``peers`` of a process are those that it may hear.
    """

    processes: tuple[ProcessSpec, ...]
    tracking: Mapping[str, Any]
    flows: Sequence[Flow]


class Architecture(Protocol):
    """Made of a surveyed field."""

    def __init__(self, site: Site) -> None: ...

    def places(self) -> tuple[Place, ...]:
        """The places of the processes with their tags; they do not depend on the trackers."""
        ...

    def views(self) -> tuple[View, ...]:
        """Which tracks are scored together, the headline first."""
        ...

    def arrange(self, end_ns: int) -> Arranged:
        """The processes of a run until ``end_ns``. Raises ``ScenarioError`` if trackers and sensors do not fit."""
        ...
