"""Where roles are made, by their names."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points

from trackfield.errors import ScenarioError


@cache
def factory(role: str) -> str:
    """Where an installed package makes roles of this name. Raises ``ScenarioError`` if none does."""
    for entry in entry_points(group="trackfield.roles", name=role):
        return entry.value
    raise ScenarioError(f"no installed package offers the role {role!r}", expected="an entry point in trackfield.roles")
