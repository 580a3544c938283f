"""The planned faults of a scenario: whom they affect (``struck``), and what becomes of each process (``fates``)."""

from __future__ import annotations

from launcher.plan.faults.fates import Fates, Faults, Life, Mark, Spell, resolve

__all__ = ["Fates", "Faults", "Life", "Mark", "Spell", "resolve"]
