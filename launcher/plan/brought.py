"""What users registered in this process, for other processes that make plans, too."""

from __future__ import annotations

from typing import Final

from launcher.plan.architectures import ARCHITECTURES
from trackfield.filters.trackers import TRACKERS
from trackfield.plugins import Maker, Plugins
from trackfield.sensing.kinds import SENSORS

TABLES: Final[tuple[Plugins, ...]] = (TRACKERS, SENSORS, ARCHITECTURES)
"""The tables to which users add classes of their own."""
Registered = tuple[dict[str, Maker], ...]
"""Trackers, sensors and architectures by name."""


def registered() -> Registered:
    """What was registered in this process, for other processes to ``register``."""
    return tuple(dict(plugins.registered) for plugins in TABLES)


def register(brought: Registered) -> None:
    """Register the same in this process."""
    for plugins, makers in zip(TABLES, brought, strict=True):
        for name, maker in makers.items():
            plugins.register(name, maker)
