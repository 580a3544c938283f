"""A forwarding node of the backbone: what it hands on, its ``Carried`` does; itself it keeps the time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from trackfield.protocols.timesync import Timekeeping, TimeSync
from trackfield.role import Effect, Event


class Forwarder:
    """Sets its clock (``sync``, as in ``TimeSync.of``), and tells the time to the node after it."""

    def __init__(self, *, sync: Mapping[str, Any] | None = None) -> None:
        self.sync = TimeSync.of(sync)
        self.kinds = self.sync.kinds

    def begin(self) -> Timekeeping:
        """A node that has not started."""
        return self.sync.begin()

    def handle(self, state: Timekeeping, event: Event) -> tuple[Timekeeping, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        return self.sync.handle(state, event)
